"""The paper's experiments run on a task that the package has never seen."""

import numpy as np
import pytest
from tests.experiments.fake_task import GOAL_M, Reaching, ReachingEpisodes

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.disturbance import PUSH_POINTS, disturbance
from contactsafe.experiments.joint_safety import OBSTACLES, joint_safety
from contactsafe.experiments.run import run_policy
from contactsafe.experiments.task_safety import METRICS, task_safety, with_aims
from contactsafe.policy.bundle import Bundle, shipped_bundle

TASK = Reaching()


@pytest.fixture(scope="module")
def config():
    return ExperimentConfig(("vices", "safe"), 2, 3, task=TASK, bundle=Bundle.load(shipped_bundle("wiping")))


@pytest.fixture(scope="module")
def task_result(config):
    return task_safety(config)


def test_task_safety_reports_the_tasks_metrics_beside_its_own(task_result):
    assert [trial.scenario for trial in task_result.trials] == ["reaching"] * 4
    for trial in task_result.trials:
        assert trial.metrics["success"] == 1.0
        assert 1000 * GOAL_M < trial.metrics["away_mm"] < 2000 * GOAL_M
        assert trial.metrics["tool_force_peak_n"] < 1.0
    names = [metric.name for metric in task_result.metrics]
    assert names[0] == "away_mm"
    assert "tool_force_peak_n" in names
    assert task_result.highlights[0] == TASK.highlights[0]
    assert task_result.figures[0].plots[-1] == TASK.panels
    assert task_result.figures[0].caption.endswith("range; distance.")
    assert (task_result.stage, task_result.policy) == (TASK.stage, TASK.policy)


def test_the_aims_of_wiping_judged_every_task(task_result):
    aims = {metric.name: metric.aim for metric in task_result.metrics if metric.name in [m.name for m in METRICS]}
    assert {name: aim for name, aim in aims.items() if aim is not None} == dict(TASK.aims)
    assert all(metric.aim is None for metric in METRICS)
    with pytest.raises(InvalidInputError, match=r"^the task has aims for force_n; choose from tool_force_peak_n, "):
        with_aims({"force_n": TASK.aims["tool_force_peak_n"]})


def test_task_safety_shows_the_episode_with_most_to_see(task_result):
    assert [recording.seed for recording in task_result.recordings] == [4, 4]
    for recording in task_result.recordings:
        assert recording.pictures.shape[1:] == (4, 6)
        assert len(recording.curves["away"]) == len(recording.trace)


def test_joint_safety_puts_each_obstacle_before_the_forearm(config, monkeypatch):
    monkeypatch.setattr("contactsafe.experiments.joint_safety.DURATION_S", 0.5)
    told = []
    found = joint_safety(config, told.append)
    assert sum(told) == len(found.trials) == 4 * len(OBSTACLES)
    assert [recording.scenario for recording in found.recordings] == [name for name in OBSTACLES for _ in range(2)]
    assert all(recording.obstacle is not None for recording in found.recordings)
    assert found.stage == TASK.stage


def test_disturbance_pushes_at_rest_and_while_the_task_works(config, monkeypatch):
    monkeypatch.setattr("contactsafe.experiments.disturbance.PUSH_POINTS", {5: PUSH_POINTS[5]})
    found = disturbance(config)
    assert list(found.spreads()) == ["push on link 5 while at rest", "push on link 5 while reaching"]
    for trial in found.trials:
        assert trial.metrics["error_max_mm"] > 1.0
    shaded = found.figures[0].shaded(found.recordings[0])
    assert shaded.sum() == 1500
    assert not shaded[:500].any()


def test_a_run_asks_the_policy_once_a_step_and_keeps_every_tick():
    episodes = ReachingEpisodes("safe", [0, 1])
    run = run_policy(episodes, lambda seen: np.full((len(seen["pose"]), 18), 0.5), 10, picture_every_steps=4)
    assert len(episodes.actions) == 10
    assert [len(trace) for trace in run.traces] == [170, 170]
    assert run.pictures.shape == (3, 2, 4, 6)
    assert np.all(np.diff(run.curves[0]["away"][::17]) > -1e-3)
    assert not run.succeeded.any()


def test_to_the_end_goes_on_past_success():
    steps = 20
    whole = run_policy(ReachingEpisodes("safe", [0]), lambda seen: np.zeros((1, 18)), steps)
    cut = run_policy(ReachingEpisodes("safe", [0]), lambda seen: np.zeros((1, 18)), steps, to_the_end=False)
    assert len(whole.traces[0]) == 17 * steps
    assert len(cut.traces[0]) < len(whole.traces[0])
    assert cut.succeeded.all()
    np.testing.assert_array_equal(whole.traces[0][: len(cut.traces[0])]["q"], cut.traces[0]["q"])
