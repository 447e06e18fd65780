"""Scenes of a task under the experiments: what those of all tasks have in common."""

import pytest
from numpy.testing import assert_array_equal

from contactsafe.experiments.task_safety import with_aims
from contactsafe.robot import robots
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.obstacles import bottle
from contactsafe.tasks.base.scenes import TaskScenes
from contactsafe.tasks.insertion.scenes import Insertion
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.scenes import Wiping


@pytest.mark.parametrize("kind", [Wiping, Insertion])
def test_a_task_is_seen_as_configured_with_the_controller_that_is_compared(kind):
    scenes = kind()
    assert isinstance(scenes, TaskScenes)
    assert scenes.config == kind.tasks_type.config_type()
    assert scenes.under("vices").controller == "vices"
    assert scenes.config.controller == "safe"
    assert scenes.stage.arm is scenes.arm.description
    assert scenes.stage.tool is scenes.arm.tool


@pytest.mark.parametrize("kind", [Wiping, Insertion])
def test_a_task_says_what_its_forces_should_be_and_which_episode_is_worth_showing(kind):
    declared = {metric.name: metric.aim for metric in with_aims(kind.aims)}
    assert declared["tool_force_median_n"].at_most == {"wiping": 10.0, "inserting": 15.0}[kind.name]
    assert (declared["landing_peak_n"] is None) == (kind is Insertion)
    episodes = kind().episodes("safe", [0, 1, 2])
    worth = episodes.worth_showing()
    assert worth.shape == (3,)
    assert len(set(worth)) == 3
    assert (worth >= 0).all()
    episodes.begin()
    assert_array_equal(episodes.worth_showing(), worth)
    episodes.worlds.close()


def test_there_is_one_task_a_seed_in_a_world_of_its_own_with_the_arm_that_works():
    scenes = Wiping(WipingConfig(episode_s=3.0), robots.fr3())
    worlds = [WorldConfig(obstacles=(bottle((0.3, -0.6, z)),)) for z in (0.4, 0.5)]
    tasks = scenes.make_tasks(scenes.under("paper"), [4, 5], worlds)
    assert tasks.arm is scenes.arm
    assert tasks.step_limit == 180
    assert [config.obstacles for config in tasks.worlds.configs] == [world.obstacles for world in worlds]
    assert tasks.worlds.configs[0].obstacles != tasks.worlds.configs[1].obstacles
    tasks.worlds.close()
