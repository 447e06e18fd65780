"""Impulses over windows balance: what drives the links is what their momentum and β need, without acceleration."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe import Payload, robots
from contactsafe.logs.impulses import SLOW_RAD_S, WINDOW_S, friction_step, impulses_of
from contactsafe.logs.smoothing import Signals
from contactsafe.robot.description import Inertia
from contactsafe.robot.friction import joint_friction
from contactsafe.robot.payload import carrying
from contactsafe.robot.regressor import parameters_of, site_in_link

RATE_HZ = 500.0


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


def swinging(arm, seconds=3.0):
    """Return signals of a smooth motion, and its acceleration."""
    time = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    w, size = 2.0 * np.pi * np.linspace(0.3, 0.9, arm.n), 0.3
    phase = np.outer(time, w)
    q, qd, qdd = arm.home + size * np.sin(phase), size * w * np.cos(phase), -size * w**2 * np.sin(phase)
    nothing = np.zeros(arm.n)
    return Signals(time, q, qd, None, None, np.ones(len(time), dtype=bool), nothing, nothing), qdd


def needed(arm, signals, qdd):
    """Return the torque that drives the links, rotors left out, row by row."""
    rows = []
    for q, qd, acceleration in zip(signals.q, signals.qd, qdd, strict=True):
        now = arm.dynamics(q, qd)
        M = now["M"] - np.diag(arm.model.dof_armature)
        rows.append(M @ acceleration + now["c"] + now["g"])
    return np.array(rows)


def test_nothing_is_left_of_the_torque_that_the_links_need(arm):
    signals, qdd = swinging(arm)
    found = impulses_of(arm, signals, needed(arm, signals, qdd), ())
    assert_allclose(found.driving, 0.0, atol=2e-3)
    assert found.time[1] - found.time[0] == pytest.approx(WINDOW_S)


def test_what_is_left_of_a_payload_is_what_its_parameters_say(arm):
    signals, qdd = swinging(arm)
    load = Payload(1.1, np.array([0.02, 0.01, 0.06]), np.eye(3) * 2e-3)
    found = impulses_of(arm, signals, needed(carrying(arm, load), signals, qdd), ())
    R, origin = site_in_link(arm)
    at_link = parameters_of(Inertia.of(load.mass, origin + R @ load.com, R @ load.inertia @ R.T))
    assert_allclose(found.driving, found.load @ at_link, atol=2e-3)


def test_speed_and_acceleration_are_means(arm):
    signals, qdd = swinging(arm)
    found = impulses_of(arm, signals, np.zeros_like(qdd), ())
    rows = round(WINDOW_S * RATE_HZ)
    assert_allclose(found.acceleration[3], qdd[3 * rows : 4 * rows + 1].mean(axis=0), atol=0.02)
    assert_allclose(found.speed[3], signals.qd[3 * rows : 4 * rows + 1].mean(axis=0), atol=0.01)


def test_a_step_is_half_of_gazs_friction(arm):
    qd = np.random.default_rng(0).normal(size=(20, 7))
    expected = np.array([joint_friction(arm.friction, row) for row in qd])
    assert_allclose(0.5 * arm.friction[:, 0] * friction_step(arm.friction[:, 1:], qd), expected, atol=1e-12)


def test_windows_with_rows_that_are_missing_are_left_out(arm):
    signals, qdd = swinging(arm)
    whole = signals.whole.copy()
    whole[705:720] = False
    every, some = (impulses_of(arm, signals._replace(whole=one), 0.0 * qdd, ()) for one in (signals.whole, whole))
    assert len(some.time) == len(every.time) - 1
    assert np.abs(some.time - 1.42).min() > 0.5 * WINDOW_S


def test_a_joint_that_turns_back_is_not_moving(arm):
    signals, qdd = swinging(arm)
    found = impulses_of(arm, signals, 0.0 * qdd, ())
    rows = round(WINDOW_S * RATE_HZ)
    slow = np.abs(signals.qd[: rows * len(found.time)]).reshape(len(found.time), rows, 7) < SLOW_RAD_S
    np.testing.assert_array_equal(found.moving, ~slow.any(axis=1))
    assert 0.5 < found.moving.mean() < 1.0


def test_parts_of_a_long_log_join_without_a_seam(arm, monkeypatch):
    from contactsafe.logs import impulses

    signals, qdd = swinging(arm)
    torque = needed(arm, signals, qdd)
    at_once = impulses_of(arm, signals, torque, ())
    monkeypatch.setattr(impulses, "_ROWS", 120)
    for one, other in zip(impulses_of(arm, signals, torque, ()), at_once, strict=True):
        assert_allclose(one, other, atol=1e-12)
