"""Give way a little and see: what still pushes as before is a pusher, what slackens as a spring would is in the way."""

from hypothesis import given
from hypothesis import strategies as st

from contactsafe.control.laws import is_pushed

SOFTEST = 1500.0

levers = st.floats(0.03, 1.0)
ways = st.floats(1e-4, 0.1)


@given(stiffness=st.floats(SOFTEST, 1e6), lever=levers, moved=ways)
def test_no_spring_as_stiff_as_the_softest_obstacle_is_a_pusher(stiffness, lever, moved):
    """At a lever arm l a spring of k N/m loses k l² N m for every radian of giving way."""
    assert not is_pushed(stiffness * lever**2 * moved, moved, lever, SOFTEST)


@given(lever=levers, moved=ways, wrong=st.floats(0.71, 1.40))
def test_a_lever_found_wrong_by_a_factor_of_root_two_does_not_matter(lever, moved, wrong):
    """The softest obstacle is one still, and a force that does not slacken a pusher."""
    assert not is_pushed(SOFTEST * (lever / wrong) ** 2 * moved * 1.01, moved, lever, SOFTEST)
    assert is_pushed(0.0, moved, lever * wrong, SOFTEST)


@given(lever=levers, moved=ways, rise=st.floats(0.0, 20.0))
def test_what_pushes_as_before_or_harder_is_a_pusher(lever, moved, rise):
    assert is_pushed(-rise, moved, lever, SOFTEST)


@given(lever=levers, moved=ways)
def test_line_is_drawn_at_half_the_fall_of_the_softest_obstacle(lever, moved):
    line = 0.5 * SOFTEST * lever**2 * moved
    assert is_pushed(line * (1 - 1e-9), moved, lever, SOFTEST)
    assert not is_pushed(line * (1 + 1e-9), moved, lever, SOFTEST)


@given(lever=levers, drop=st.floats(0.0, 5.0))
def test_nothing_is_a_pusher_before_the_arm_gave_way(lever, drop):
    assert not is_pushed(drop, 0.0, lever, SOFTEST)
