"""A braked arm comes to rest without swinging back, whatever its inertia; a tool without targets stops by itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsafe.control.clock import clock_dtype
from contactsafe.control.config import ClockConfig
from contactsafe.control.parameter import fill_record, record_fields
from contactsafe.control.records import arm_state_dtype, target_dtype
from contactsafe.control.stopping import stop_late_target, stop_torque
from contactsafe.robot.dynamics import dynamics_dtype

N = 3


@settings(max_examples=25)
@given(st.lists(st.floats(-2.0, 2.0), min_size=N, max_size=N), st.integers(0, 2**32 - 1))
def test_braking_ends_at_rest_without_swinging_back(qd, seed):
    """It holds where the last joint fell below 0.05 rad/s, and comes back there at a fifth of that at most."""
    root = np.random.default_rng(seed).normal(size=(N, N))
    M = root @ root.T + 0.01 * np.eye(N)
    M_inv = np.linalg.inv(M)
    clock, arm = np.zeros(1, clock_dtype(N)), np.zeros(1, arm_state_dtype(N))
    arm["qd"] = qd
    for _ in range(2000):
        arm["qd"] += 0.001 * M_inv @ stop_torque(clock[0], arm[0], M)
        arm["q"] += 0.001 * arm["qd"]
        assert (arm["qd"][0] * np.sign(qd) >= -0.01).all()
    assert clock["at_rest"][0] == 1
    assert np.abs(arm["qd"]).max() < 1e-3


def late(age, kept=1, position=1.0, speed=0.2):
    """Return clock and target after a tick; the tool at 0 moves along x at a speed, its target at a position."""
    clock, target = np.zeros(1, clock_dtype(N)), np.zeros(1, target_dtype(N))
    arm, dynamics = np.zeros(1, arm_state_dtype(N)), np.zeros(1, dynamics_dtype(N))
    params = np.zeros(1, record_fields(ClockConfig, N))
    fill_record(params[0], ClockConfig())
    target["position"], target["quat"] = (position, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    target["K_task"], target["D_task"] = 100.0, 20.0
    dynamics["velocity"][0, 0], dynamics["rotation"], arm["q"] = speed, np.eye(3), 0.7
    clock["target_age"], clock["elapsed"] = age, 1.0
    stop_late_target(clock[0], target[0], kept, arm[0], dynamics[0], params[0])
    return clock[0], target[0]


def test_a_late_target_is_put_where_the_tool_comes_to_rest():
    clock, target = late(age=100.5)
    assert clock["target_late"] == 1
    assert target["position"][0] == pytest.approx(0.2 * 20.0 / 100.0)
    assert (target["q_posture"] == 0.7).all()


def test_it_is_never_put_further_away():
    assert late(age=100.5, position=0.01)[1]["position"][0] == 0.01


@pytest.mark.parametrize(("age", "kept"), [(50.0, 1), (100.5, 0)])
def test_a_target_in_time_stays(age, kept):
    clock, target = late(age, kept)
    assert clock["target_late"] == 0
    assert target["position"][0] == 1.0
    assert clock["target_age"] == (age + 1.0 if kept else 0.0)
