"""Smoothing delays nothing, takes the quieter velocity, and marks what was not recorded."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.logs.log import Log
from contactsafe.logs.smoothing import signals_of

RNG = np.random.default_rng(0)


def waving(rate_hz, q_noise=0.0, qd_noise=0.0, with_qd=True, seconds=4.0):
    """Return a log of two joints that swing at 0.5 and 1 Hz."""
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    w = 2.0 * np.pi * np.array([0.5, 1.0])
    phase = np.outer(time, w)
    q = np.sin(phase) + q_noise * RNG.normal(size=phase.shape)
    qd = w * np.cos(phase) + qd_noise * RNG.normal(size=phase.shape)
    return Log("waves", time, q, qd if with_qd else None, np.ones_like(q))


def velocity(signals):
    w = 2.0 * np.pi * np.array([0.5, 1.0])
    return w * np.cos(np.outer(signals.time, w))


@pytest.mark.parametrize("rate_hz", [90.0, 250.0, 1000.0, 2000.0])
@pytest.mark.parametrize("with_qd", [True, False])
def test_velocity_is_that_of_the_motion_without_delay(rate_hz, with_qd):
    signals = signals_of(waving(rate_hz, with_qd=with_qd))
    assert_allclose(signals.qd, velocity(signals), atol=0.02)
    assert signals.q.shape == signals.qd.shape == signals.torque.shape
    assert signals.whole.all()
    assert signals.command is None


def test_the_quieter_velocity_is_taken():
    quiet_positions = signals_of(waving(1000.0, q_noise=1e-7, qd_noise=0.05))
    assert_allclose(quiet_positions.qd, velocity(quiet_positions), atol=0.005)
    quiet_velocity = signals_of(waving(1000.0, q_noise=1e-3, qd_noise=1e-4))
    assert_allclose(quiet_velocity.qd, velocity(quiet_velocity), atol=0.005)


def test_noise_is_what_it_is():
    log = waving(1000.0, q_noise=1e-3, qd_noise=0.01)
    noisy = Log("noise", log.time, log.q, log.qd, log.torque + 0.3 * RNG.normal(size=log.q.shape))
    signals = signals_of(noisy)
    assert_allclose(signals.velocity_noise, 0.01, rtol=0.1)
    assert_allclose(signals.torque_noise, 0.3, rtol=0.1)


def test_what_is_missing_is_marked_with_its_neighbours():
    log = waving(1000.0)
    kept = (log.time < 1.0) | (log.time >= 1.2)
    signals = signals_of(Log("gap", *(values[kept] for values in (log.time, log.q, log.qd, log.torque))))
    missing = signals.time[~signals.whole]
    assert missing.min() == pytest.approx(1.0 - 0.021, abs=0.003)
    assert missing.max() == pytest.approx(1.2 + 0.02, abs=0.003)
    assert_allclose(signals.qd[signals.whole], velocity(signals)[signals.whole], atol=0.02)


def test_two_runs_days_apart_take_no_more_rows_than_they_have():
    log = waving(1000.0)
    late = log.time + (log.time >= 2.0) * 1e6
    signals = signals_of(Log("two runs", late, log.q, log.qd, log.torque))
    assert len(signals.time) < len(log.time) + 20
    assert signals.step_s == pytest.approx(0.001)
    assert signals.time[-1] == pytest.approx(late[-1] - 0.02, abs=0.002)
    assert (~signals.whole).sum() < 60
    now = signals._replace(time=signals.time % 1e6)
    assert_allclose(now.qd[now.whole], velocity(now)[now.whole], atol=0.02)
    assert (signals.velocity_noise < 1e-3).all()


def test_single_rows_that_are_missing_are_bridged():
    log = waving(1000.0)
    kept = RNG.random(len(log.time)) > 0.1
    signals = signals_of(Log("thin", *(values[kept] for values in (log.time, log.q, log.qd, log.torque))))
    assert signals.whole.all()
    assert_allclose(signals.qd, velocity(signals), atol=0.02)
