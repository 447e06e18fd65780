"""What goes on after the arm has receded is a push, what falls as a spring would is an obstacle."""

from hypothesis import given
from hypothesis import strategies as st

from contactsafe.control.classification import is_push

SOFTEST = 1500.0

levers = st.floats(0.03, 1.0)
displacements = st.floats(1e-4, 0.1)


@given(stiffness=st.floats(SOFTEST, 1e6), lever=levers, displacement=displacements)
def test_no_spring_as_stiff_as_the_softest_obstacle_is_a_push(stiffness, lever, displacement):
    """At a lever arm l a spring of k N/m loses k l² N m for every radian that the arm recedes."""
    assert not is_push(stiffness * lever**2 * displacement, displacement, lever, SOFTEST)


@given(lever=levers, displacement=displacements, wrong=st.floats(0.71, 1.40))
def test_a_lever_found_wrong_by_a_factor_of_root_two_does_not_matter(lever, displacement, wrong):
    """The softest obstacle is one still, and a force that does not slacken a push."""
    assert not is_push(SOFTEST * (lever / wrong) ** 2 * displacement * 1.01, displacement, lever, SOFTEST)
    assert is_push(0.0, displacement, lever * wrong, SOFTEST)


@given(lever=levers, displacement=displacements, rise=st.floats(0.0, 20.0))
def test_what_goes_on_or_rises_is_a_push(lever, displacement, rise):
    assert is_push(-rise, displacement, lever, SOFTEST)


@given(lever=levers, displacement=displacements)
def test_line_is_drawn_at_half_the_fall_of_the_softest_obstacle(lever, displacement):
    line = 0.5 * SOFTEST * lever**2 * displacement
    assert is_push(line * (1 - 1e-9), displacement, lever, SOFTEST)
    assert not is_push(line * (1 + 1e-9), displacement, lever, SOFTEST)


@given(lever=levers, drop=st.floats(0.0, 5.0))
def test_nothing_is_a_push_before_the_arm_gave_way(lever, drop):
    assert not is_push(drop, 0.0, lever, SOFTEST)
