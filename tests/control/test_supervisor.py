"""When contact mode begins and ends, and what is said of the contact.

An arm that stands still although g − τ is commanded is held by τ; with observers that follow at once the supervisor
sees exactly that τ at every tick.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.control.plant import controller_at, hold

from contactsafe import Measurement, presets

INSTANT = {"observer_gain": 1e6, "trigger_gain": 1e6, "residual_cutoff_hz": math.inf}


class Felt:
    """A controller whose arm stands still under whatever torque is felt."""

    def __init__(self, arm, config):
        self.controller = controller_at(arm, replace(config, **INSTANT))
        self.still, self.target = Measurement(arm.home, np.zeros(arm.n)), hold(arm)
        self.controller.step(self.still, self.target)

    def feel(self, torque, ticks=1):
        """Give whether the controller was in contact mode at each of some ticks."""
        modes = []
        for _ in range(ticks):
            record = self.controller.record
            record["state"]["tau"] = record["dynamics"]["g"] - torque
            self.out = self.controller.step(self.still, self.target)
            modes.append(self.out.contact.in_contact)
        return modes


def joint(number, torque):
    return np.eye(7)[number - 1] * torque


@pytest.mark.parametrize("sign", [1, -1])
def test_contact_begins_above_the_threshold(panda, sign):
    felt = Felt(panda, presets.paper())
    assert felt.feel(joint(3, sign * 1.499), 100) == [False] * 100
    assert felt.feel(joint(3, sign * 1.501)) == [True]


def test_contact_lasts_for_the_dwell(panda):
    """t_c = 50 ms: one tick above δ, then 49 more, whatever is felt."""
    felt = Felt(panda, presets.paper())
    modes = felt.feel(joint(3, 2.0)) + felt.feel(joint(3, 0.0), 100)
    assert modes == [True] * 50 + [False] * 51


def test_contact_lasts_while_it_is_felt(panda):
    """After the dwell the first tick below δ ends it: release_s is 0 in the paper."""
    felt = Felt(panda, presets.paper())
    assert felt.feel(joint(3, 2.0), 80) + felt.feel(joint(3, 1.4), 2) == [True] * 80 + [False] * 2


def test_contact_is_released_only_after_quiet(panda):
    """With release_s = 0.2 a blip starts the 200 ticks anew."""
    felt = Felt(panda, replace(presets.paper(), release_s=0.2))
    assert all(felt.feel(joint(3, 2.0)) + felt.feel(joint(3, 0.0), 150) + felt.feel(joint(3, 2.0)))
    assert felt.feel(joint(3, 0.0), 205) == [True] * 200 + [False] * 5


@pytest.mark.parametrize(
    ("torque", "link"),
    [
        ([0, 0, 0, 0, 0, 0, 0], 0),
        ([9, 0, 0, 0, 0, 0, 0], 1),
        ([9, 8, -1.6, 1.4, 1.4, 1.4, 1.4], 3),
        ([0, 0, 0, 0, 0, 0, -1.6], 7),
        ([1.4] * 7, 0),
    ],
)
def test_link_is_the_furthest_joint_above_the_threshold(panda, torque, link):
    felt = Felt(panda, presets.paper())
    felt.feel(np.array(torque, dtype=float))
    assert felt.out.contact.link == link
    assert felt.out.contact.in_contact == (link > 0)


def test_baseline_never_enters_but_reports(panda):
    felt = Felt(panda, presets.vices())
    assert felt.feel(joint(4, 40.0), 300) == [False] * 300
    assert felt.out.contact.link == 4
    assert felt.out.contact.torque == pytest.approx(joint(4, 40.0))


def test_direction_is_that_of_the_torque_last_felt(panda):
    felt = Felt(panda, presets.paper())
    felt.feel(np.array([0, 3.0, 0, -4.0, 0, 0, 0]))
    assert felt.controller.record["state"]["direction"] == pytest.approx([0, 0.6, 0, -0.8, 0, 0, 0])
    felt.feel(np.zeros(7))
    assert felt.controller.record["state"]["direction"] == pytest.approx([0, 0.6, 0, -0.8, 0, 0, 0])


def test_posture_stiffness_comes_back_slowly_after_contact(panda):
    """None of it during contact; 1 − exp(−t/recover_s) of it afterwards."""
    felt = Felt(panda, replace(presets.paper(), recover_s=0.2))
    state = felt.controller.record["state"]
    assert state["posture_share"] == 1.0
    felt.feel(joint(3, 2.0))
    assert state["posture_share"] == 0.0
    modes = felt.feel(joint(3, 0.0), 250)
    free_ticks = modes.count(False) - 1  # the tick that leaves contact mode is not yet one of recovery
    assert state["posture_share"] == pytest.approx(1 - math.exp(-free_ticks * 0.001 / 0.2), rel=1e-9)


def test_paper_takes_no_stiffness_away(panda):
    felt = Felt(panda, presets.paper())
    felt.feel(joint(3, 2.0), 10)
    assert felt.controller.record["state"]["posture_share"] == 1.0
