"""The brake of an arm that is too fast: it only ever takes energy, and no more torque rate than motors have."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.control.braking import brake_into, braking_fraction

RATE, DT, DELAY = 300.0, 0.001, 2
TAU_MAX, TORQUE_RATE = 1000.0, 1000.0


def brake(M, qd):
    n = len(qd)
    return brake_into(M, np.linalg.inv(M), qd, np.full(n, TAU_MAX), TORQUE_RATE, RATE, np.empty(n))


def swing(m, law, ticks=3000):
    """Let a law brake an inertia from 12 rad/s, late, within torque and torque rate; give its speed, tick by tick."""
    speeds, tau = [12.0] * (DELAY + 1), 0.0
    for _ in range(ticks):
        step = TORQUE_RATE * DT
        tau = float(np.clip(np.clip(law(speeds[-1 - DELAY]), tau - step, tau + step), -TAU_MAX, TAU_MAX))
        speeds.append(speeds[-1] + DT * tau / m)
    return np.array(speeds)


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_it_only_takes_energy_and_no_more_than_its_share_of_torque(seed, n):
    rng = np.random.default_rng(seed)
    root = 10.0 ** rng.uniform(-3.0, 0.5, n)[:, None] * rng.normal(size=(n, n))
    M, qd = root @ root.T + 1e-6 * np.eye(n), rng.normal(size=n) * 10.0 ** rng.uniform(-1.0, 2.0)
    tau = brake(M, qd)
    assert tau @ qd <= 0.0
    assert (np.abs(tau) <= 0.5 * TAU_MAX + 1e-9).all()


@pytest.mark.parametrize("m", [0.1, 0.3, 1.0, 3.0])
def test_a_brake_that_motors_could_not_follow_swung_on(m):
    """As stiff as the loop takes, it came back with nine tenths of the speed; no stiffer than motors are it stops."""
    assert swing(m, lambda v: -RATE * m * v).min() < -0.9 * 12.0
    speeds = swing(m, lambda v: brake(np.array([[m]]), np.array([v]))[0])
    assert speeds.min() > -0.1 * 12.0
    assert np.abs(speeds[500:]).max() < 0.1


@pytest.mark.parametrize("m", [1e-6, 1e-4, 1e-2])
def test_a_light_joint_is_braked_at_once(m):
    speeds = swing(m, lambda v: brake(np.array([[m]]), np.array([v]))[0])
    assert np.abs(speeds[50:]).max() < 0.1


def test_it_takes_over_gradually_and_wholly_at_the_speed_limit():
    zero, one, most = np.zeros(2), np.ones(2), np.full(2, 10.0)
    qd = np.array([1.0, 0.0])
    fractions = [braking_fraction(v * qd, v * qd, zero, most, one) for v in (0.0, 7.9, 9.0, 10.0, 30.0)]
    assert fractions == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])
    assert braking_fraction(zero, -10.0 * qd, zero, most, one) == 1.0  # before it is so fast
    assert braking_fraction(zero, zero, 0.5 * one, most, one) == 1.0  # its own motion takes half the torque
    assert math.isclose(braking_fraction(zero, zero, 0.32 * one, most, one), 0.0, abs_tol=1e-12)
