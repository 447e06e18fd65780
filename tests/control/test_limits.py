"""Limits hold whatever is asked."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.control.damping import joint_damping_limits
from contactsafe.control.limits import (
    joint_excess,
    joint_stop_gains,
    joint_stop_torque,
    limit_torque,
    predict_velocity,
)

TAU_MAX = np.array([87.0, 87.0, 12.0])
torques = arrays(float, 3, elements=st.floats(-1e6, 1e6))


def limited(tau, previous, M_inv):
    """Keep a command within the limits, 1 N m a tick among them, in place; tell whether that took anything."""
    return limit_torque(tau, previous, TAU_MAX, 1.0, M_inv)


def light_chain(seed):
    """Draw the inverse inertia of three joints, coupled, the lightest down to 1e-6 kg m²."""
    rng = np.random.default_rng(seed)
    root = np.diag(10.0 ** rng.uniform(-3.0, 0.5, 3)) @ rng.normal(size=(3, 3))
    return np.linalg.inv(root @ root.T + 1e-6 * np.eye(3))


@given(torques, arrays(float, 3, elements=st.floats(-1.0, 1.0)), st.integers(0, 2**32 - 1))
def test_torque_and_its_rate_stay_within_limits(tau, share, seed):
    previous = share * TAU_MAX
    asked = tau.copy()
    clipped = limited(tau, previous, light_chain(seed))
    assert (np.abs(tau) <= TAU_MAX).all()
    assert (np.abs(tau - previous) <= 1.0 + 1e-12).all()
    assert clipped == (tau != asked).any()


def test_what_is_within_limits_passes_unchanged():
    tau = np.array([10.5, -86.0, 11.9])
    assert not limited(tau, np.array([10.0, -86.5, 12.0]), light_chain(0))
    assert_array_equal(tau, [10.5, -86.0, 11.9])


def test_limit_is_reached_exactly():
    tau = np.array([20.0, -90.0, 50.0])
    assert limited(tau, np.array([10.0, -86.5, 11.5]), np.eye(3))
    assert_array_equal(tau, [11.0, -87.0, 12.0])


@given(arrays(float, 3, elements=st.floats(-100.0, 100.0)), st.integers(0, 2**32 - 1))
def test_limits_never_take_more_of_the_motion_than_clipping_does(tau, seed):
    """By Gauss's measure of what a constraint costs."""
    M_inv, asked = light_chain(seed), tau.copy()
    clip = np.clip(asked, -1.0, 1.0) - asked
    limited(tau, np.zeros(3), M_inv)
    assert (tau - asked) @ M_inv @ (tau - asked) <= clip @ M_inv @ clip * (1.0 + 1e-9) + 1e-9


def test_a_torque_limit_on_a_heavy_joint_flung_a_light_one():
    """A shoulder that gets 30 N m less than asked leaves the wrist's acceleration as asked, not 10000 rad/s² more."""
    M_inv = np.linalg.inv([[2.0, 0.0, 0.0], [0.0, 0.5, 1e-3], [0.0, 1e-3, 5e-6]])
    asked = np.array([0.0, 31.0, 0.0])
    clip, tau = np.clip(asked, -1.0, 1.0), asked.copy()
    limited(tau, np.zeros(3), M_inv)
    assert abs(M_inv[2] @ (clip - asked)) > 10_000.0
    assert abs(M_inv[2] @ (tau - asked)) < 51.0


Q_MIN, Q_MAX, QD_MAX = np.array([-2.0, -3.0]), np.array([2.0, -0.1]), np.array([2.0, 1.5])
M = np.diag([0.8, 0.2])
MARGIN, STIFFNESS, DECELERATION, BRAKE = 0.1, 200.0, 8.0, 50.0


NONE, DELAY_S, PLENTY = np.zeros(2), 0.002, 1e6
commands = st.floats(-100, 100)


def gains(excess, intrusion, inertia=M, damping=NONE, rate=PLENTY, stiffness=STIFFNESS):
    """Give brake, spring and drag of the joint stops."""
    brake, spring, drag = np.empty(2), np.empty(2), np.empty(2)
    joint_stop_gains(
        np.array(inertia), np.array(damping), rate, excess, intrusion, BRAKE, stiffness, DELAY_S, brake, spring, drag
    )
    return brake, spring, drag


def stop(tau, q, qd, in_force=(0.0, 0.0), inertia=M):
    """Give what a command becomes at the joint stops, with another one in force."""
    out, qd, M_inv = np.array(tau, dtype=float), np.array(qd, dtype=float), np.linalg.inv(inertia)
    speed, ahead, excess, intrusion = np.empty((4, 2))
    predict_velocity(qd, M_inv, np.array(in_force), 1.0, 0.001, speed, ahead)
    some = joint_excess(np.array(q), qd, speed, ahead, Q_MIN, Q_MAX, QD_MAX, MARGIN, DECELERATION, excess, intrusion)
    assert some == (excess.any() or intrusion.any())
    joint_stop_torque(out, M_inv, qd, excess, intrusion, MARGIN, *gains(excess, intrusion, inertia))
    return out


@given(
    st.lists(st.floats(0.0, 0.9), min_size=2, max_size=2),
    st.lists(st.sampled_from([0.0, -0.05, 0.3]), min_size=2, max_size=2),
    st.floats(1e-6, 10.0),
    st.floats(0.0, 0.95),
    st.floats(1.0, 1e6),
)
def test_joint_stops_stay_within_what_a_light_joint_takes(share, excess, light, coupled, stiffness):
    """With what damps already they never pass the rate; the spring's delay is made up for twice over."""
    off = coupled * np.sqrt(0.8 * light)
    inertia = np.array([[0.8, off], [off, light]])
    limits, excess = np.empty(2), np.array(excess)
    joint_damping_limits(np.linalg.inv(inertia), 300.0, limits)
    damping = np.array(share) * limits
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
    """Give the speed from which a joint can be stopped with what is left to the margin, rad/s."""
    return min(QD_MAX[0], np.sqrt(2.0 * DECELERATION * max(left, 0.0)))


speeds = st.floats(-5, 5)


@given(commands, st.floats(-1.9, 1.9), st.floats(-1.0, 1.0))
def test_away_from_limits_of_place_and_speed_nothing_changes(tau, q, share):
    """A joint that can still be stopped before its margin, and is no faster than allowed."""
    left = 1.9 - q if share > 0 else q + 1.9
    assert_array_equal(stop([tau, tau], [q, -2.0], [share * allowed_speed(left), 0.0]), [tau, tau])


@given(commands, st.floats(-1.9, 1.9), speeds)
def test_joint_that_is_too_fast_is_braked_and_pushed_on_no_more(tau, q, qd):
    """In proportion to its inertia and its excess of speed; what already brakes it is left."""
    way = np.sign(qd) or 1.0
    excess = abs(qd) - allowed_speed(1.9 - q if qd > 0 else q + 1.9)
    left = stop([tau, 0.0], [q, -2.0], [qd, 0.0])[0]
    if excess > 0.0:
        pushed_on = max(way * tau, 0.0) * (1.0 - min(excess / 0.4, 1.0))
        expected = min(way * tau, 0.0) + pushed_on - BRAKE * M[0, 0] * excess
        assert_allclose(way * left, expected, rtol=1e-9, atol=1e-9)
    else:
        assert left == tau


@given(st.floats(1.0, 80.0))
def test_joint_is_braked_before_it_is_too_fast_by_what_still_drives_it(driven):
    """A torque falls by 1 N m a tick at the most: 50 N m on 0.8 kg m² bring 1.6 rad/s more until they are gone."""
    coming = 0.5 * driven / M[0, 0] * driven / 1000.0
    excess = coming - QD_MAX[0]
    left = stop([0.0, 0.0], [0.0, -2.0], [0.0, 0.0], (driven, 0.0))[0]
    assert_allclose(left, -BRAKE * M[0, 0] * max(excess, 0.0), rtol=1e-9, atol=1e-9)


def test_a_blocked_arm_was_taken_for_one_on_the_move(panda):
    """Its torque was limited for a speed that it would never have, and chattered."""
    still, torques = Measurement(panda.home, np.zeros(panda.n), UNTOUCHED), []
    for config in (presets.vices(), replace(presets.vices(), joint_speed_fraction=0.05)):
        controller = controller_at(panda, config)
        for _ in range(300):
            out = controller.step(still, reach(panda, [0.0, 0.0, -0.1]))
            torques.append(out.torque)
        assert_array_equal(torques[-1], torques[-100])
    assert_array_equal(torques[299], torques[599])
    assert np.abs(torques[-1] - panda.dynamics(panda.home, np.zeros(panda.n))["g"]).max() > 20.0


@given(commands, st.floats(0.0, 0.5), speeds)
def test_both_ends_are_alike(tau, depth, qd):
    low = stop([tau, 0.0], [-1.9 - depth, -2.0], [qd, 0.0])[0]
    high = stop([-tau, 0.0], [1.9 + depth, -2.0], [-qd, 0.0])[0]
    assert_allclose(high, -low, rtol=1e-12, atol=1e-9)


@given(commands, st.floats(0.0, 0.5), st.floats(-5.0, 0.0))
def test_joint_stop_never_pulls_towards_the_limit(tau, depth, qd):
    """What is added to a joint within the margin that is not fast on its way back points inwards."""
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


def test_friction_above_a_tick_of_torque_rate_was_added_up(panda, quick_panda):
    """A motion well within the torque rate is commanded alike whether the rate is limited or not."""
    wanted = []
    for arm in (panda, quick_panda):
        arm = replace(arm, friction=arm.friction * [3.0, 1.0, 1.0])
        controller, q, torques = controller_at(arm, presets.vices()), panda.home.copy(), []
        for tick in range(600):
            qd = 0.4 * np.sin(0.01 * tick) * np.array([1.0, -0.5, 1.0, 1.0, -1.0, 0.5, 1.0])
            q = q + 0.001 * qd
            torques.append(controller.step(Measurement(q, qd, UNTOUCHED), hold(panda, q)).torque)
        wanted.append(torques)
    assert_allclose(wanted[0], wanted[1], rtol=0, atol=1e-9)
