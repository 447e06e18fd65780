"""What late worlds do to a measurement, and what a silent policy leaves in force."""

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.experiments.clock_cases import sample_scene
from contactsafe.experiments.late_worlds import (
    NUDGED,
    POSITION_JUMPS,
    SEEN,
    VELOCITY_JUMPS,
    LatePlayback,
    LateWorlds,
)
from contactsafe.robot import robots
from contactsafe.sim.config import NO_NOISE, REAL_SENSORS, WorldConfig
from contactsafe.sim.worlds import MAX_TICKS

ARM = robots.panda()
JOINT = 1


def measured(code, timed=True):
    """Measurements of two worlds after one tick, the second one's with a code."""
    config = WorldConfig(sensors=NO_NOISE)
    worlds = LateWorlds(ARM, [config] * 2, presets.safe(), [0, 0], [[SEEN], [code]], timed)
    for i in range(2):
        worlds.reset(i, ARM.home)
    worlds.run(1)
    found = worlds.controllers["measurement"].copy()
    worlds.close()
    return found


@pytest.mark.parametrize(
    ("code", "field", "size"), [(VELOCITY_JUMPS, "qd", 0.2), (POSITION_JUMPS, "q", 0.05), (NUDGED, "q", 1.2e-5)]
)
def test_a_jump_is_of_one_joint_and_one_kind(code, field, size):
    calm, jumped = measured(code)
    expected = np.zeros(ARM.n)
    expected[JOINT] = size
    np.testing.assert_allclose(jumped[field] - calm[field], expected, atol=1e-12)
    other = "qd" if field == "q" else "q"
    np.testing.assert_array_equal(jumped[other], calm[other])


@pytest.mark.parametrize("timed", [False, True])
def test_measurements_carry_their_time_where_asked_to(timed):
    assert (measured(SEEN, timed)["has_time"] == timed).all()


@pytest.fixture(scope="module")
def scene():
    return sample_scene(ARM, "moving", 2)


def play(scene, silent):
    ticks = scene.at + 200
    codes = np.full((1, ticks + MAX_TICKS), SEEN)
    worlds = LateWorlds(ARM, [scene.motion.world((), REAL_SENSORS)], presets.safe(), [scene.seed], codes, True)
    trace = LatePlayback(worlds, [scene.motion], ticks, [silent]).record()
    worlds.close()
    return trace[0]


def test_a_playback_lasts_as_long_as_asked_whatever_its_motion(scene):
    assert scene.at + 200 <= len(play(scene, (0, 0))) < scene.at + 200 + MAX_TICKS


def test_nothing_changes_before_the_policy_falls_silent(scene):
    heard, silent = play(scene, (0, 0)), play(scene, (scene.at, scene.at + 100))
    np.testing.assert_array_equal(silent["position"][: scene.at], heard["position"][: scene.at])
    aims = [trace["position"] + trace["error"][:, :3] for trace in (heard, silent)]
    assert np.ptp(aims[0][scene.at : scene.at + 60], axis=0).max() > 0.0
    assert np.linalg.norm(aims[1] - aims[0], axis=1).max() > 1e-4
