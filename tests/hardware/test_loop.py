"""The control loop on a robot of this process: what it sends, and how each fault ends."""

import time

import numpy as np
import pytest

from contactsafe.hardware import states
from contactsafe.hardware.mailbox import receive
from contactsafe.hardware.messages import as_words, seen_dtype
from contactsafe.hardware.port import RobotError


def test_an_arm_that_is_asked_to_stay_stays_and_gravity_is_the_robots(bench):
    one = bench()
    one.run(400)
    assert (one.status["state"], one.status["reason"]) == (states.STOPPING, states.TIME_UP)
    assert np.abs(one.robot.q - one.arm.home).max() < 2e-3
    assert np.abs(one.robot.sent).max() < 1.0  # of up to 30 N m that hold it
    assert one.robot.calls == ["begin", "finish"]


def test_every_step_of_the_torque_keeps_to_nine_tenths_of_the_robots_rate(bench):
    def jump(one, tick):
        if tick == 100:
            one.pose = one.pose._replace(position=np.add(one.pose.position, [0.08, 0.05, 0.0]))

    one = bench(jump)
    one.run(500)
    steps = np.diff(np.vstack([np.zeros(7), *one.robot.sent]), axis=0)
    assert np.abs(steps).max() <= 0.9 + 1e-9
    assert one.status["first_step_nm"] <= 0.9
    assert one.status["largest_step_nm"] == pytest.approx(np.abs(steps[1:]).max())


def test_busy_counts_from_the_arrival_of_a_state_its_conversion_included(bench):
    one = bench()
    fill = one.robot._fill

    def slowly(reading):
        time.sleep(0.0015)
        fill(reading)

    one.robot._fill = slowly
    one.run(50)
    assert one.status["busy"][:1500].sum() == 0
    assert one.status["busy"].sum() >= 50


def test_a_target_is_followed(bench):
    def go(one, tick):
        if tick == 50:
            one.pose = one.pose._replace(position=np.add(one.pose.position, [0.05, 0.0, 0.0]))

    one = bench(go)
    one.run(1500)
    found = one.arm.tool_pose(one.robot.q).position
    assert np.linalg.norm(found - one.pose.position) < 2e-3


def moving(one, tick):
    """Keep the tool on the move at some 0.2 m/s."""
    if tick % 16 == 1:
        one.pose = one.pose._replace(position=np.add(one.pose.position, [0.0, 0.0035, 0.0]))


def silent(one, tick):
    moving(one, tick)
    one.speaks = tick < 400


def once_late(ticks):
    def each(one, tick):
        moving(one, tick)
        one.speaks = not 400 <= tick < 400 + ticks

    return each


def not_finite(one, tick):
    moving(one, tick)
    one.speaks = tick < 400
    if tick >= 400 and tick % 16 == 1:
        one.tell(int(one.status["tick"]), position=np.full(3, np.nan))


def of_another_length(one, tick):
    moving(one, tick)
    one.speaks = tick < 400
    if tick >= 400 and tick % 16 == 1:
        one.tell(int(one.status["tick"]), joints=6)


def slow_by(ticks):
    def each(one, tick):
        moving(one, tick)
        one.speaks = tick < 400
        if tick >= 400 and tick % 16 == 1:
            one.tell(int(one.status["tick"]) - ticks)

    return each


def backwards(one, tick):
    moving(one, tick)
    if tick == 400:
        one.speaks = False
    if tick > 400 and tick % 16 == 1:
        one.tell(399 - (tick - 400))


def no_watchdog(one, tick):
    moving(one, tick)
    if tick > 400:
        one.exchange.status["beat_watchdog"] -= 1


def asked(one, tick):
    moving(one, tick)
    if tick == 400:
        one.exchange.ask_to_stop(states.ASKED)


FAULTS = {
    "policy dead": (silent, states.POLICY_SILENT),
    "policy slow by 250 ms": (once_late(251), states.POLICY_SILENT),
    "policy always slow by 60 ms": (slow_by(60), states.TARGET_OLD),
    "policy always slow by 120 ms": (slow_by(120), states.TARGET_OLD),
    "target not finite": (not_finite, states.TARGET_UNSOUND),
    "target of another length": (of_another_length, states.TARGET_JOINTS),
    "time stamps going backwards": (backwards, states.TARGET_ORDER),
    "watchdog killed": (no_watchdog, states.WATCHDOG_SILENT),
    "Ctrl-C": (asked, states.ASKED),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_moving_arm_comes_to_rest_for_a_reason_that_is_named(bench, fault):
    """Held or stopped: the tool is under 1 cm/s within 300 ms of when that began, gravity carried all the while."""
    each, reason = FAULTS[fault]
    one = bench(each)
    one.run(1500)
    kinds = [state for state, _ in one.states]
    begins = next(k for k, state in enumerate(kinds) if state in (states.HELD, states.STOPPING))
    assert one.speeds[begins] > 0.05
    assert max(one.speeds[begins + 300 :], default=0.0) < 0.01
    assert (one.status["state"], one.status["reason"]) == (states.STOPPING, reason)
    assert "finish" in one.robot.calls
    heights = one.arm.tool_pose(one.robot.q).position[2] - one.arm.tool_pose(one.arm.home).position[2]
    assert abs(heights) < 0.02


@pytest.mark.parametrize("ticks", [60, 120])
def test_a_policy_that_is_late_once_is_held_and_goes_on(bench, ticks):
    one = bench(once_late(ticks))
    one.run(900)
    kinds = [state for state, _ in one.states]
    assert states.HELD in kinds
    assert kinds[-1] in (states.STOPPING, states.RUNNING)
    assert states.RUNNING in kinds[kinds.index(states.HELD) + 150 :]
    assert one.status["reason"] == states.TIME_UP


def test_a_robot_that_stops_by_itself_is_told_by_its_own_words(bench):
    def fail(one, tick):
        if tick == 200:
            raise RobotError(("joint_reflex",), "motion aborted by reflex!")

    one = bench(fail)
    with pytest.raises(RobotError, match="joint_reflex: motion aborted by reflex!"):
        one.run(1000)


def test_measurements_that_are_lost_for_long_brake_the_arm_and_the_run_is_a_fault(bench):
    def freeze(one, tick):
        moving(one, tick)
        if tick == 400:
            one.robot.time += 0.05

    one = bench(freeze)
    one.run(1500)
    assert (one.status["state"], one.status["reason"]) == (states.FAULT, states.BRAKED)
    assert "finish" in one.robot.calls


def test_a_push_is_rejected_while_the_policy_waits(bench):
    def lean(one, tick):
        one.robot.push = np.array([0.0, 0.0, 0.0, 6.0, 0.0, 0.0, 0.0]) if 500 <= tick < 1500 else np.zeros(7)

    moved = {}
    for preset in ("vices", "safe"):
        one = bench(lean, preset=preset)
        one.run(1500)
        rows = one.exchange.ticks[: int(one.status["rows"])]
        away = rows["output"]["position"] - rows["output"]["position"][450]
        moved[preset] = np.linalg.norm(away[500:1500], axis=1).max()
    assert moved["safe"] < 0.5 * moved["vices"]


def test_the_policy_is_told_that_the_arm_is_held_until_a_good_target_comes(bench):
    told = {}

    def each(one, tick):
        once_late(80)(one, tick)
        seen = np.zeros(1, seen_dtype(7))
        if receive(one.exchange.seen, as_words(seen)) > 0:
            told[int(seen[0]["tick"])] = int(seen[0]["held"])

    bench(each).run(700)
    held = [tick for tick in told if told[tick] and tick < 700]
    assert held == list(range(held[0], held[-1] + 1))
    assert 430 < held[0] < 460
    assert 475 < held[-1] < 500
