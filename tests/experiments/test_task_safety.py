"""Task safety: which episode is shown, and what is declared of it."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.task_safety import task_safety
from contactsafe.policy.bundle import Bundle, shipped_bundle
from contactsafe.tasks.wiping.scenes import Wiping


def config(controllers, trials):
    return ExperimentConfig(controllers, trials, 0, task=Wiping(), bundle=Bundle.load(shipped_bundle("wiping")))


def test_the_film_is_not_of_a_board_that_one_stroke_wipes_but_of_the_fullest():
    found = task_safety(config(("vices", "safe"), 2))
    assert [(recording.controller, recording.seed) for recording in found.recordings] == [("vices", 1), ("safe", 1)]
    first, second = (recording.pictures[0] for recording in found.recordings)
    np.testing.assert_array_equal(first, second)
    alone = task_safety(config(("safe",), 1))
    assert np.count_nonzero(alone.recordings[0].pictures[0]) < np.count_nonzero(second)
    declared = {metric.name for metric in found.metrics}
    assert declared <= set(found.trials[0].metrics)
    assert {highlight.metric for highlight in found.highlights} <= declared
    assert found.policy == Wiping.policy


@pytest.mark.parametrize(("given", "missing"), [({}, "runs a task"), ({"task": Wiping()}, "runs a policy")])
def test_without_task_or_policy_it_is_refused(given, missing):
    with pytest.raises(InvalidInputError, match=f"^this experiment {missing}.*give ExperimentConfig"):
        task_safety(ExperimentConfig(("safe",), 1, **given))
