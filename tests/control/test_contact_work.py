"""The sign of the work tells who pushes: what is passive gives back no more than it took, whatever the arm does."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from contactsafe.control.codes import COMPLY, FREE
from contactsafe.control.contact_work import contact_work_dtype, follow_work, is_active, take_for_passive
from contactsafe.control.touch import touch_dtype
from contactsafe.core.compiled import compiled

DT = 0.001
SIGMA, MODEL = 0.05, np.zeros(2)


@compiled
def advance(works, touches, model, velocity, mode, stored):
    follow_work(works[0], touches[0], model, velocity, mode, stored, 0.001)
    return is_active(works[0])


def follow(works, torque, model, velocity, mode, stored):
    touches = np.zeros(1, dtype=touch_dtype(2))
    touches["torque"], touches["sigma"] = torque, SIGMA
    return advance(works, touches, model, velocity, mode, stored)


def begun():
    return np.zeros(1, dtype=contact_work_dtype(2))


@settings(max_examples=50, deadline=None)
@given(
    stiffness=st.floats(20.0, 5000.0), speed=st.floats(0.02, 1.0), pressed=st.integers(5, 300),
    back=st.floats(0.1, 1.0),
)  # fmt: skip
def test_a_spring_that_the_arm_ran_into_never_counts_as_one_who_pushes(stiffness, speed, pressed, back):
    """κ N m/rad at joint 1: run into, and let go at any speed."""
    works, depth, active = begun(), 0.0, False
    for k in range(2000):
        velocity = speed if k < pressed else -back * speed if depth > 0.0 else 0.0
        torque = np.array([-stiffness * max(depth + 0.5 * DT * velocity, 0.0), 0.0])  # over the tick
        stored = 0.5 * stiffness * max(depth + DT * velocity, 0.0) ** 2
        active |= follow(works, torque, MODEL, np.array([velocity, 0.0]), COMPLY if depth > 0.0 else FREE, stored)
        depth = max(depth + DT * velocity, 0.0)
    assert not active


@settings(max_examples=50, deadline=None)
@given(torque=st.floats(1.0, 30.0), yielded=st.floats(0.02, 0.5))
def test_what_moves_the_arm_along_pushes(torque, yielded):
    """At the latest once it has done 4 mJ more than may be an error."""
    works, moved = begun(), 0.0
    while moved * (torque - 2.0 * SIGMA) < 0.004:
        active = follow(works, np.array([torque, 0.0]), MODEL, np.array([yielded, 0.0]), COMPLY, 0.0)
        moved += DT * yielded
    assert active


def test_an_error_of_the_model_in_motion_is_no_push():
    """A joint in motion, and a torque along it that the model's uncertainty explains."""
    works, model = begun(), np.full(2, 1.5)
    for _ in range(2000):
        assert not follow(works, np.array([1.4, 0.0]), model, np.array([0.5, 0.0]), FREE, 0.0)


def test_what_showed_itself_to_be_passive_must_give_more_than_it_may_hold_back():
    works = begun()
    for _ in range(50):
        follow(works, np.array([10.0, 0.0]), MODEL, np.array([0.1, 0.0]), COMPLY, 0.0)
    take_for_passive(works[0], 0.02)
    assert not follow(works, np.array([10.0, 0.0]), MODEL, np.array([0.1, 0.0]), COMPLY, 0.02)
    assert works["done_j"][0] < -0.015
