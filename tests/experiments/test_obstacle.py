"""The obstacle stands before the forearm, clear of it at first, and is met when the tool is led to the right."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.experiments.joint_safety import contact_metrics, forearm, place_before_forearm
from contactsafe.experiments.run import run_policy
from contactsafe.policy.action import DOWN
from contactsafe.robot.arm import Pose
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.obstacles import bottle, thrust_meter
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.scenes import OBSTACLE_AT, Wiping, meeting_posture
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


def place(tasks, make, seed):
    return place_before_forearm(tasks.arm, meeting_posture(tasks, np.random.default_rng(seed)), make)


def over(tasks, y):
    x, _, z = tasks.config.board.centre
    return tasks.posture_over(Pose(np.array([x, y, z]), DOWN))


@pytest.mark.parametrize("make", [bottle, thrust_meter])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_forearm_reaches_it_going_right_and_not_before(probe, make, seed):
    centre = np.array(place(probe, make, seed))
    radius = make((0, 0, 0)).radius
    gaps = np.array([distance_to_arm(probe, over(probe, y), centre) for y in np.linspace(0.1, -0.2, 31)]) - radius
    assert gaps[0] > 0.03
    assert gaps.min() < -0.005
    met_at = np.linspace(0.1, -0.2, 31)[int(np.argmax(gaps <= 0))]
    assert OBSTACLE_AT[0] - 0.02 <= met_at <= OBSTACLE_AT[1] + 0.02


def test_the_place_is_its_seeds(probe):
    places = [place(probe, bottle, seed) for seed in (1, 1, 2)]
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
    episodes = Wiping().towards_obstacle("vices", SEEDS, lambda arm, q: make(place_before_forearm(arm, q, make)))
    assert (episodes.worlds.metrics["obstacle_force_peak"] == 0.0).all()

    def to_the_right(observation):
        action = np.zeros((len(SEEDS), 18))
        action[:, 1] = -0.5
        action[:, 2] = np.where(observation["pose"][:, 2] > 0.015, -1.0, 0.0)
        return action

    run = run_policy(episodes, to_the_right, 180)
    episodes.worlds.close()
    for trace in run.traces:
        metrics = contact_metrics(trace)
        assert metrics["met"] == 1.0
        assert metrics["contact_steady_n"] > 20.0
        first = int(np.argmax(trace["obstacle_force"] > 0.5))
        assert first > 100
        assert trace["tau_arm"][:first].max() < 0.01
