"""Joint stops: within range and speed nothing changes; beyond, a joint is braked and pushed back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.control.damping import joint_damping_limits
from contactsafe.control.joint_stops import (
    joint_excess,
    joint_stop_gains,
    joint_stop_torque,
    predict_velocity,
    stops_dtype,
)
from contactsafe.control.params import arm_dtype

Q_MIN, Q_MAX, QD_MAX = np.array([-2.0, -3.0]), np.array([2.0, -0.1]), np.array([2.0, 1.5])
LIMITS = np.zeros(1, dtype=arm_dtype(2))[0]
LIMITS["q_min"], LIMITS["q_max"], LIMITS["qd_max"] = Q_MIN, Q_MAX, QD_MAX
M = np.diag([0.8, 0.2])
MARGIN, STIFFNESS, DECELERATION, BRAKE = 0.1, 200.0, 8.0, 50.0


NONE, DELAY_S, PLENTY = np.zeros(2), 0.002, 1e6
commands = st.floats(-100, 100)


def stops_of(**fields):
    """Return a record of joint stops with some fields filled."""
    stops = np.zeros(1, dtype=stops_dtype(2))[0]
    for name, values in fields.items():
        stops[name] = values
    return stops


def gains(excess, intrusion, inertia=M, damping=NONE, rate=PLENTY, stiffness=STIFFNESS):
    """Return brake, spring and drag of the joint stops."""
    stops = stops_of(excess=excess, intrusion=intrusion)
    joint_stop_gains(stops, np.array(inertia), np.array(damping), rate, BRAKE, stiffness, DELAY_S)
    return stops["brake"], stops["spring"], stops["drag"]


def stop(tau, q, qd, in_force=(0.0, 0.0), inertia=M):
    """Return what a command becomes at the joint stops, with another one in force."""
    out, q, qd, inertia = (np.array(given, dtype=float) for given in (tau, q, qd, inertia))
    stops, M_inv = stops_of(), np.linalg.inv(inertia)
    predict_velocity(stops, qd, M_inv, np.array(in_force), 1.0, 0.001)
    some = joint_excess(stops, q, qd, LIMITS, MARGIN, DECELERATION)
    assert some == (stops["excess"].any() or stops["intrusion"].any())
    joint_stop_gains(stops, inertia, NONE, PLENTY, BRAKE, STIFFNESS, DELAY_S)
    joint_stop_torque(stops, out, M_inv, qd, MARGIN)
    return out


@given(
    st.lists(st.floats(0.0, 0.9), min_size=2, max_size=2),
    st.lists(st.sampled_from([0.0, -0.05, 0.3]), min_size=2, max_size=2),
    st.floats(1e-6, 10.0),
    st.floats(0.0, 0.95),
    st.floats(1.0, 1e6),
)
def test_joint_stops_stay_within_what_a_light_joint_takes(fraction, excess, light, coupled, stiffness):
    """With what damps already they never pass the rate; the spring's delay is made up for twice over."""
    off = coupled * np.sqrt(0.8 * light)
    inertia = np.array([[0.8, off], [off, light]])
    limits, excess = np.empty(2), np.array(excess)
    joint_damping_limits(np.linalg.inv(inertia), 300.0, limits)
    damping = np.array(fraction) * limits
    brake, spring, drag = gains(excess, NONE, inertia, damping, 400.0, stiffness)
    root = np.linalg.cholesky(np.linalg.inv(inertia))
    assert np.linalg.eigvalsh(root.T @ np.diag(damping + brake) @ root)[-1] <= 400.0 * (1.0 + 1e-6)
    assert (brake <= BRAKE * np.diag(inertia) + 1e-12).all()
    assert (brake[excess == 0.0] == 0.0).all()
    assert (2.0 * DELAY_S * spring <= damping + brake + 1e-9).all()
    assert (spring <= stiffness).all()
    assert (2.0 * DELAY_S * spring <= damping + drag + 1e-9).all()


def test_joint_stops_of_a_heavy_joint_are_as_configured():
    brake, spring, drag = gains(np.ones(2), NONE)
    assert_allclose(brake, BRAKE * np.diag(M))
    assert_allclose(spring, STIFFNESS)
    assert_allclose(drag, 2.0 * DELAY_S * STIFFNESS)


@given(commands, commands)
def test_a_joint_that_others_push_out_of_its_range_is_stopped(tau, other):
    """What counts is the acceleration of the whole command: at the limit nothing accelerates the joint outwards."""
    inertia = np.array([[0.8, 0.3], [0.3, 0.2]])
    left = stop([tau, other], [1.9 + MARGIN, -2.0], [0.0, 0.0], inertia=inertia)
    assert (np.linalg.solve(inertia, left))[0] <= 1e-9


def allowed_speed(left):
    """Return the speed from which a joint can be stopped with what is left to the margin, rad/s."""
    return min(QD_MAX[0], np.sqrt(2.0 * DECELERATION * max(left, 0.0)))


speeds = st.floats(-5, 5)


@given(commands, st.floats(-1.9, 1.9), st.floats(-1.0, 1.0))
def test_away_from_limits_of_place_and_speed_nothing_changes(tau, q, fraction):
    """A joint that can still be stopped before its margin, and is no faster than allowed."""
    left = 1.9 - q if fraction > 0 else q + 1.9
    assert_array_equal(stop([tau, tau], [q, -2.0], [fraction * allowed_speed(left), 0.0]), [tau, tau])


@given(commands, st.floats(-1.9, 1.9), speeds)
def test_joint_that_is_too_fast_is_braked_and_pushed_on_no_more(tau, q, qd):
    """In proportion to its inertia and its excess of speed; what already brakes it is left."""
    sign = np.sign(qd) or 1.0
    excess = abs(qd) - allowed_speed(1.9 - q if qd > 0 else q + 1.9)
    left = stop([tau, 0.0], [q, -2.0], [qd, 0.0])[0]
    if excess > 0.0:
        pushed_on = max(sign * tau, 0.0) * (1.0 - min(excess / 0.4, 1.0))
        expected = min(sign * tau, 0.0) + pushed_on - BRAKE * M[0, 0] * excess
        assert_allclose(sign * left, expected, rtol=1e-9, atol=1e-5)  # √ of a rounding error
    else:
        assert left == tau


@given(st.floats(1.0, 80.0))
def test_joint_is_braked_before_it_is_too_fast_by_what_still_drives_it(driven):
    """A torque falls by 1 N m a tick at the most: 50 N m on 0.8 kg m² bring 1.6 rad/s more until they are gone."""
    coming = 0.5 * driven / M[0, 0] * driven / 1000.0
    excess = coming - QD_MAX[0]
    left = stop([0.0, 0.0], [0.0, -2.0], [0.0, 0.0], (driven, 0.0))[0]
    assert_allclose(left, -BRAKE * M[0, 0] * max(excess, 0.0), rtol=1e-9, atol=1e-9)


@given(commands, st.floats(0.0, 0.5), speeds)
def test_both_ends_are_alike(tau, depth, qd):
    low = stop([tau, 0.0], [-1.9 - depth, -2.0], [qd, 0.0])[0]
    high = stop([-tau, 0.0], [1.9 + depth, -2.0], [-qd, 0.0])[0]
    assert_allclose(high, -low, rtol=1e-12, atol=1e-9)


@given(commands, st.floats(0.0, 0.5), st.floats(-5.0, 0.0))
def test_joint_stop_never_pulls_towards_the_limit(tau, depth, qd):
    """What is added to a joint within the margin that is not fast on its sign back points inwards."""
    assert stop([tau, 0.0], [-1.9 - depth, -2.0], [qd, 0.0])[0] >= tau - 1e-9


@given(commands, st.floats(0.1, 0.5), st.floats(-5.0, 0.0))
def test_at_the_limit_and_beyond_no_command_pushes_outwards(tau, depth, qd):
    """There the spring alone is left of a command that leads out: 200 N m/rad × 0.1 rad and more."""
    assert stop([tau, 0.0], [-1.9 - depth, -2.0], [qd, 0.0])[0] >= STIFFNESS * MARGIN * 0.999


@given(st.floats(0.0, 100.0), st.floats(1e-6, 0.1))
def test_what_pushes_outwards_fades_over_the_margin(push, depth):
    left = stop([-push, 0.0], [-1.9 - depth, -2.0], [0.0, 0.0])[0]
    assert_allclose(left, -push * (1 - depth / MARGIN) + STIFFNESS * depth, rtol=0, atol=1e-7)


@given(st.floats(0.0, 100.0), st.floats(1e-6, 0.5))
def test_what_pushes_inwards_is_left_and_helped(push, depth):
    left = stop([push, 0.0], [-1.9 - depth, -2.0], [0.5, 0.0])[0]
    assert_allclose(left, push + STIFFNESS * depth - 2.0 * DELAY_S * STIFFNESS * 0.5, rtol=1e-9, atol=1e-9)


@given(st.floats(-100.0, 100.0), st.floats(0.0, 1e-9))
def test_nothing_jumps_where_the_margin_begins(tau, beyond):
    """At rest; in motion the brake has come in long before."""
    assert_allclose(stop([tau, 0.0], [-1.9 - beyond, -2.0], [0.0, 0.0])[0], tau, rtol=0, atol=1e-5)
