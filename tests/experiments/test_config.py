"""What experiments can be told: what makes no sense is refused, seeds come in batches."""

import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import BATCH, ExperimentConfig


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"controllers": ("safe", "best")}, "controller 'best' is unknown; choose from vices, paper, safe"),
        ({"controllers": ()}, "no controller given; choose from vices, paper, safe"),
        ({"controllers": ("safe", "safe")}, "controllers = safe,safe; give each once"),
        ({"trials": 0}, "trials = 0; give 1 or more"),
        ({"seed": -1}, "seed = -1; give 0 or more"),
        ({"plants": ("real", "wet")}, "plants = real,wet; choose from real, clean"),
        ({"plants": ()}, "plants = ; choose from real, clean"),
        ({"minutes": 0.0}, "minutes = 0; give a number greater than 0"),
    ],
)
def test_experiments_that_cannot_be_run_are_refused(fields, text):
    with pytest.raises(InvalidInputError) as caught:
        ExperimentConfig(**fields)
    assert str(caught.value) == text


@pytest.mark.parametrize("trials", [1, BATCH, BATCH + 1, 40])
def test_batches_hold_every_seed_once_in_order(trials):
    batches = ExperimentConfig(trials=trials, seed=5).batches()
    assert [seed for batch in batches for seed in batch] == list(range(5, 5 + trials))
    assert max(len(batch) for batch in batches) <= BATCH
