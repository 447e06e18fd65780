"""`contactsafe replay`: what the estimator makes of a robot's log; and what all commands on logs can be told."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from contactsafe.cli.arms import CalibrationFile, arm_of
from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.parse import docstring, parse
from contactsafe.logs.log import Log
from contactsafe.results.experiment import Experiment, to_json
from contactsafe.robot.arm import Arm

WORDS = (
    "Residuals are the external joint torques that the momentum observer finds in the log, thresholds those of the "
    "contact estimator. Force and place are as far as joint torques tell them."
)


@dataclass(frozen=True)
class LogOptions:
    """What can be said of a log.

    Attributes:
        log: a CSV, NPZ or MCAP file with time, q, and torque or command; qd, wrench_ee and wrench_base where there
            are any.
        robot: panda, fr3, or the path of an MJCF or URDF file.
        tool: what a Franka's flange carries: hand, wiper, or flange for nothing.
        site: end-effector point of an MJCF file, or link of a URDF file.
        columns: names that the log has for something, such as torque=tau_meas.
        rate: of the log's rows, Hz, where it has no time, or not the one at which they were measured.
        topic: of an MCAP's joint states, where several topics have some.
        joints: names that an MCAP has for the arm's joints, from base to tip, where they are not the arm's own.
        out: folder for the page.
        json: print JSON instead of text.
    """

    log: Annotated[Path, tyro.conf.Positional]
    robot: str = "panda"
    tool: str = "hand"
    site: str | None = None
    columns: tuple[str, ...] = ()
    rate: float | None = None
    topic: str | None = None
    joints: tuple[str, ...] = ()
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none is written)")] = None
    json: bool = False

    def read(self, arm: Arm) -> Log:
        """Read the log of an arm.

        Raises:
            InvalidInputError: it is none; see `read_log`.
        """
        from contactsafe.logs.reading import read_log

        if self.rate is not None and not 0.0 < self.rate < 1e6:
            raise InvalidInputError(f"rate = {self.rate:g} Hz; give a number greater than 0")
        names = self.joints or tuple(arm.model.joint(i).name for i in range(arm.n))
        return read_log(self.log, _mapped(self.columns), self.rate, self.topic, names)


@dataclass(frozen=True)
class Options(LogOptions):
    """What can be said of a replay.

    Attributes:
        wrench: a log without a wrench is of an arm whose tool touches nothing.
        calibration: what `contactsafe identify` wrote of this robot.
        torques: of a log of `contactsafe run`, compute every torque again and compare it bit by bit; nothing else.
    """

    wrench: bool = True
    calibration: CalibrationFile = None
    torques: bool = False


def replay(arguments: Sequence[str]) -> None:
    """Play a robot's log to the contact estimator.

    Says in one line what the log shows, lists what touched the arm, and writes a page with every joint's residual.
    """
    from contactsafe.logs.replay import replay as play
    from contactsafe.logs.results import results_of
    from contactsafe.report import prepare_output

    asked = parse(Options, "contactsafe replay", arguments, description=docstring(replay))
    if asked.torques:
        _compare_torques(asked)
        return
    arm = arm_of(asked.robot, asked.tool, asked.site, asked.calibration)
    log = asked.read(arm)
    folder = prepare_output(asked.out) if asked.out else None
    found = results_of(play(log, arm, wrench=asked.wrench))
    command = shlex.join(["contactsafe", "replay", *arguments])
    tell(found, asked, folder, command, (f"What touched the {arm.name}", WORDS))


def _compare_torques(asked: Options) -> None:
    """Compute the torques of a run again; fail where any differs."""
    from contactsafe.hardware.run_log import is_run
    from contactsafe.logs.robot_run import torques_again

    if not asked.log.is_file():
        raise InvalidInputError(f"{asked.log} does not exist; give the run.mcap of a `contactsafe run`")
    if not is_run(asked.log):
        raise InvalidInputError(f"{asked.log} is no log of `contactsafe run`; give its run.mcap")
    again = torques_again(asked.log)
    if again.same < again.ticks:
        raise InvalidInputError(
            f"{again.verdict}; this machine or this version computes otherwise than the one it ran on"
        )
    print(again.verdict)


def tell(found: Experiment, asked: LogOptions, folder: Path | None, command: str, words: tuple[str, str]) -> None:
    """Print what was found in a log, and write its page where a folder was asked for.

    Args:
        found: results.
        asked: options.
        folder: for the page, None for none.
        command: that found it.
        words: title of the page, and how to read it.
    """
    from contactsafe.report import terminal_table, write_report
    from contactsafe.report.data import Words

    if folder is not None:
        said = Words(f"contactsafe: {asked.log.name}", words[0], found.question, words[1])
        page = write_report(folder, [found], {"command": command}, said)
        print(f"report: {page}", file=sys.stderr)
    print(to_json(found.as_dict()) if asked.json else f"{terminal_table([found])}\n{found.question}")


def _mapped(columns: tuple[str, ...]) -> dict[str, str]:
    pairs = [text.partition("=") for text in columns]
    for text, (name, equals, column) in zip(columns, pairs, strict=True):
        if not (name and equals and column):
            raise InvalidInputError(f"columns = {shown(text)} maps nothing; write what is held=its name in the log")
    return {name: column for name, _, column in pairs}
