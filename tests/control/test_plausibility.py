"""What can be true of a measurement: motions that their velocities allow are, numbers that no arm has are not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.control.clock import clock_dtype
from contactsafe.control.params import arm_dtype
from contactsafe.control.plausibility import furthest_astray, is_unchanged, is_usable, moves, velocity_jumps
from contactsafe.control.records import measurement_dtype

N = 3
SPEEDS = st.lists(st.floats(-3.0, 3.0), min_size=N, max_size=N).map(np.array)


def record(dtype, **values):
    made = np.zeros(1, dtype)
    for name, value in values.items():
        made[name] = value
    return made[0]


ARM = record(arm_dtype(N), q_least=-3.0, q_most=3.0, qd_most=10.0)


@given(SPEEDS, SPEEDS, st.floats(0.0, 1.0), st.floats(0.5, 20.0))
def test_a_motion_between_both_velocities_is_believed(before, now, part, ticks):
    time = 0.001 * ticks
    clock = record(clock_dtype(N), qd_good=before)
    m = record(measurement_dtype(N), q=time * (part * before + (1.0 - part) * now), qd=now)
    assert furthest_astray(clock, m, time) < 1e-12


@given(SPEEDS, st.integers(0, N - 1), st.floats(0.01, 1.0))
def test_a_joint_that_is_elsewhere_is_astray_by_as_much(speed, joint, away):
    clock = record(clock_dtype(N), qd_good=speed)
    m = record(measurement_dtype(N), q=0.001 * speed + away * np.eye(N)[joint], qd=speed)
    assert furthest_astray(clock, m, 0.001) == pytest.approx(away, abs=1e-12)


@pytest.mark.parametrize(
    ("changed", "usable"),
    [
        ({}, True),
        ({"q": 3.1}, False),
        ({"q": np.nan}, False),
        ({"qd": np.inf}, False),
        ({"qd": -10.1}, False),
        ({"has_time": 1, "time": np.nan}, False),
        ({"has_wrench": 1, "wrench_ee": np.nan}, False),
        ({"has_wrench": 0, "wrench_ee": np.nan}, True),
    ],
)
def test_numbers_that_this_arm_cannot_have(changed, usable):
    assert is_usable(record(measurement_dtype(N), **changed), ARM, 0) == usable


def test_a_broken_force_sensor_does_not_blind_the_brake():
    assert is_usable(record(measurement_dtype(N), has_wrench=1, wrench_ee=np.nan), ARM, 1)


def test_the_last_bit_of_one_joint_is_a_change():
    clock, m = record(clock_dtype(N), q_good=1.0), record(measurement_dtype(N), q=1.0)
    assert is_unchanged(clock, m)
    assert not moves(m)
    m["q"][1] = np.nextafter(1.0, 2.0)
    assert not is_unchanged(clock, m)


@pytest.mark.parametrize(("shown", "jumps"), [(0.0, True), (1.0, False)])
def test_a_jump_of_velocity_must_show_in_the_positions(shown, jumps):
    """5 rad/s within a tick take a joint of 0.1 kg m² 500 N m."""
    clock = record(clock_dtype(N))
    m = record(measurement_dtype(N), q=0.001 * 5.0 * shown * np.eye(N)[0], qd=5.0 * np.eye(N)[0])
    assert velocity_jumps(clock, m, 0.1 * np.eye(N), 0.001, 0.001) == jumps
