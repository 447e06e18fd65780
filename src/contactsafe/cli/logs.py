"""`contactsafe replay`: what the estimator makes of a robot's log."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.parse import docstring, parse
from contactsafe.results.experiment import to_json
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm

KNOWN = {"panda": robots.panda, "fr3": robots.fr3}
"""Robots by name; any other is the path of an MJCF file."""

WORDS = (
    "Residuals are the external joint torques that the momentum observer finds in the log, thresholds those of the "
    "contact estimator. Force and place are as far as joint torques tell them."
)


@dataclass(frozen=True)
class Options:
    """What can be said of a log.

    Attributes:
        log: a CSV or NPZ file with time, q, and torque or command; qd and wrench_ee where there are any.
        robot: panda, fr3, or the path of an MJCF file.
        tool: what a Franka's flange carries: hand, wiper, or flange for nothing.
        site: end-effector point of an MJCF file.
        columns: names that the log has for something, such as torque=tau_meas.
        rate: of the log's rows, Hz, where it has no time.
        wrench: a log without a wrench is of an arm whose tool touches nothing.
        out: folder for the page.
        json: print JSON instead of text.
    """

    log: Annotated[Path, tyro.conf.Positional]
    robot: str = "panda"
    tool: str = "hand"
    site: str | None = None
    columns: tuple[str, ...] = ()
    rate: float | None = None
    wrench: bool = True
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none is written)")] = None
    json: bool = False


def replay(arguments: Sequence[str]) -> None:
    """Play a robot's log to the contact estimator.

    Says in one line what the log shows, lists what touched the arm, and writes a page with every joint's residual.
    """
    from contactsafe.logs.reading import read_log
    from contactsafe.logs.replay import replay as play
    from contactsafe.logs.results import results_of
    from contactsafe.report import prepare_output, terminal_table, write_report
    from contactsafe.report.data import Words

    asked = parse(Options, "contactsafe replay", arguments, description=docstring(replay))
    arm = _arm(asked.robot, asked.tool, asked.site)
    if asked.rate is not None and not 0.0 < asked.rate < 1e6:
        raise InvalidInputError(f"rate = {asked.rate:g} Hz; give a number greater than 0")
    folder = prepare_output(asked.out) if asked.out else None
    found = results_of(play(read_log(asked.log, _mapped(asked.columns), asked.rate), arm, wrench=asked.wrench))
    if folder is not None:
        words = Words(f"contactsafe: {asked.log.name}", f"What touched the {arm.name}", found.question, WORDS)
        command = shlex.join(["contactsafe", "replay", *arguments])
        page = write_report(folder, [found], {"command": command}, words)
        print(f"report: {page}", file=sys.stderr)
    print(to_json(found.as_dict()) if asked.json else f"{terminal_table([found])}\n{found.question}")


def _mapped(columns: tuple[str, ...]) -> dict[str, str]:
    pairs = [text.partition("=") for text in columns]
    for text, (name, equals, column) in zip(columns, pairs, strict=True):
        if not (name and equals and column):
            raise InvalidInputError(f"columns = {shown(text)} maps nothing; write what is held=its name in the log")
    return {name: column for name, _, column in pairs}


def _arm(robot: str, tool: str, site: str | None) -> Arm:
    if robot in KNOWN:
        if site is not None:
            raise InvalidInputError(f"site = {shown(site)} is for an MJCF file; leave it out for {robot}")
        return KNOWN[robot](tool)
    path = Path(robot)
    if not path.exists():
        raise InvalidInputError(f"robot {shown(robot)} is neither {', '.join(KNOWN)} nor a file; give its MJCF")
    if site is None:
        raise InvalidInputError(f"{path.name} has end-effector points of its own; say which, --site NAME")
    return robots.from_mjcf(str(path), site)
