"""What is let through to the controller, and what the arm does where nothing is."""

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.control.controller import Controller
from contactsafe.control.records import controller_dtype
from contactsafe.core.compiled import compiled
from contactsafe.hardware import gate, states
from contactsafe.hardware.gate import OLD_TICKS, SILENT_TICKS, gate_dtype
from contactsafe.hardware.messages import message_dtype
from contactsafe.robot import robots


@compiled
def _admit(gates, messages, arrived, tick, controllers):
    gate.admit(gates[0], messages[0], arrived, tick, controllers[0])


@compiled
def _follow(gates, tick, stop, controllers):
    gate.follow_state(gates[0], tick, stop, controllers[0])


class Door:
    """A gate before a controller that holds the arm at home."""

    def __init__(self):
        self.arm = robots.fr3()
        self.controller = Controller(self.arm, presets.safe())
        self.controller.reset(self.arm.home)
        self.records = self.controller._records.view(controller_dtype(7))
        self.gates, self.message = np.zeros(1, gate_dtype), np.zeros(1, message_dtype(7))
        self.gates["state"] = states.RUNNING
        pose, row = self.arm.tool_pose(self.arm.home), self.message[0]
        row["position"], row["quat"], row["q_posture"], row["joints"] = pose.position, pose.quat, self.arm.home, 7
        row["K_task"], row["D_task"], row["number"] = 150.0, 24.0, 1
        self.sequence = 0

    @property
    def gate(self):
        return self.gates[0]

    @property
    def target(self):
        return self.controller.record["target"]

    def hand_in(self, tick, **changes):
        """Hand a message in at a tick; return why it is refused."""
        for name, value in changes.items():
            self.message[0][name] = value
        self.sequence += 2
        _admit(self.gates, self.message, self.sequence, tick, self.records)
        return int(self.gate["refusal"])

    def follow(self, tick, stop=0):
        _follow(self.gates, tick, stop, self.records)
        return int(self.gate["state"]), int(self.gate["reason"])


@pytest.fixture
def door():
    return Door()


def test_a_good_target_becomes_the_controllers(door):
    assert door.hand_in(10, of_tick=9, position=(0.3, 0.1, 0.4)) == states.NONE
    assert (door.target["position"] == [0.3, 0.1, 0.4]).all()
    assert door.target["kept"] == 0
    assert door.follow(10) == (states.RUNNING, states.NONE)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"position": (np.nan, 0.0, 0.4)}, states.TARGET_UNSOUND),
        ({"q_posture": np.full(7, np.inf)}, states.TARGET_UNSOUND),
        ({"quat": (0.0, 0.0, 0.0, 0.0)}, states.TARGET_UNSOUND),
        ({"K_task": 1e9}, states.TARGET_UNSOUND),
        ({"D_task": -1.0}, states.TARGET_UNSOUND),
        ({"joints": 6}, states.TARGET_JOINTS),
        ({"of_tick": 1000 - OLD_TICKS - 1}, states.TARGET_OLD),
        ({"of_tick": 1001}, states.TARGET_ORDER),
        ({"number": 0}, states.TARGET_ORDER),
    ],
)
def test_a_bad_target_is_refused_by_name_and_the_last_one_stays(door, changes, why):
    assert door.hand_in(941, of_tick=940, position=(0.3, 0.1, 0.4)) == states.NONE
    assert door.hand_in(1000, **{"number": 2, "of_tick": 999, "position": (0.9, 0.9, 0.9), **changes}) == why
    assert (door.target["position"] == [0.3, 0.1, 0.4]).all()
    assert door.target["kept"] == 1
    assert door.gate["refused"] == 1


def test_a_target_that_repeats_or_goes_back_in_time_is_refused(door):
    assert door.hand_in(100, number=5, of_tick=99) == states.NONE
    assert door.hand_in(101, number=5, of_tick=100) == states.TARGET_ORDER
    assert door.hand_in(102, number=6, of_tick=98) == states.TARGET_ORDER
    assert door.hand_in(103, number=6, of_tick=102) == states.NONE


def test_what_was_read_before_is_no_new_target_and_a_torn_one_is_none(door):
    door.hand_in(100, of_tick=99)
    for arrived in (door.sequence, -1, 0):
        _admit(door.gates, door.message, arrived, 101, door.records)
        assert door.target["kept"] == 1
    assert door.gate["refused"] == 0


def test_the_arm_is_held_at_50_ms_and_the_run_ends_at_200(door):
    door.hand_in(100, of_tick=100)
    seen = {age: door.follow(100 + age) for age in range(1, SILENT_TICKS + 5)}
    assert all(seen[age][0] == states.RUNNING for age in range(1, OLD_TICKS + 1))
    assert all(seen[age] == (states.HELD, states.TARGET_OLD) for age in range(OLD_TICKS + 1, SILENT_TICKS + 1))
    assert seen[SILENT_TICKS + 1] == (states.STOPPING, states.POLICY_SILENT)


def test_a_good_target_ends_the_hold_and_none_ends_a_stop(door):
    door.hand_in(100, of_tick=100)
    assert door.follow(100 + OLD_TICKS + 1)[0] == states.HELD
    assert door.hand_in(160, number=2, of_tick=159) == states.NONE
    assert door.follow(160)[0] == states.RUNNING
    assert door.follow(160 + SILENT_TICKS + 1)[0] == states.STOPPING
    door.hand_in(400, number=3, of_tick=399)
    assert door.follow(400)[0] == states.STOPPING


@pytest.mark.parametrize("state", [states.STOPPING, states.FAULT])
def test_an_arm_that_was_to_come_to_rest_followed_the_policy_and_whoever_pushed_it(door, state):
    door.hand_in(100, of_tick=100)
    door.gate["state"] = state
    door.follow(101)
    held = door.target.copy()
    door.controller.record["output"]["position"] += 0.05  # pushed
    for k in range(5):
        door.hand_in(102 + k, number=2 + k, of_tick=101 + k, position=(0.9, 0.9, 0.9), K_task=10.0)
        door.follow(102 + k)
    assert np.array_equal(door.target["position"], held["position"])
    assert np.array_equal(door.target["K_task"], held["K_task"])
    assert door.gate["refused"] == 0


def test_a_reading_that_is_no_number_is_no_posture_to_hold(door):
    door.hand_in(100, of_tick=100)
    door.controller.record["measurement"]["q"][2] = np.nan
    door.follow(100 + OLD_TICKS + 1)
    assert np.isfinite(door.target["q_posture"]).all()


def test_the_reason_of_a_hold_is_why_targets_are_refused(door):
    door.hand_in(100, of_tick=100)
    door.hand_in(120, number=2, of_tick=119, position=(np.nan, 0.0, 0.0))
    assert door.follow(100 + OLD_TICKS + 1) == (states.HELD, states.TARGET_UNSOUND)
    assert door.follow(100 + SILENT_TICKS + 1) == (states.STOPPING, states.TARGET_UNSOUND)


def test_a_wish_to_stop_is_followed_at_once_by_its_name(door):
    door.hand_in(100, of_tick=100)
    assert door.follow(101, stop=states.ASKED) == (states.STOPPING, states.ASKED)


def test_a_direction_that_the_policy_let_go_is_held_when_it_falls_silent(door):
    stiffness = np.array([150.0, 0.0, 150.0, 150.0, 150.0, 0.0])
    assert door.hand_in(100, of_tick=100, K_task=stiffness) == states.NONE
    assert door.follow(100 + OLD_TICKS + 1)[0] == states.HELD
    assert (door.target["K_task"] >= 150.0).all()


def test_a_held_arm_is_told_to_stay_where_its_tool_coasts_to_once(door):
    door.hand_in(100, of_tick=100)
    out = door.controller.record["output"]
    out["position"], out["rotation"], out["velocity"][:3] = (0.4, 0.0, 0.3), np.eye(3), (0.4, 0.0, 0.0)
    door.follow(100 + OLD_TICKS + 1)
    first = door.target["position"].copy()
    assert 0.4 < first[0] < 0.411
    assert (door.target["D_task"] >= 24.0).all()
    out["position"] = (0.41, 0.0, 0.3)
    door.follow(100 + OLD_TICKS + 2)
    assert (door.target["position"] == first).all()
