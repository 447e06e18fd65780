"""Of two velocities the quieter one is taken, joint by joint, and none where nothing tells them apart."""

import numpy as np
import pytest

from contactsafe.control.velocity import VELOCITY_SOURCES, follow_velocities, start_velocity, velocity_dtype
from contactsafe.core.compiled import compiled

DT = 0.001
QUIETER = VELOCITY_SOURCES.index("quieter")
ARM = np.dtype([("q", float, (3,)), ("qd", float, (3,))])


@compiled
def _start(velocities, arms):
    start_velocity(velocities[0], arms[0].q, arms[0].qd)


@compiled
def _follow(velocities, arms, since, dt, untouched, choice):
    follow_velocities(velocities[0], arms[0], since, dt, untouched, choice)


def followed(q, qd, choice=QUIETER, untouched=True, since=1.0, dt=DT):
    """Run over positions and velocities, (T, 3); give the velocities in force, (T, 3), and the record."""
    velocities, arms = np.zeros(1, velocity_dtype(3)), np.zeros(1, ARM)
    arms["q"], arms["qd"] = q[0], qd[0]
    _start(velocities, arms)
    _follow(velocities, arms, 1.0, dt, untouched, choice)  # the measurement it starts with
    taken = []
    for one_q, one_qd in zip(q[1:], qd[1:], strict=True):
        arms["q"], arms["qd"] = one_q, one_qd
        _follow(velocities, arms, since, dt, untouched, choice)
        taken.append(velocities["qd"][0].copy())
    return np.array(taken), velocities[0]


def motion(ticks=1500, q_noise=0.0, qd_noise=0.0):
    """Move smoothly, up to 1 rad/s; both signals with white noise, (T, 3) each."""
    rng, t = np.random.default_rng(0), np.arange(ticks)[:, None] * DT
    phase = np.array([0.0, 1.0, 2.0])
    q, qd = 0.5 * np.sin(2.0 * t + phase), np.cos(2.0 * t + phase)
    return q + q_noise * rng.standard_normal(q.shape), qd + qd_noise * rng.standard_normal(q.shape)


@pytest.mark.parametrize(
    ("q_noise", "qd_noise", "expected"),
    [(1e-7, 0.02, "positions"), (1e-5, 1e-3, "robot"), (0.0, 0.0, "robot"), (0.0, 0.02, "positions")],
)
def test_the_quieter_signal_is_taken(q_noise, qd_noise, expected):
    _, velocity = followed(*motion(q_noise=q_noise, qd_noise=qd_noise))
    assert [VELOCITY_SOURCES[source] for source in velocity["source"]] == [expected] * 3


def test_each_joint_has_its_own(panda):
    q, qd = motion(q_noise=1e-7)
    qd[:, 1] += 0.02 * np.random.default_rng(1).standard_normal(len(qd))
    _, velocity = followed(q, qd)
    assert list(velocity["source"]) == [0, 1, 0]


@pytest.mark.parametrize("choice", [0, 1])
def test_a_source_that_was_named_is_taken_whatever_its_noise(choice):
    q, qd = motion(q_noise=1e-5, qd_noise=0.02)
    taken, _ = followed(q, qd, choice)
    expected = qd[1:] if choice == 0 else np.diff(q, axis=0) / DT
    np.testing.assert_allclose(taken, expected, rtol=1e-9)


def test_nothing_is_learned_while_something_touches():
    _, velocity = followed(*motion(qd_noise=0.02), untouched=False)
    assert not velocity["variance"].any()


def test_a_gap_between_two_measurements_is_not_noise():
    q, qd = motion(q_noise=1e-7, qd_noise=0.02)
    velocities, arms = np.zeros(1, velocity_dtype(3)), np.zeros(1, ARM)
    arms["q"], arms["qd"] = q[0], qd[0]
    _start(velocities, arms)
    _follow(velocities, arms, 1.0, DT, True, QUIETER)
    for k in range(1, 1400):
        if 700 <= k < 720:  # lost
            continue
        arms["q"], arms["qd"] = q[k], qd[k]
        _follow(velocities, arms, 21.0 if k == 720 else 1.0, DT, True, QUIETER)
        if k == 699:
            before = velocities["source"][0].copy()
    assert list(before) == list(velocities["source"][0]) == [VELOCITY_SOURCES.index("positions")] * 3


def test_quick_motion_that_both_show_hides_no_noise():
    """Accelerations of the arm within the band are in both; the first comparison took them for noise of both."""
    t = np.arange(600)[:, None] * DT
    q, qd = 1e-3 * np.sin(50.0 * t), 0.05 * np.cos(50.0 * t)
    qd = qd + 0.02 * np.random.default_rng(0).standard_normal((len(t), 3))
    _, velocity = followed(np.repeat(q, 3, axis=1), qd)
    assert list(velocity["source"]) == [VELOCITY_SOURCES.index("positions")] * 3


def test_a_robots_velocity_that_lags_is_not_noisy():
    """Encoders of 19 bit, velocity from their difference behind 100 Hz: the robot's own is the quieter one."""
    rng, step = np.random.default_rng(0), 2.0 * np.pi / 2**19
    q = motion()[0] + step * (rng.random((1500, 3)) - 0.5)
    raw, qd, gain = np.diff(q, axis=0, prepend=q[:1]) / DT, motion()[1], 0.47
    for k in range(1, len(q)):
        qd[k] = qd[k - 1] + gain * (raw[k] - qd[k - 1])
    _, velocity = followed(q, qd)
    assert list(velocity["source"]) == [VELOCITY_SOURCES.index("robot")] * 3
