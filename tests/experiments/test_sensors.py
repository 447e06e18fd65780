"""Sensors are chosen by name, and what a battery was run with is in the command that runs a trial of it again."""

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.collisions import run_battery
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.pushes import run_pushes
from contactsafe.experiments.sensors import require_sensors, sensors_words
from contactsafe.robot import robots
from contactsafe.sim.config import SENSORS
from contactsafe.sim.worlds import Worlds

TWO = {"vices": presets.vices(), "safe": presets.safe()}


def test_a_name_that_no_sensors_have_is_told_with_those_that_there_are():
    with pytest.raises(InvalidInputError, match=r"^sensors = 'laser'; choose from encoders, franka$"):
        ExperimentConfig(sensors="laser")
    assert require_sensors("franka") == "franka"


def test_the_usual_sensors_need_no_words():
    assert sensors_words(ExperimentConfig().sensors) == []
    assert sensors_words("franka") == ["--sensors", "franka"]


@pytest.mark.parametrize(("name", "measured"), [("encoders", 0), ("franka", 1)])
def test_a_franka_measures_its_torque(name, measured):
    arm, motion = robots.panda(), sample_motion(robots.panda(), 0)
    worlds = Worlds(arm, [motion.world((), ExperimentConfig(sensors=name).real_sensors)], presets.safe(), 1, [0])
    worlds.run(17)
    found = worlds.controllers[0]["measurement"]
    assert found["has_torque"] == measured
    assert np.isfinite(found["qd"]).all()
    worlds.close()


@pytest.mark.parametrize("battery", [run_battery, run_pushes])
def test_a_trial_with_other_sensors_was_run_again_with_the_usual_ones(battery):
    result = battery(TWO, [3], sensors="franka")
    replays = {row["replay"] for table in result.tables for row in table.as_records() if "replay" in row}
    assert all("--sensors franka" in line for line in replays)
    assert set(SENSORS) == {"encoders", "franka"}


def test_the_sensors_make_a_difference():
    usual, franka = (run_pushes(TWO, [3], sensors=name).trials for name in SENSORS)
    assert repr(usual) != repr(franka)
