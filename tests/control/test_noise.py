"""Noise of the residual is measured while nothing touches, and filtered to what is allowed."""

import numpy as np
import pytest

from contactsafe.control.laws import filter_gain
from contactsafe.control.noise import follow_noise, noise_dtype, noise_left, start_noise
from contactsafe.control.params import step_dtype
from contactsafe.core.compiled import compiled

ALLOWED_NM = 0.15


@compiled
def _start(noises, allowed):
    start_noise(noises[0], allowed)


@compiled
def _follow(noises, torque, uncertainty, of_positions, steps, untouched, tool_free, allowed):
    follow_noise(noises[0], torque, uncertainty, of_positions, steps[0], untouched, tool_free, allowed)


@compiled
def _left(noises, i, allowed):
    return noise_left(noises[0], i, allowed)


def followed(torques, touched=None, allowed=ALLOWED_NM, noises=None, uncertain=0.0, of_positions=0, tool_free=True):
    """Run over raw external torques, (T, n), N m; give the noise record, and its bandwidths."""
    steps = np.zeros(1, step_dtype)
    steps["dt"] = 0.001
    steps["full_filter_gain"], steps["full_lowpass_gain"] = filter_gain(250.0, 0.001), filter_gain(250.0, 0.001)
    if noises is None:
        noises = np.zeros(1, noise_dtype(torques.shape[1]))
        _start(noises, allowed)
    bandwidths = []
    for k, torque in enumerate(torques):
        uncertainty = np.full(len(torque), uncertain)
        _follow(noises, torque, uncertainty, of_positions, steps, touched is None or not touched[k], tool_free, allowed)
        bandwidths.append(float(noises["bandwidth"][0]))
    return noises, np.array(bandwidths)


def white(ticks, sigma, n=2):
    return sigma * np.random.default_rng(0).standard_normal((ticks, n))


def test_a_quiet_arm_soon_has_all_its_bandwidth():
    _, bandwidths = followed(np.zeros((400, 2)))
    assert bandwidths[0] < 0.7  # begun from a safe value
    assert (bandwidths[200:] == 1.0).all()


def test_a_noisy_arm_is_filtered_in_proportion():
    quiet, loud = (followed(white(8000, sigma))[0][0] for sigma in (3.0, 6.0))
    assert loud["bandwidth"] < quiet["bandwidth"] < 1.0
    assert loud["sigma"].max() == pytest.approx(2.0 * quiet["sigma"].max(), rel=0.2)


def test_a_push_is_not_learned_while_it_is_known_and_hardly_before():
    noises, before = followed(white(3000, 2.0))
    push = 15.0 * np.minimum(np.arange(1000) / 300.0, 1.0)[:, None] + white(1000, 2.0)
    sigma = noises["sigma"].copy()
    followed(push, touched=np.ones(1000, bool), noises=noises)
    assert (noises["sigma"] == sigma).all()
    _, bandwidths = followed(push[:50], noises=noises)  # of 2.5 N m, before it is found
    assert bandwidths[-1] > 0.9 * before[-1]


def test_a_press_of_the_tool_that_no_sensor_takes_out_is_no_noise():
    """Without a wrench the tool landing was learned, and the bandwidth fell to a tenth when it was needed."""
    noises, before = followed(white(3000, 0.5))
    _, pressed = followed(white(400, 9.0), noises=noises, tool_free=False)
    assert pressed[-1] >= before[-1]


def test_noise_is_not_forgotten_while_motion_hides_it():
    noises, before = followed(white(6000, 3.0))
    sigma = noises["sigma"].copy()
    followed(white(8000, 3.0), noises=noises, uncertain=5.0)
    assert (noises["sigma"] > 0.8 * sigma).all()
    assert before[-1] < 1.0


def test_what_a_model_may_be_wrong_by_is_no_noise():
    still, moving = (followed(white(6000, 3.0), uncertain=uncertain)[0]["sigma"].max() for uncertain in (0.0, 0.2))
    assert moving < still


def test_velocities_from_positions_have_less_bandwidth_however_quiet():
    """One position that is read late, or was filled in, shows: a log whose lost rows were interpolated did."""
    _, bandwidths = followed(np.zeros((800, 2)), of_positions=1)
    assert bandwidths.max() == pytest.approx(0.6)


def test_what_changes_slowly_is_no_noise():
    t = np.arange(6000)[:, None] * 0.001
    noises, bandwidths = followed(3.0 * np.sin(2.0 * np.pi * 0.5 * t) + np.zeros((1, 2)))
    assert noises["sigma"].max() < 0.5
    assert bandwidths[-1] > 0.25


def test_what_no_filter_keeps_down_is_left_to_the_threshold():
    noises, bandwidths = followed(white(9000, 60.0))
    assert bandwidths[-1] == pytest.approx(0.1)
    assert _left(noises, 0, ALLOWED_NM) > 0.0
    assert _left(noises, 0, np.inf) == 0.0


def test_any_noise_may_be_allowed():
    noises, bandwidths = followed(white(500, 5.0), allowed=np.inf)
    assert (bandwidths == 1.0).all()
    assert not noises["sigma"].any()
