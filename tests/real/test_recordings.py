"""Recordings of a real Panda, where they are at hand: nothing false, every touch felt, as soon as the robot's own says.

They are no part of the project: `CONTACTSAFE_REAL_DATA` names their folder, or it lies beside the checkout.
"""

import numpy as np
import pytest

from tests.real import recordings

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(
        recordings.folder() is None,
        reason="no recordings of a real Panda here; CONTACTSAFE_REAL_DATA names the folder that has them",
    ),
]

WRENCHES = pytest.mark.parametrize("wrench_ee", [np.zeros(6), None], ids=["zero wrench", "no wrench"])
RATE_S = 1.0 / 90.0


@pytest.fixture(scope="module")
def felt():
    """Play a recording of touches, once for each wrench."""
    known = {}

    def play(name, wrench_ee):
        key = name, wrench_ee is None
        if key not in known:
            log = recordings.touches(name)
            rows = log["t"], log["q"], log["qd"], log["tau_J"]
            known[key] = log, recordings.played(recordings.arm_of(name), *rows, wrench_ee, RATE_S)
        return known[key]

    return play


@WRENCHES
def test_free_motion_is_no_contact(wrench_ee):
    """The robot's own velocity alone had version 0.1 in contact for 99 % of it."""
    t, q, qd, torque, _ = recordings.free_motion()
    felt = recordings.played(recordings.arm_of("free"), t, q, qd, torque, wrench_ee)
    assert not any(contact.touched or contact.in_contact for contact in felt.contacts)


@WRENCHES
@pytest.mark.parametrize("name", recordings.TOUCHES)
def test_every_touch_is_felt_and_nothing_else(felt, name, wrench_ee):
    log, one = felt(name, wrench_ee)
    assert np.isfinite(recordings.found_after(one.contacts, log)).all()
    assert recordings.false_starts(one.contacts, log) == 0


@WRENCHES
def test_touches_are_felt_no_later_than_by_the_robots_own_estimate(felt, wrench_ee):
    ours, franka = [], []
    for name in recordings.TOUCHES:
        log, one = felt(name, wrench_ee)
        ours.append(recordings.found_after(one.contacts, log))
        franka.append(recordings.first_above(np.abs(log["tau_ext"]).max(axis=1) > 1.5, log))
    assert np.nanmedian(np.concatenate(ours)) <= np.nanmedian(np.concatenate(franka))


def test_the_link_is_named_rightly_in_most(felt):
    right = 0
    for name, link in recordings.TOUCHES.items():
        log, one = felt(name, np.zeros(6))
        right += sum(named == link for named in recordings.links_at_their_peak(one.contacts, log))
    assert right >= 0.6 * 60


@pytest.mark.parametrize("name", recordings.TOUCHES)
def test_a_residual_is_what_the_robots_own_estimate_says_with_the_other_sign(felt, name):
    log, one = felt(name, np.zeros(6))
    ours = np.array([contact.torque for contact in one.contacts])[200:]
    theirs = -(log["tau_ext"] - log["tau_ext"][100:200].mean(axis=0))[200:]
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.8
