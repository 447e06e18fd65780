"""`contactsafe run --robot ADDRESS`: what is checked, said and asked before a real robot moves."""

import numpy as np

from contactsafe.cli.robot import ARMS, LOG, Options, StatusLine, load_of, parts_of, refuse_failed, said_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.crew import run_crew
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.franka_port import COLLISION_N, COLLISION_NM
from contactsafe.hardware.messages import reading_dtype
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.work import Work
from contactsafe.robot.arm import Arm

_NEAR_LIMIT_RAD = 0.05
_LESS_SAFE = ": it takes no notice of what touches the arm; for comparison, with nobody near"
_MODES = {0: "other", 1: "idle", 2: "moving", 3: "guiding", 4: "reflex", 5: "stopped by the user", 6: "recovering"}
_NOT_READY = {
    2: "end the program that moves it",
    3: "let go of its handle",
    4: "look at what stopped it, then give --recover once",
    5: "release the stop button",
    6: "wait until it has recovered",
}


def run_real(asked: Options, work: Work, arm: Arm, bundle: Bundle) -> None:
    """Look at the robot, show the checklist, ask, and run; with --dry-run look and show alone."""
    print(checklist(asked, arm, work, look(asked, arm)))
    if asked.dry_run:
        return
    if not asked.yes and input("The robot will move. Type yes to go on: ").strip().lower() != "yes":
        raise InvalidInputError("not confirmed; nothing was moved")
    exchange = Exchange.create(arm.n)
    try:
        said = said_of(asked, asked.controller) | {"address": str(asked.robot)}
        address = str(asked.robot)
        parts = parts_of(asked, arm, bundle.folder, work, asked.controller, address, asked.out / LOG, said)
        ending = run_crew(exchange, parts, asked.seconds, StatusLine())
    finally:
        exchange.unlink()
    print(f"{ending.state}: {ending.reason}; {ending.ticks} ticks, {ending.recorded} of them in {asked.out / LOG}")
    refuse_failed(ending, asked.controller)


def look(asked: Options, arm: Arm) -> np.void:
    """Return what the robot says of itself, at rest."""
    port, reading = ARMS[asked.arm][1](str(asked.robot), load_of(arm)), np.zeros(1, reading_dtype(arm.n))
    try:
        port.connect()
        if asked.recover:
            port.recover()
        port.look(reading)
    finally:
        port.close()
    return reading[0]


def checklist(asked: Options, arm: Arm, work: Work, reading: np.void) -> str:
    """Return what a person is to check before the robot moves; what a program can check, it has.

    Raises:
        InvalidInputError: the robot is not as it has to be.
    """
    q = reading["q"]
    margin = np.minimum(q - arm.q_min, arm.q_max - q)
    if margin.min() < _NEAR_LIMIT_RAD:
        raise InvalidInputError(
            f"joint {int(margin.argmin()) + 1} is {margin.min():.2f} rad from its limit; lead the arm away by hand"
        )
    if np.abs(reading["qd"]).max() > 0.05:
        raise InvalidInputError("the arm moves; bring it to rest first")
    if (mode := int(reading["mode"])) in _NOT_READY:
        raise InvalidInputError(f"the robot is not ready: {_MODES[mode]}; {_NOT_READY[mode]}")
    load, start, tool = load_of(arm), work.start.position, arm.tool_pose(q).position
    weight = "as in its own settings" if load is None else f"{load[0]:.2f} kg beyond the hand, told to the robot"
    state, up = _MODES.get(mode, "other"), "up, " if tool[2] < start[2] else ""
    lines = [
        f"robot        {asked.robot}, {state}; joints at least {margin.min():.2f} rad from their limits",
        f"tool         {arm.tool.name if arm.tool else 'none'}, {weight}; now at {_words(tool)} m",
        f"first move   {up}aside, turning down, and down to {_words(start)} m: is that path free?",
        f"workspace    about {_words(np.array(work.centre))} m: does what is worked on stand there, level?",
        *_camera_lines(asked, work),
        f"controller   {asked.controller}{_LESS_SAFE if asked.controller == 'vices' else ''}",
        f"speed        {asked.speed:g} of the policy's own; begin with --speed 0.2",
        f"collisions   the robot stops by itself beyond {COLLISION_NM:g} N m and {COLLISION_N:g} N: raised, since the "
        "controller keeps contacts gentle by itself, and an impact is short",
        "stop         is the emergency stop within your reach? Ctrl-C brings the arm to rest, too",
    ]
    return "\n".join(lines)


def _camera_lines(asked: Options, work: Work) -> list[str]:
    """Return what was calibrated of the camera; that nothing was, where the work looks through one."""
    if asked.camera_calibration is None:
        line = "camera       nothing was calibrated: do it and what it looks at stand as in training?"
        return [] if work.homography is None else [line]
    from contactsafe.cli.calibrate import lines_of
    from contactsafe.vision.camera_calibration import CameraCalibration

    return lines_of(CameraCalibration.load(asked.camera_calibration))


def _words(values: np.ndarray) -> str:
    return ", ".join(f"{value:.3f}" for value in values)
