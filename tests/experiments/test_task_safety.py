"""Task safety: which board is shown."""

import numpy as np

from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.task_safety import task_safety
from contactsafe.policy.bundle import Bundle, shipped_bundle


def test_the_film_is_not_of_a_board_that_one_stroke_wipes_but_of_the_fullest():
    found = task_safety(Bundle.load(shipped_bundle("wiping")), ExperimentConfig(("vices", "safe"), trials=2, seed=0))
    assert [(recording.controller, recording.seed) for recording in found.recordings] == [("vices", 1), ("safe", 1)]
    first, second = (recording.boards[0] for recording in found.recordings)
    np.testing.assert_array_equal(first, second)
    alone = task_safety(Bundle.load(shipped_bundle("wiping")), ExperimentConfig(("safe",), trials=1, seed=0))
    assert np.count_nonzero(alone.recordings[0].boards[0]) < np.count_nonzero(second)
