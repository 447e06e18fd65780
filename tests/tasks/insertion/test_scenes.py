"""The insertion task under the experiments: obstacles come to the arm, the script goes in, the hole is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from contactsafe.experiments.joint_safety import place_before_forearm
from contactsafe.experiments.run import run_policy
from contactsafe.robot import robots
from contactsafe.robot.robots import Tip
from contactsafe.sim.config import NO_NOISE, PlantConfig, WorldConfig
from contactsafe.sim.obstacles import bottle
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.scene import PEG
from contactsafe.tasks.insertion.scenes import HOLE, Insertion

STILL = np.zeros((2, 18))
STIFFNESS = (150.0,) * 3 + (450.0,) * 3


def test_the_hole_is_drawn_where_it_is():
    episodes = Insertion().episodes("safe", [0, 1])
    pictures = episodes.pictures()
    radius = 1000 * episodes.tasks.hole_radius
    for picture, mouth in zip(pictures, episodes.tasks.tasks["mouth"], strict=True):
        cells = np.argwhere(picture == HOLE)
        assert abs(len(cells) - np.pi * radius**2) < 0.05 * np.pi * radius**2
        middle = 1e-3 * (cells.mean(axis=0) - (np.array(picture.shape) - 1) / 2) + np.array([0.5, 0.0])
        np.testing.assert_allclose(middle, mouth[:2], atol=3e-4)


def test_an_obstacle_comes_to_the_forearm_and_is_met():
    episodes = Insertion().towards_obstacle("safe", [0, 1], lambda arm, q: bottle(place_before_forearm(arm, q, bottle)))
    run = run_policy(episodes, lambda observation: STILL, 200)
    episodes.worlds.close()
    for trace in run.traces:
        assert trace["obstacle_force"][:500].max() == 0.0
        assert trace["obstacle_force"].max() > 2.0


def test_scenes_of_another_arm_were_those_of_the_panda():
    arm = robots.fr3(replace(PEG, tip=Tip((0.008, 0.008, 0.03), "cylinder")))
    task = Insertion(arm=arm)
    assert (task.stage.arm, task.stage.tool) == (arm.description, arm.tool)
    for episodes in (
        task.episodes("safe", [0]),
        task.towards_obstacle("safe", [0], lambda arm, q: bottle(place_before_forearm(arm, q, bottle))),
        task.scripted("safe", [0], [WorldConfig()], STIFFNESS, works=True)[0],
    ):
        assert episodes.arm is arm
        cells = np.count_nonzero(episodes.pictures() == HOLE)
        assert abs(cells - np.pi * 8.5**2) < 0.05 * np.pi * 8.5**2
        episodes.worlds.close()


def test_scenes_of_another_mouth_and_clearance_were_those_of_the_default_ones():
    config = InsertionConfig(
        mouth=(0.46, 0.04, 0.06),
        clearance_m=0.002,
        depth_m=0.02,
        friction=(0.2, 0.2),
        world=WorldConfig(PlantConfig(payload_kg=0.2)),
    )
    task, seen = Insertion(config), []

    def obstacle_at(arm, q):
        seen.append(arm.tool_pose(q).position)
        return bottle((0.3, -0.6, 0.5))

    episodes = task.towards_obstacle("vices", [0, 1], obstacle_at)
    np.testing.assert_allclose(seen, [config.mouth], atol=1e-4)
    assert episodes.tasks.config == replace(config, controller="vices")
    assert [world.plant for world in episodes.worlds.configs] == [config.world.plant] * 2
    away = episodes.tasks.tasks["mouth"] - np.array(config.mouth)
    assert np.abs(away).max() <= config.error_m
    episodes.worlds.close()

    episodes, act = task.scripted("vices", [0, 1], [WorldConfig(sensors=NO_NOISE)] * 2, STIFFNESS, works=True)
    assert episodes.tasks.hole_radius == pytest.approx(0.012)
    np.testing.assert_allclose(episodes.tasks.tasks["mouth"], [config.mouth] * 2)
    run = run_policy(episodes, act, 150)
    episodes.worlds.close()
    for trace, curves in zip(run.traces, run.curves, strict=True):
        assert curves["depth"][-1] > 0.01
        np.testing.assert_allclose(trace["position"][-1, :2], config.mouth[:2], atol=0.003)


def test_the_script_goes_in_and_the_rest_holds_still():
    for works in (True, False):
        worlds = [WorldConfig(sensors=NO_NOISE)] * 2
        episodes, act = Insertion().scripted("vices", [0, 1], worlds, STIFFNESS, works)
        run = run_policy(episodes, act, 150)
        episodes.worlds.close()
        depth = np.array([curves["depth"][-1] for curves in run.curves])
        assert (depth > 0.01).all() if works else (depth == 0.0).all()
