"""A torque measured behind the gears drives the links alone: motor friction and rotors are out of the residual."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.control.plant import Plant, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.friction import joint_friction

FAST = presets.vices().with_(compensation_gain=50.0, residual_cutoff_hz=1e6)


class Geared(Plant):
    """The same arm with friction before a sensor of torque."""

    def __init__(self, arm):
        super().__init__(arm)
        self.behind_gears = self.arm.dynamics(self.q, self.qd)["g"].copy()

    def step(self, torque):
        before, drag = self.qd, 3.0 * joint_friction(self.arm.friction, self.qd)  # three times what is published
        super().step(torque - drag)
        self.behind_gears = torque - drag - self.arm.model.dof_armature * (self.qd - before) / 0.001


def residuals(arm, measures, ticks=1200, push=None):
    plant, controller = Geared(arm), controller_at(arm, FAST)
    if push is not None:
        plant.push(*push)
    target, seen = (hold(arm) if push else reach(arm, [0.1, 0.1, 0.05])), []
    for _ in range(ticks):
        measured = Measurement(plant.q, plant.qd, np.zeros(6), torque=plant.behind_gears if measures else None)
        out = controller.step(measured, target)
        plant.step(out.torque)
        seen.append(out.residual)
    return np.array(seen), plant


def test_friction_that_nobody_knows_is_no_residual_where_the_torque_behind_it_is_measured(panda):
    commanded, measured = (residuals(panda, measures)[0] for measures in (False, True))
    rms_commanded, rms_measured = np.sqrt(np.mean(commanded**2)), np.sqrt(np.mean(measured**2))
    assert np.abs(commanded).max() > 0.5
    assert rms_measured < 0.1 * rms_commanded


def test_a_push_shows_with_its_size_whatever_the_friction(panda):
    seen, plant = residuals(panda, True, 2500, ("link5", (0.0, 25.0, 0.0)))
    truth = plant.push_torque()
    assert_allclose(seen[-1], truth, rtol=0, atol=0.02 * np.linalg.norm(truth))


def test_a_sensor_that_comes_and_goes_makes_no_contact(panda):
    """The rotors' momentum would come and go with it: 0.1 kg m² at 1 rad/s within a millisecond is 100 N m."""
    plant, controller = Geared(panda), controller_at(panda, presets.safe())
    largest = 0.0
    for k in range(900):
        torque = plant.behind_gears if k // 100 % 2 else None
        out = controller.step(Measurement(plant.q, plant.qd, np.zeros(6), torque=torque), reach(panda, [0.1, 0.1, 0.0]))
        plant.step(out.torque)
        largest = max(largest, np.abs(out.contact.torque).max())
        assert not out.contact.in_contact
    assert np.abs(plant.qd).max() < 2.0
    assert largest < 2.0


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e9])
def test_a_broken_torque_sensor_is_bridged_and_then_stops_the_arm(panda, value):
    plant, controller = Plant(panda), controller_at(panda, presets.safe())
    torque = plant.arm.dynamics(plant.q, plant.qd)["g"].copy()
    for k in range(60):
        seen = np.where(np.arange(7) == 3, value, torque) if k >= 20 else torque
        out = controller.step(Measurement(plant.q, plant.qd, np.zeros(6), torque=seen), hold(panda))
        assert np.isfinite(out.torque).all()
        plant.step(out.torque)
    assert out.braked
    assert "unusable" in out.fault


def test_a_torque_of_another_shape_is_refused(panda):
    with pytest.raises(InvalidInputError, match=r"^torque has shape \(6,\)"):
        controller_at(panda, FAST).step(Measurement(panda.home, np.zeros(7), torque=np.zeros(6)), hold(panda))


@pytest.mark.parametrize("source", ["robot", "positions"])
def test_a_payload_that_is_told_amid_a_motion_is_no_contact(panda, source):
    """The momentum that is taken over has no rotors in it where the torque is measured behind them."""
    config = presets.safe().with_(velocity_source=source)
    plant, controller = Geared(panda), controller_at(panda, config)
    target = reach(panda, [0.15, 0.15, 0.0])
    for k in range(400):
        out = controller.step(Measurement(plant.q, plant.qd, np.zeros(6), torque=plant.behind_gears), target)
        plant.step(out.torque)
        if k == 200:
            assert np.abs(plant.qd).max() > 0.5
            controller.set_payload(0.02)
        assert not out.contact.in_contact
