"""`contactsafe identify` and `contactsafe record`: what a robot is, and a motion that shows it."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from contactsafe.cli.arms import arm_of
from contactsafe.cli.logs import LogOptions, tell
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import docstring, parse

WORDS = (
    "Mean torque over windows of 0.1 s that neither the description nor what was identified explains. Coulomb: dry "
    "friction in motion; viscous: in proportion to velocity; bias: constant; rotor: inertia before the gears."
)


@dataclass(frozen=True)
class Options(LogOptions):
    """What can be said of an identification.

    Attributes:
        save: file for what was identified, which the other commands take as --calibration.
    """

    save: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: LOG.calibration.json)")] = None


def identify(arguments: Sequence[str]) -> None:
    """Identify friction, rotors, payload, sensor bias and noise from a log of free motion.

    What the first half of the log shows is checked on the second; where that gets worse, nothing is written. The file
    it writes is what --calibration takes: replay, demo, experiment, evaluate and train.
    """
    from contactsafe.logs.identification import identify as find
    from contactsafe.logs.identified import results_of
    from contactsafe.report import prepare_output

    asked = parse(Options, "contactsafe identify", arguments, description=docstring(identify))
    arm = arm_of(asked.robot, asked.tool, asked.site)
    path = asked.save or Path(f"{asked.log.stem}.calibration.json")
    _refuse_folder(path)
    identified = find(asked.read(arm), arm)
    folder = prepare_output(asked.out) if asked.out else None
    identified.calibration.save(path)
    command = shlex.join(["contactsafe", "identify", *arguments])
    tell(results_of(identified), asked, folder, command, (f"What the {arm.name} is", WORDS))
    print(f"calibration: {path}", file=sys.stderr)


@dataclass(frozen=True)
class RecordOptions:
    """What can be asked of an exciting trajectory.

    Attributes:
        robot: panda, fr3, or the path of an MJCF or URDF file.
        tool: what a Franka's flange carries: hand, wiper, or flange for nothing.
        site: end-effector point of an MJCF file, or link of a URDF file.
        seconds: how long it is.
        rate: of its rows, Hz.
        seed: of the search.
        floor: height of a table that everything beyond the first link stays above, m, from the arm's world.
        out: CSV file with time, q and qd of every joint.
    """

    robot: str = "panda"
    tool: str = "hand"
    site: str | None = None
    seconds: float = 30.0
    rate: float = 1000.0
    seed: int = 0
    floor: Annotated[float | None, tyro.conf.arg(help_behavior_hint="(default: no table)")] = None
    out: Path = Path("trajectory.csv")


def record(arguments: Sequence[str]) -> None:
    """Propose a motion of all joints from which `identify` can tell what the robot is.

    It begins and ends at home, at rest, and keeps within the limits of position, speed and torque, off the arm itself
    and above --floor. Nothing else of the surroundings is known: look at it before a robot follows it.
    """
    import numpy as np

    from contactsafe.logs.excitation import excitation, write_trajectory

    asked = parse(RecordOptions, "contactsafe record", arguments, description=docstring(record))
    if asked.seed < 0:
        raise InvalidInputError(f"seed = {asked.seed}; give 0 or more")
    _refuse_folder(asked.out)
    arm = arm_of(asked.robot, asked.tool, asked.site)
    motion = excitation(arm, asked.seconds, asked.rate, asked.seed, asked.floor)
    write_trajectory(asked.out, motion)
    moved, fastest = np.ptp(motion.q, axis=0), np.abs(motion.qd).max(axis=0)
    for i in range(arm.n):
        print(f"joint {i + 1}: moves by {moved[i]:.2f} rad, at most {fastest[i]:.2f} rad/s")
    print(f"condition number {motion.condition:.0f}, {asked.seconds:g} s from home to home: {asked.out}")
    print(
        "Follow it with your robot's joint controller while nothing touches the arm, and log time, q, qd, and torque\n"
        "(measured behind the gears: Franka's tau_J) or command (gravity included), or both; a row a measurement.\n"
        f"Then: {_then(asked)}"
    )


def _then(asked: RecordOptions) -> str:
    """Return the command that takes the log of this robot."""
    words = ["contactsafe", "identify", "LOG"]
    for name in ("robot", "tool", "site"):
        value = getattr(asked, name)
        if value != getattr(RecordOptions, name):
            words += [f"--{name}", str(value)]
    return shlex.join(words)


def _refuse_folder(path: Path) -> None:
    if path.is_dir() or not path.parent.is_dir():
        raise InvalidInputError(f"{path} is no file that can be written; name one in a folder that is there")
