"""The obstacle stands before the forearm, clear of it at first, and is met when the tool is led to the right."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.experiments.joint_safety import _HIT_AT, contact_metrics, forearm, held_before_forearm
from contactsafe.experiments.run import run_policy
from contactsafe.policy.action import DOWN
from contactsafe.robot.arm import Pose
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.config import WorldConfig, bottle, thrust_meter
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

SEEDS = range(4)


@pytest.fixture(scope="module")
def probe():
    return WipingTasks(WipingConfig())


def distance_to_arm(tasks, q, point):
    """From a point to the nearest of the forearm's surfaces, m."""
    starts, ends, radii, links = arm_capsules(tasks.arm.description, tasks.arm.tool, q[None])
    gaps = []
    for k in np.flatnonzero(links == 5):
        along = ends[0, k] - starts[0, k]
        s = np.clip((point - starts[0, k]) @ along / (along @ along), 0, 1)
        gaps.append(np.linalg.norm(point - starts[0, k] - s * along) - radii[k])
    return min(gaps)


def over(tasks, y):
    x, _, z = tasks.config.world.board.centre
    return tasks.posture_over(Pose(np.array([x, y, z]), DOWN))


@pytest.mark.parametrize("make", [bottle, thrust_meter])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_forearm_reaches_it_on_its_way_right_and_not_before(probe, make, seed):
    place = np.array(held_before_forearm(probe, make, np.random.default_rng(seed)))
    radius = make((0, 0, 0)).radius
    gaps = np.array([distance_to_arm(probe, over(probe, y), place) for y in np.linspace(0.1, -0.2, 31)]) - radius
    assert gaps[0] > 0.03
    assert gaps.min() < -0.005
    met_at = np.linspace(0.1, -0.2, 31)[int(np.argmax(gaps <= 0))]
    assert _HIT_AT[0] - 0.02 <= met_at <= _HIT_AT[1] + 0.02


def test_the_place_is_its_seeds(probe):
    places = [held_before_forearm(probe, bottle, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert places[0] == places[1]
    assert places[0] != places[2]


def test_forearm_is_the_thickest_capsule_of_link_5(probe):
    middle, radius = forearm(probe.arm, over(probe, 0.0))
    assert radius == 0.06
    starts, ends, radii, links = arm_capsules(probe.arm.description, probe.arm.tool, over(probe, 0.0)[None])
    k = next(k for k in np.flatnonzero(links == 5) if radii[k] == 0.06)
    assert_allclose(middle, (starts[0, k] + ends[0, k]) / 2)


@pytest.mark.parametrize("make", [bottle, thrust_meter])
def test_led_to_the_right_every_seed_meets_it(probe, make):
    rngs = [np.random.default_rng(seed) for seed in SEEDS]
    worlds = [WorldConfig(obstacles=(make(held_before_forearm(probe, make, rng)),)) for rng in rngs]
    tasks = WipingTasks(WipingConfig(controller="vices"), len(SEEDS), 0, worlds)
    for i, rng in enumerate(rngs):
        tasks.reset(i, rng)
        assert tasks.worlds.reports["obstacle_force_peak"][i] == 0.0

    def to_the_right(observation):
        action = np.zeros((len(SEEDS), 18))
        action[:, 1] = -0.5
        action[:, 2] = np.where(observation["pose"][:, 2] > 0.015, -1.0, 0.0)
        return action

    run = run_policy(tasks, to_the_right, 180, stop_when_clean=False)
    tasks.worlds.close()
    for trace in run.traces:
        metrics = contact_metrics(trace)
        assert metrics["met"] == 1.0
        assert metrics["contact_steady_n"] > 20.0
        first = int(np.argmax(trace["obstacle_force"] > 0.5))
        assert first > 100
        assert trace["tau_arm"][:first].max() < 0.01
