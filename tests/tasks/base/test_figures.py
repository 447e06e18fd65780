"""Figures of an evaluation: computed from the records alone, NaN where there is nothing to compute them from."""

import math

import numpy as np
import pytest

from contactsafe.tasks.base.figures import FIGURES, Episodes, Figure, names, total

SUCCEEDED = {"success": True, "time_s": 4.0, "peak_force_n": 10.0, "return": 1.0}
FAILED = {"success": False, "time_s": 20.0, "peak_force_n": 30.0, "return": -1.0}


def figures(records, forces=(), steps=100):
    episodes = Episodes(list(records), np.array(forces, dtype=float), steps)
    return {figure.name: figure.compute(episodes) for figure in FIGURES}


def test_every_figure_has_a_name_of_its_own_and_says_what_it_means():
    assert len(names(FIGURES)) == len(FIGURES)
    assert all(meaning and "\n" not in meaning for meaning in names(FIGURES).values())


def test_what_the_records_say():
    found = figures([SUCCEEDED, FAILED], forces=[1.0, 2.0, 9.0], steps=6)
    assert found["episodes"] == 2
    assert found["success"] == 0.5
    assert found["time_mean_s"] == 12.0
    assert found["time_to_success_median_s"] == 4.0
    assert found["peak_force_median_n"] == 20.0
    assert found["peak_force_max_n"] == 30.0
    assert found["contact_force_median_n"] == 2.0
    assert found["contact_fraction"] == 0.5
    assert found["return_mean"] == 0.0


def test_a_total_counts_the_episodes_in_which_something_was_so():
    records = [{**SUCCEEDED, "touched": touched} for touched in (True, False, True)]
    assert total("touched")(Episodes(records, np.zeros(0), 1)) == 2


def test_a_policy_that_never_succeeds_nor_touches_still_has_figures():
    found = figures([FAILED])
    assert math.isnan(found.pop("time_to_success_median_s"))
    assert found["contact_force_median_n"] == found["contact_fraction"] == 0.0
    assert all(math.isfinite(value) for value in found.values())


@pytest.mark.parametrize("seed", range(3))
def test_figures_do_not_depend_on_the_order_of_episodes(seed):
    rng = np.random.default_rng(seed)
    records = [{**SUCCEEDED, "time_s": t, "peak_force_n": f, "success": t < 0.7} for t, f in rng.uniform(size=(9, 2))]
    shuffled = [records[k] for k in rng.permutation(9)]
    assert figures(shuffled) == pytest.approx(figures(records), nan_ok=True)


def test_a_task_adds_a_figure_by_a_function_of_the_episodes():
    held = Figure("held_max_s", "longest hold, s", lambda episodes: float(episodes.of("held_s").max()))
    assert held.compute(Episodes([{"held_s": 0.2}, {"held_s": 0.5}], np.empty(0), 1)) == 0.5
