"""Who does the work: what gives back no more than a spring could is no pusher."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsafe.control.laws import is_pushed

MARGIN_J = 0.005


def ever_pushed(x, torque_of, margin=MARGIN_J):
    """Move the arm slowly along x, rad, into something whose torque on the arm is given; was it ever a pusher?"""
    work = least = peak = 0.0
    last = torque_of(x[0])
    for before, after in pairwise(x):
        torque = torque_of(after, after - before)
        work += 0.5 * (torque + last) * (after - before)
        last = torque
        least, peak = min(least, work), max(peak, abs(torque))
        if is_pushed(work, least, abs(torque), peak, margin):
            return True
    return False


def path(turns):
    """Go from 0 to each turning point in 400 steps."""
    return np.concatenate([np.linspace(a, b, 400) for a, b in zip([0.0, *turns], turns, strict=False)])


@settings(max_examples=60)
@given(
    stiffness=st.floats(1.0, 1e4),
    turns=st.lists(st.floats(0.0, 0.3), min_size=1, max_size=5),
    lost=st.floats(0.0, 0.9),
)
def test_no_linear_spring_is_a_pusher(stiffness, turns, lost):
    """Loaded and unloaded in any order, giving back only a share 1 − lost of its torque."""

    def torque(x, dx=0.0):
        return -stiffness * x * (1.0 - lost if dx < 0 else 1.0)

    assert not ever_pushed(path([*turns, 0.0]), torque)


@given(force=st.floats(2.0, 50.0), travel=st.floats(0.001, 0.5))
def test_constant_push_is_a_pusher_once_it_has_done_the_margins_work(force, travel):
    pushed = ever_pushed(path([travel]), lambda x, dx=0.0: force)
    assert pushed == (force * travel > MARGIN_J)


@given(force=st.floats(2.0, 50.0), into=st.floats(0.0, 0.1))
def test_constant_push_against_which_the_arm_moved_first_is_a_pusher(force, into):
    """With its torque still at the peak a spring gives nothing back: 0.15 of the work put in and the margin tell."""
    back = 0.16 * into + 1.01 * MARGIN_J / force
    assert ever_pushed(path([-into, back - into]), lambda x, dx=0.0: force)


@given(work=st.floats(0.1, 10.0), ratio=st.floats(0.0, 1.0))
def test_threshold_is_what_a_spring_gives_back(work, ratio):
    """W (1 − (torque/peak)²), an allowance of 0.15 W and the margin."""
    given_back = work * (1.15 - ratio**2) + MARGIN_J
    assert not is_pushed(-work + given_back - 1e-9, -work, 10.0 * ratio, 10.0, MARGIN_J)
    assert is_pushed(-work + given_back + 1e-9, -work, 10.0 * ratio, 10.0, MARGIN_J)


def test_no_torque_is_no_push():
    assert not is_pushed(1.0, 0.0, 0.0, 0.0, MARGIN_J)
