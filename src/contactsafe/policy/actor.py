"""A policy and its target on a real robot: as it goes to its work, at work, or still because it sees nothing."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contactsafe.control.records import controller_dtype
from contactsafe.core.copying import Unique
from contactsafe.core.rotation import quat_multiply, quat_to_rotvec, rotvec_to_quat
from contactsafe.hardware.exchange import STEPS, Exchange
from contactsafe.hardware.mailbox import publish, receive
from contactsafe.hardware.messages import as_words, message_dtype, seen_dtype
from contactsafe.hardware.states import CAMERA_SILENT
from contactsafe.policy.action import apply_one, look_at
from contactsafe.policy.action_config import action_limits
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.policy import Policy
from contactsafe.policy.work import Work
from contactsafe.robot.arm import Arm
from contactsafe.robot.posture import POSITION_TOLERANCE, find_posture, posture_rule

_ARRIVED_M = 0.01

_TURN_RAD_S = 0.5
"""The tool is turned to where the work begins no faster than this."""

_ELAPSED_S = 0.05
"""Time that travel makes up for at most where a step came late; an action is that of one step, however late."""

_BLIND_STEPS = 600
"""Policy steps for which the arm waits for a camera that shows nothing new, ten seconds, before the run ends."""

_QUIET_STEPS = 6
"""Policy steps for which the arm waits at the start before the policy is asked, at least."""


@dataclass(frozen=True)
class PolicySettings:
    """What the policy process is told.

    Attributes:
        arm: that is controlled.
        bundle: folder of the policy.
        work: of its task.
        speed: factor on how fast the target moves, at most 1.
        lockstep: the control process waits for it, so that a run is the same again.
        rounds: of work after which it ends; 0 for no end.
        hold: the arm stays where the work would begin; the policy is not asked.
    """

    arm: Arm
    bundle: Path
    work: Work
    speed: float = 1.0
    lockstep: bool = False
    rounds: int = 0
    hold: bool = False


class Actor(Unique):
    """The policy and its target, between messages."""

    _why = "an actor speaks for one run; make another one"

    def __init__(self, settings: PolicySettings, exchange: Exchange):
        self.settings, self.exchange, self.work = settings, exchange, settings.work
        n = settings.arm.n
        bundle = Bundle.load(settings.bundle)
        self.policy = Policy(bundle, self.work.homography)
        config = self.work.action
        self.limits = action_limits(config, self.work.centre)
        self.limits.step[:6] *= settings.speed
        self.rule = posture_rule(settings.arm)
        self.shadow = np.zeros(1, controller_dtype(n))
        self.pose, self.target = np.zeros(6), np.zeros(18)
        self.stiffness, self.damping = config.stiffness_first, 2.0 * np.sqrt(config.stiffness_first)
        self.message, self.seen = np.zeros(1, message_dtype(n)), np.zeros(1, seen_dtype(n))
        self.message["joints"] = n
        self.words, self.seen_words = as_words(self.message), as_words(self.seen)
        self.steps, self.waited, self.rounds, self.action = -1, 0, 0, np.zeros(18)
        self.done, self.blind, self.held_at = False, 0, np.zeros(3)
        self.elapsed_s, self.seen_tick = 0.0, 0
        self._warm_up()

    def _warm_up(self) -> None:
        """Run what a step runs once, so that nothing is compiled or loaded once the arm moves."""
        self._take_over()
        self._travel()
        apply_one(self.shadow, 0, self.limits, self.rule, self.action)
        publish(self.exchange.targets.copy(), self.words)
        receive(self.exchange.seen.copy(), self.seen_words.copy())

    def step(self) -> None:
        """Look, decide, tell."""
        began, status, number = time.perf_counter_ns(), self.exchange.status, int(self.message["number"][0])
        self._take_over()
        observed = self.work.look(self.seen[0], self.pose, self.steps)
        if self._waits_to_see():
            self._tell(number + 1)
            status["beat_policy"] += 1
            return
        observation = {"pose": self.pose, "target": self.target, **observed}
        if self.steps >= 0 and self.work.is_done():
            self.steps, self.waited, self.rounds = -1, 0, self.rounds + 1
            self.done = self.settings.rounds > 0 and self.rounds >= self.settings.rounds
        elif self.steps >= 0 and self.work.is_stalled():
            self.steps, self.waited = -1, 0
        if self.steps < 0 and self._travel() and self.work.is_ready() and not self.settings.hold:
            self.steps = 0
            self.policy.begin()
            observation.update(self.work.look(self.seen[0], self.pose, self.steps))
        if self.steps >= 0:
            self.action = self.policy.act(observation).astype(float)
            apply_one(self.shadow, 0, self.limits, self.rule, self.action)
            self.steps += 1
        self._tell(number + 1)
        status["beat_policy"] += 1
        self._record(began, number, observed.get("force", self.seen[0]["force"]))

    def _waits_to_see(self) -> bool:
        """Hold the arm where it is while the camera shows what is past; end the run where that lasts."""
        self.blind = self.blind + 1 if self.work.is_blind() else 0
        if self.blind == 0:
            return False
        if self.blind == 1:
            self.held_at = self.seen[0]["position"].copy()
        if self.blind > _BLIND_STEPS:
            self.exchange.ask_to_stop(CAMERA_SILENT)
        self.shadow[0]["target"]["position"] = self.held_at
        return True

    def _take_over(self) -> None:
        """Take what the control process told as it is now: where the tool is, how late it is, where the arm is held.

        Where it is not, the target goes on from what was told last: that in force is one behind as often as not.
        """
        shadow, seen = self.shadow[0], self.seen[0]
        shadow["output"]["position"], shadow["output"]["rotation"] = seen["position"], seen["rotation"]
        if seen["held"] or self.message["number"] == 0:
            shadow["target"] = seen["target"]
        tick = int(seen["tick"])
        self.elapsed_s, self.seen_tick = min(0.001 * (tick - self.seen_tick), _ELAPSED_S), tick
        look_at(self.shadow, 0, self.pose, self.target)

    def _travel(self) -> bool:
        """Turn the target to the start and move it there: up, aside, down; tell whether it has waited there."""
        target, start = self.shadow[0]["target"], self.work.start
        path = start.position - target["position"]
        if path[2] > 0.0:
            path[:2] = 0.0  # up before aside
        elif np.any(np.abs(path[:2]) > 1e-6):
            path[2] = 0.0  # aside before down
        length, stride = float(np.linalg.norm(path)), self.work.travel_m_s * self.settings.speed * self.elapsed_s
        target["position"] += path * min(1.0, stride / max(length, 1e-9))
        turn_left = _turn_towards(target["quat"], start.quat, _TURN_RAD_S * self.settings.speed * self.elapsed_s)
        target["K_task"], target["D_task"] = self.stiffness, self.damping
        posture = np.empty(self.settings.arm.n)
        if find_posture(self.rule, target["position"], target["quat"], posture)[0] <= POSITION_TOLERANCE:
            target["q_posture"] = posture
        left = math.dist(target["position"], start.position)
        arrived = left < 1e-6 and turn_left == 0.0 and math.dist(self.seen[0]["position"], start.position) < _ARRIVED_M
        self.waited = self.waited + 1 if arrived else 0
        return self.waited > _QUIET_STEPS

    def _tell(self, number: int) -> None:
        message, target = self.message[0], self.shadow[0]["target"]
        message["number"], message["of_tick"] = number, self.seen[0]["tick"]
        for name in ("position", "quat", "K_task", "D_task", "q_posture"):
            message[name] = target[name]
        publish(self.exchange.targets, self.words)

    def _record(self, began: int, step: int, force: np.ndarray) -> None:
        status = self.exchange.status
        row = self.exchange.steps[int(status["steps_written"][0]) % STEPS]
        row["step"], row["of_tick"], row["stamp"] = step, self.seen[0]["tick"], time.time_ns()
        row["busy_ns"] = time.perf_counter_ns() - began
        row["frame_age_ms"], row["shown"] = self.work.seen_with()
        row["pose"], row["force"], row["action"] = self.pose, force, self.action
        status["steps_written"] += 1
        status["steps"] = step + 1


def _turn_towards(quat: np.ndarray, goal: np.ndarray, most: float) -> float:
    """Turn an orientation in place towards another, by an angle at most, rad; return what is left of it."""
    turn = quat_to_rotvec(quat_multiply(goal, quat * [1.0, -1.0, -1.0, -1.0]))
    angle = float(np.linalg.norm(turn))
    if angle <= most:
        quat[:] = goal
        return 0.0
    quat[:] = quat_multiply(rotvec_to_quat(turn * (most / angle)), quat)
    return angle - most
