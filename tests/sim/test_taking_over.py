"""A controller that is reset while its arm moves or presses, in the closed loop of a world with real sensors."""

import numpy as np
import pytest
from tests.sim.scenes import aim, run, worlds_at

from contactsafe.sim.config import REAL_SENSORS, WorldConfig

REAL = WorldConfig(sensors=REAL_SENSORS)


def taken_over(worlds, ticks=600):
    """Reset the controller where its arm is measured and run on; return the trace before and after."""
    before = run(worlds, 300)[0]
    measured = worlds.controllers["measurement"][0]
    worlds._owners[0].reset(measured["q"].copy(), measured["qd"].copy())
    return before, run(worlds, ticks)[0]


def largest_step(worlds, before, after):
    """Largest change of the command from tick to tick, in parts of what the rate limit allows."""
    torque = np.concatenate([before["torque"], after["torque"]])
    return np.abs(np.diff(torque, axis=0)).max() / worlds.controllers["params"]["torque_step"][0]


def test_a_tool_that_presses_on_the_plate_is_taken_over_without_a_jump_or_a_false_contact():
    """It is held where it is: the press fades, and the tool neither leaves nor is driven into the plate."""
    worlds = worlds_at((0.5, 0.0, 0.0105), REAL)
    aim(worlds, (0.5, 0.0, -0.006), follow=False)
    before, after = taken_over(worlds)
    press = np.linalg.norm(before["tool_force"][-50:], axis=1).mean()
    assert press > 4.0
    assert largest_step(worlds, before, after) <= 1.0 + 1e-9
    assert not after["mode"].any()
    assert np.linalg.norm(after["tool_force"], axis=1).max() < 1.3 * press
    assert np.abs(after["position"] - before["position"][-1]).max() < 2e-3
    worlds.close()


@pytest.mark.parametrize("place", [(0.4, 0.3, 0.25), (0.6, -0.25, 0.3), (0.35, 0.0, 0.5)])
def test_a_moving_arm_is_taken_over_without_a_jump_or_a_false_contact(place):
    worlds = worlds_at((0.5, 0.0, 0.15), REAL)
    aim(worlds, place)
    run(worlds, 100)
    moving = np.abs(worlds.controllers["measurement"]["qd"][0]).max()
    worlds._owners[0].reset(*(worlds.controllers["measurement"][name][0].copy() for name in ("q", "qd")))
    before = worlds.controllers["state"]["tau"].copy()
    after = run(worlds, 1500)[0]
    assert moving > 0.3
    torque = np.concatenate([before, after["torque"]])
    assert np.abs(np.diff(torque, axis=0)).max() <= worlds.controllers["params"]["torque_step"][0] + 1e-9
    assert not after["mode"].any()
    assert np.abs(np.diff(after["q"][-50:], axis=0)).max() < 1e-4
    worlds.close()
