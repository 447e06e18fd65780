"""States of a run, and the reasons why the arm is held or stopped, each with what a person is to do."""

from typing import NamedTuple

IDLE, RUNNING, HELD, STOPPING, STOPPED, FAULT = range(6)
"""Of the control process. HELD ends by itself when good targets come again; STOPPED and FAULT end the run."""

STATES = ("idle", "running", "held", "stopping", "stopped", "fault")


class Reason(NamedTuple):
    """Why a run is not running.

    Attributes:
        name: as logged and shown.
        remedy: what a person is to do, one line.
    """

    name: str
    remedy: str


NONE, TARGET_OLD, TARGET_ORDER, TARGET_UNSOUND, TARGET_JOINTS = 0, 1, 2, 3, 4
POLICY_SILENT, POLICY_DEAD, ASKED, TIME_UP, WATCHDOG_SILENT, COMMAND_DEAD = 5, 6, 7, 8, 9, 10
CONTROL_STUCK, ROBOT_SILENT, ROBOT_FAULT, BRAKED, CONTROL_DEAD, CAMERA_SILENT, POLICY_DONE = 11, 12, 13, 14, 15, 16, 17

REASONS = {
    NONE: Reason("none", ""),
    TARGET_OLD: Reason("targets too old", "the policy needs longer than 50 ms; free the processor, or slow the task"),
    TARGET_ORDER: Reason("target out of order", "the policy's clock or counter went backwards; start the run anew"),
    TARGET_UNSOUND: Reason("target not sound", "the policy gave numbers that are not finite or gains out of range"),
    TARGET_JOINTS: Reason("target of another length", "policy and robot differ in joints; run a policy for this arm"),
    POLICY_SILENT: Reason("policy silent", "no good target for 200 ms; see the policy's message, and start anew"),
    POLICY_DEAD: Reason("policy ended", "the policy process has died; see its message, and start anew"),
    ASKED: Reason("asked to stop", "start the command again to go on"),
    TIME_UP: Reason("time is up", "give --seconds more"),
    WATCHDOG_SILENT: Reason("watchdog silent", "the watchdog has died; start anew"),
    COMMAND_DEAD: Reason("command ended", "the command that began the run has died; start it anew"),
    CONTROL_STUCK: Reason("control stuck", "the control loop stood still for 100 ms; give it a processor of its own"),
    ROBOT_SILENT: Reason("robot silent", "no state for 300 ms; check cable, power and the robot's own interface"),
    ROBOT_FAULT: Reason("robot fault", "the robot has stopped by itself; see its error"),
    BRAKED: Reason("braked", "measurements were lost or contradicted each other; see the fault in the log, start anew"),
    CONTROL_DEAD: Reason("control ended", "the control process has died, the robot holds itself; start anew"),
    CAMERA_SILENT: Reason("camera silent", "nothing new for ten seconds; plug the camera in again, and start anew"),
    POLICY_DONE: Reason("done", "the policy has done its work"),
}
"""By number, as in a log."""

WELL = (ASKED, TIME_UP, POLICY_DONE)
"""Reasons for which a run ends that is no failure."""
