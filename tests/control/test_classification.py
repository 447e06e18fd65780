"""What takes less than a spring would, or goes on after the arm has receded, is a push; what is stiff an obstacle."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from tests.control.plant import controller_at

from contactsafe import presets
from contactsafe.control.classification import _advance, _comes_back, classify, goes_on, is_stiff
from contactsafe.control.codes import COMPLY, PUSH
from contactsafe.core.compiled import compiled

SOFTEST = 1500.0
SPRING = 0.0
"""Anything counts as an obstacle, however soft."""

DIRECTION = np.eye(7)[1]

levers = st.floats(0.03, 1.0)
displacements = st.floats(1e-4, 0.1)
torques = st.floats(2.0, 40.0)


@given(torque=torques, stiffness=st.floats(10.0, 1e5), receded=st.floats(0.0, 1.0))
def test_no_spring_that_took_its_energy_from_the_arm_is_a_push(torque, stiffness, receded):
    """A spring of κ N m/rad took τ² / (2 κ); receding by x it loses κ x, all of it at most."""
    displacement = receded * torque / stiffness
    taken = 0.5 * torque * torque / stiffness
    assert not goes_on(stiffness * displacement, displacement, torque, taken, SPRING, 0.0)
    assert not goes_on(torque, displacement + 1.0, torque, taken, SPRING, 0.0)


@given(torque=torques, taken=st.floats(0.0, 0.05), rise=st.floats(0.0, 20.0))
def test_a_torque_that_goes_on_is_a_push_once_the_fall_of_a_spring_would_stand_out(torque, taken, rise):
    displacement = 4.0 * max(taken, 0.0005) / torque
    assert goes_on(-rise, displacement, torque, taken, SPRING, 0.0)


@given(torque=torques, taken=st.floats(0.0, 0.05), displacement=displacements)
def test_what_the_models_errors_may_feign_is_no_push(torque, taken, displacement):
    assert not goes_on(0.0, displacement, torque, taken, SPRING, torque)


@compiled
def _press(c, torque):
    state = c.state
    return classify(
        state.classification, state.isolation, state.contact_work, torque, 0.0, COMPLY, state.step,
        c.params.classification,
    )  # fmt: skip


def _met_again(panda, torques):
    """Press, come off, press again with these torques while the arm recedes; return what is shown."""
    controller = controller_at(panda, presets.safe())
    c, state = controller.record, controller.record["state"]
    state["isolation"]["direction"], state["isolation"]["lever"], state["isolation"]["lever_max"] = DIRECTION, 0.5, 0.5
    known, shown = state["classification"], set()
    known["reference_nm"], known["reference_j"], state["contact_work"]["taken_j"] = 3.0, 0.2, 0.2
    for torque in [-0.1, *torques]:
        known["displacement_rad"] += 0.0002
        known["displacement_smooth_rad"], known["torque_smooth_nm"] = known["displacement_rad"], torque
        shown.add(_press(c, torque * DIRECTION))
    return shown


def test_obstacle_that_bounced_and_swings_back_is_no_push(panda):
    """A sphere on a spring, hit and met again, pressed more as the arm receded: resisted, it pressed with 101 N."""
    swings = 12.0 * np.sin(np.linspace(0.0, np.pi, 30))
    assert PUSH not in _met_again(panda, swings)


def test_a_push_that_came_off_and_is_back_is_one_once_it_no_longer_rises(panda):
    """A policy that was pushed was let down onto the board, with 80 N, because the push had flickered."""
    assert PUSH in _met_again(panda, [*np.linspace(0.0, 6.0, 10), *np.full(200, 6.0)])


@given(stiffness=st.floats(SOFTEST, 1e6), lever=levers, displacement=displacements)
def test_the_softest_obstacle_is_stiff_once_its_fall_stands_out(stiffness, lever, displacement):
    """At a lever arm l a spring of k N/m loses k l² N m for every radian that the arm recedes."""
    fall = stiffness * lever**2 * displacement
    assert is_stiff(fall, displacement, SOFTEST * lever**2, 0.0) == (fall > 0.4)


@given(lever=levers, displacement=displacements, change=st.floats(-20.0, 0.0))
def test_what_does_not_fall_is_not_stiff(lever, displacement, change):
    assert not is_stiff(change, displacement, SOFTEST * lever**2, 0.0)


@given(torque=torques, taken=st.floats(0.0, 10.0), lever=levers)
def test_what_is_softer_than_any_obstacle_goes_on_whatever_it_took(torque, taken, lever):
    """A person who pushes a moving arm from the front takes as much work as a soft spring."""
    softest = SOFTEST * lever**2
    assert goes_on(0.0, 4.0 * torque / softest, torque, taken, softest, 0.0)


@given(stiffness=st.floats(SOFTEST, 1e6), lever=levers, torque=torques, receded=st.floats(0.0, 1.0))
def test_no_obstacle_is_softer_than_that(stiffness, lever, torque, receded):
    spring = stiffness * lever**2
    displacement = receded * torque / spring
    taken = 0.5 * torque * torque / spring
    assert not goes_on(spring * displacement, displacement, torque, taken, SOFTEST * lever**2, 0.0)


@compiled
def _come_back(c, work, displacement, far):
    classification = c.state.classification
    classification.displacement_smooth_rad, classification.displacement_rad = displacement, displacement
    if _comes_back(classification, far):
        _advance(classification, work, 0.01)


def test_push_that_follows_the_arm_as_it_comes_back_is_asked_anew(panda):
    """Measured from the peak of the impact, its torque seemed to have fallen, and it was never named again."""
    controller = controller_at(panda, presets.safe())
    c, state = controller.record, controller.record["state"]["classification"]
    state["reference_nm"], state["torque_smooth_nm"] = 9.0, 6.0
    for displacement in (0.05, 0.10, 0.098):  # it recedes, and comes back by less than counts
        _come_back(c, 0.3, displacement, 0.01)
        assert state["reference_nm"] == 9.0
    _come_back(c, 0.3, 0.08, 0.01)
    assert state["reference_nm"] == 6.0
    assert state["reference_j"] == 0.3
    assert state["displacement_smooth_rad"] == 0.0
