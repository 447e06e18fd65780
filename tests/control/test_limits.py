"""Limits hold whatever is asked."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.control.limits import limit_torque

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
def test_torque_and_its_rate_stay_within_limits(tau, fraction, seed):
    previous = fraction * TAU_MAX
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


def test_a_blocked_arm_was_taken_for_one_on_the_move(panda):
    """Its torque was limited for a speed that it would never have, and chattered."""
    still, torques = Measurement(panda.home, np.zeros(panda.n), UNTOUCHED), []
    for config in (presets.vices(), presets.vices().with_(joint_speed_fraction=0.05)):
        controller = controller_at(panda, config)
        for _ in range(300):
            out = controller.step(still, reach(panda, [0.0, 0.0, -0.1]))
            torques.append(out.torque)
        assert_array_equal(torques[-1], torques[-100])
    assert_array_equal(torques[299], torques[599])
    assert np.abs(torques[-1] - panda.dynamics(panda.home, np.zeros(panda.n))["g"]).max() > 20.0


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
