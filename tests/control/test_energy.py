"""Gains change no faster than keeps the impedance passive, and the command gives no more energy than it may."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold
from tests.control.targets import fuzzed_target

from contactsafe import Measurement, Pose, Target, presets
from contactsafe.control.impedance import passive_step
from contactsafe.control.limits import power_limit

SAFE = presets.safe().with_(friction_compensation=False)
ALPHA, DT = 2.0, 0.001
stiffnesses = arrays(float, 6, elements=st.floats(10.0, 1500.0))
dampings = arrays(float, 6, elements=st.floats(ALPHA, 120.0))


@given(stiffnesses, dampings, stiffnesses, dampings)
def test_gains_obey_the_inequality_of_passivity_whatever_is_asked(K, D, K_wanted, D_wanted):
    """K̇ + α Ḋ ≤ 2 α K on every axis, and never past what is asked."""
    K0, D0 = K.copy(), D.copy()
    passive_step(K, D, K_wanted, D_wanted, DT, ALPHA, True)
    assert ((K - K0) / DT + ALPHA * (D - D0) / DT <= 2.0 * ALPHA * K0 * (1 + 1e-9) + 1e-6).all()
    for now, before, wanted in ((K, K0, K_wanted), (D, D0, D_wanted)):
        assert (now >= np.minimum(before, wanted) - 1e-9).all()
        assert (now <= np.maximum(before, wanted) + 1e-9).all()


def test_a_direction_that_was_let_go_comes_back():
    K, D = np.zeros(6), np.full(6, ALPHA)
    for _ in range(3000):
        passive_step(K, D, np.full(6, 700.0), np.full(6, 50.0), DT, ALPHA, True)
    assert_allclose(K, 700.0)


@settings(max_examples=25)
@given(stiffnesses, dampings, stiffnesses, dampings)
def test_gains_reach_what_is_asked(K, D, K_wanted, D_wanted):
    """From 10 to 1500 1/s² in less than 3 s, whatever else changes."""
    for _ in range(3000):
        passive_step(K, D, K_wanted, D_wanted, DT, ALPHA, True)
    assert_allclose(K, K_wanted, rtol=1e-9)
    assert_allclose(D, D_wanted, rtol=1e-9)


@given(stiffnesses, dampings, st.floats(0.1, 1.0), st.floats(0.1, 1.0))
def test_falling_gains_fall_at_once(K, D, share_K, share_D):
    K_wanted, D_wanted = share_K * K, share_D * D
    passive_step(K, D, K_wanted, D_wanted, DT, ALPHA, True)
    assert_allclose(K, K_wanted, rtol=1e-12)
    assert_allclose(D, D_wanted, rtol=1e-12)


@given(stiffnesses, dampings, stiffnesses, dampings)
def test_gains_follow_at_once_where_they_are_not_limited(K, D, K_wanted, D_wanted):
    passive_step(K, D, K_wanted, D_wanted, DT, ALPHA, False)
    assert_allclose(K, K_wanted, rtol=1e-12)
    assert_allclose(D, D_wanted, rtol=1e-12)


torques = arrays(float, 7, elements=st.floats(-200.0, 200.0))
speeds = arrays(float, 7, elements=st.floats(-3.0, 3.0))


@given(torques, speeds, arrays(float, 7, elements=st.floats(1e-3, 2.0)), st.floats(-5.0, 10.0), st.floats(0.0, 50.0))
def test_no_more_power_than_the_tank_can_pay(tau, qd, moments, tank, power):
    """What is taken off brakes all joints at one rate, by their inertia: along M q̇."""
    M = np.diag(moments) + 0.01
    asked, allowed = tau.copy(), power + max(tank, 0.0) / 0.1
    power_limit(tau, M, qd, tank, power, 0.1)
    if asked @ qd <= allowed or qd @ M @ qd <= 1e-12:  # or it stands still
        assert_array_equal(tau, asked)
    else:
        assert_allclose(tau @ qd, allowed, rtol=1e-6, atol=1e-6)
        off, momentum = asked - tau, M @ qd
        assert_allclose(off, momentum * (off @ qd) / (momentum @ qd), rtol=1e-6, atol=1e-6)


def energy_over_tank(arm, every, seed, ticks=4000):
    """Let a fuzzed policy drive; give by how much the energy given over any window exceeded tank + power × time, J."""
    rng, plant, controller = np.random.default_rng(seed), Plant(arm), controller_at(arm, SAFE)
    level, lowest, worst = 0.0, 0.0, 0.0
    for k in range(ticks):
        if k % every == 0:
            target = fuzzed_target(arm, rng)
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), target)
        net, before = out.torque - controller.record["dynamics"]["g"], plant.qd
        plant.step(out.torque)
        level += 0.001 * (net @ (before + plant.qd) / 2 - SAFE.limits.tank_power_w)
        lowest = min(lowest, level)
        worst = max(worst, level - lowest)
    return worst - SAFE.limits.tank_j


@pytest.mark.parametrize("every", [17, 50, 170])
@pytest.mark.parametrize("seed", range(3))
def test_command_gives_no_more_energy_than_the_tank_and_its_power(panda, every, seed):
    """Over any window; the torque rate may delay what the limit asks: 0.5 J more, measured over 32 runs of 8 s."""
    assert energy_over_tank(panda, every, seed) < 1.0


@pytest.mark.parametrize("seed", range(3))
def test_command_gives_no_more_energy_than_the_tank_where_motors_take_any_torque(quick_panda, seed):
    assert energy_over_tank(quick_panda, 17, seed) < 0.0


def swept(arm, K, ticks=4000):
    """Lead the tool by 5 cm; return the greatest energy of any window, J, and the fraction of the speed limit."""
    rng, plant, controller = np.random.default_rng(1), Plant(arm), controller_at(arm, SAFE)
    home, level, lowest, worst, speed = arm.tool_pose(arm.home), 0.0, 0.0, 0.0, 0.0
    for k in range(ticks):
        if k % 340 == 0:
            offset = np.clip(rng.normal(size=3) * 0.3, -0.05, 0.05)
        if k % 17 == 0:
            position = np.clip(plant.tool_position() + offset, home.position - 0.15, home.position + 0.15)
            target = Target(Pose(position, home.quat), np.full(6, K), posture=arm.home)
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), target)
        net, before = out.torque - controller.record["dynamics"]["g"], plant.qd
        plant.step(out.torque)
        level += 0.001 * (net @ (before + plant.qd) / 2 - SAFE.limits.tank_power_w)
        lowest, speed = min(lowest, level), max(speed, np.abs(plant.qd / arm.qd_max).max())
        worst = max(worst, level - lowest)
    return worst, speed


@pytest.mark.parametrize("K", [150.0, 1500.0])
def test_a_task_well_done_needs_little_of_the_tank(panda, K):
    """At the default's gains and at the stiffest allowed, where the torque rate once made the loop swing by itself."""
    worst, speed = swept(panda, K)
    assert worst < 1.0
    assert speed < 1.0


def test_tank_that_is_full_changes_nothing(panda):
    """At rest nothing is given, so the tank stays full."""
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 500, UNTOUCHED)
    assert controller.record["state"]["limits"]["tank_j"] == SAFE.limits.tank_j
