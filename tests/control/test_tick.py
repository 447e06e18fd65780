"""One tick, one result: whoever calls it, and whenever its state was saved."""

import numba
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.control.plant import controller_at, hold, reach, wrist_meets_sphere

from contactsafe import Measurement, presets
from contactsafe.control.records import controller_dtype
from contactsafe.control.tick import control_tick, tick_at

TICKS = 900


@numba.njit
def run_compiled(records, i, q, qd, wrench, torque):
    c = records[i]
    for k in range(q.shape[0]):
        c.measurement.q[:] = q[k]
        c.measurement.qd[:] = qd[k]
        c.measurement.wrench_ee[:] = wrench[k]
        c.measurement.has_wrench = 1
        control_tick(c)
        torque[k] = c.output.torque


@pytest.fixture(scope="module")
def recording(panda):
    """Measurements of a collision, the target that led to it, and the torques that Controller.step gave."""
    plant = wrist_meets_sphere(panda, 0.04, 5000.0)
    controller, rng = controller_at(panda, presets.safe()), np.random.default_rng(5)
    target = reach(panda, [0.0, 0.1, 0.02])._replace(stiffness=rng.uniform(50, 300, 6))
    q, qd, torque, modes = [], [], [], []
    wrench = rng.normal(size=(TICKS, 6))
    for k in range(TICKS):
        q.append(plant.q)
        qd.append(plant.qd)
        out = controller.step(Measurement(q[-1], qd[-1], wrench[k]), target)
        torque.append(out.torque)
        modes.append(out.contact.in_contact)
        plant.step(out.torque)
    assert 0 < sum(modes) < TICKS
    return np.array(q), np.array(qd), wrench, np.array(torque), target


def prepared(panda, target, count=3):
    """Give records of `count` controllers reset at home, and the controllers, which keep their models alive."""
    records = np.zeros(count, dtype=controller_dtype(panda.n))
    controllers = [controller_at(panda, presets.safe(), records=records, index=i) for i in range(count)]
    for controller in controllers:
        controller.set_target(target)
    return records, controllers


def test_compiled_loop_gives_the_same_bits(panda, recording):
    q, qd, wrench, torque, target = recording
    records, _alive = prepared(panda, target)
    again = np.zeros_like(torque)
    run_compiled(records, 1, q, qd, wrench, again)
    assert_array_equal(again, torque)


def test_tick_at_gives_the_same_bits(panda, recording):
    q, qd, wrench, torque, target = recording
    records, _alive = prepared(panda, target)
    for k in range(TICKS):
        measurement = records[2]["measurement"]
        measurement["q"], measurement["qd"], measurement["wrench_ee"] = q[k], qd[k], wrench[k]
        measurement["has_wrench"] = 1
        tick_at(records, 2)
        assert_array_equal(records[2]["output"]["torque"], torque[k])


def test_neighbours_in_an_array_are_left_alone(panda, recording):
    q, qd, wrench, torque, target = recording
    records, _alive = prepared(panda, target)
    before = records.copy()
    run_compiled(records, 1, q, qd, wrench, np.zeros_like(torque))
    assert records[0].tobytes() == before[0].tobytes()
    assert records[2].tobytes() == before[2].tobytes()


@pytest.mark.parametrize("saved_at", [1, 200, 450])
def test_saved_state_goes_on_with_the_same_bits(panda, recording, saved_at):
    """State and target are copied; everything else another controller has of its own."""
    q, qd, wrench, torque, target = recording
    first, _alive = prepared(panda, target)
    run_compiled(first, 0, q[:saved_at], qd[:saved_at], wrench[:saved_at], torque[:saved_at].copy())
    state, kept = first[0]["state"].copy(), first[0]["target"].copy()
    second, _too = prepared(panda, hold(panda))
    second[0]["state"], second[0]["target"] = state, kept
    rest = np.zeros_like(torque[saved_at:])
    run_compiled(second, 0, q[saved_at:], qd[saved_at:], wrench[saved_at:], rest)
    assert_array_equal(rest, torque[saved_at:])


def test_reset_forgets_everything_but_the_torque_that_was_sent_last(panda, recording):
    q, qd, wrench, torque, target = recording
    records, controllers = prepared(panda, target)
    run_compiled(records, 0, q, qd, wrench, np.zeros_like(torque))
    controllers[0].reset(panda.home, torque=panda.dynamics(panda.home, np.zeros(7))["g"])
    controllers[0].set_target(target)
    again = np.zeros_like(torque)
    run_compiled(records, 0, q, qd, wrench, again)
    assert_array_equal(again, torque)
