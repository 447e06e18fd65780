"""`contactsafe run`: a policy on a Franka, or on a simulated one over the robot's own network protocol."""

import contextlib
import shlex
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from contactsafe.cli.arms import CalibrationFile
from contactsafe.cli.common import BundleFolder, TaskName, load_bundle, task_of
from contactsafe.control import presets
from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import docstring, one_of, parse
from contactsafe.core.rotation import quat_to_matrix
from contactsafe.experiments.robot_run import RobotRun, robot_runs
from contactsafe.hardware.control_loop import ControlSettings
from contactsafe.hardware.control_process import control
from contactsafe.hardware.crew import Part, run_crew
from contactsafe.hardware.ending import Ending
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.franka_port import FrankaPort
from contactsafe.hardware.panda_port import PandaPort
from contactsafe.hardware.realtime import Realtime
from contactsafe.hardware.recorder import record
from contactsafe.hardware.states import REASONS, STATES
from contactsafe.hardware.watchdog import watch
from contactsafe.policy.actor import PolicySettings
from contactsafe.policy.robot_process import act_on_robot
from contactsafe.policy.work import Work
from contactsafe.report import terminal_table, write_report
from contactsafe.report.data import Words
from contactsafe.report.summary import summarise
from contactsafe.results.experiment import to_json
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.description import Tool
from contactsafe.robot.franka import HAND
from contactsafe.sim.franka_process import SimulatedRobot
from contactsafe.tasks import DEFAULT_TASK, task_by_name

LOG, TRUTH = "run.mcap", "truth.npy"

ARMS: Mapping[str, tuple[Callable[[Tool], Arm], type[FrankaPort]]] = {
    "fr3": (robots.fr3, FrankaPort),
    "panda": (robots.panda, PandaPort),
}
"""Robots by name, with what reaches them."""

_LEAST_KG = 1e-3
"""A lighter load is none."""

WORDS = Words(
    "contactsafe: a run over the robot's protocol",
    "A policy at work on a simulated Franka",
    "Control loop, policy, recorder and watchdog each ran in a process of their own, against a simulated robot that "
    "speaks a Franka's own network protocol. The forces shown really acted; none of them was measured.",
    "The robot is franky-sim's FR3; joint torque is measured behind the gears, most of the friction there taken off.",
)


@dataclass(frozen=True)
class Options:
    """What can be asked of a run.

    Attributes:
        policy: folder of the policy's bundle.
        task: what it does.
        robot: address of the Franka's control.
        arm: fr3, or panda for the older one, whose port nobody has tried on a robot.
        simulated: run against a simulated Franka on this machine, over the robot's own protocol.
        seconds: that the run takes at most.
        controller: preset underneath.
        against: preset of a second simulated run, to compare with; none for no second run.
        rounds: of work, such as boards, after which a simulated run ends.
        speed: factor on how fast the target moves, 0.05 to 1.
        hold: go to where the work begins and stay there; the policy is not asked.
        camera: serial number of the RealSense; the first one found where it is not given.
        recover: acknowledge the error that stopped the robot before; look at what stopped it first.
        dry_run: look at the robot, tell it load and collision thresholds, print the checklist, move nothing.
        yes: do not ask before the robot moves.
        alone: nothing pushes or meets the simulated arm.
        lockstep: the simulated robot waits for each command, so that a run is the same again, however slow the machine.
        seed: of what is drawn, of light and of noise.
        out: folder for log and page.
        calibration: what `contactsafe identify` wrote of the robot.
        camera_calibration: what `contactsafe calibrate` wrote; without it the camera stands where training had it.
        priority: of the control process under SCHED_FIFO; 0 for none.
        json: print JSON instead of a table.
    """

    policy: Annotated[BundleFolder, tyro.conf.Positional] = None
    task: TaskName = DEFAULT_TASK
    robot: str | None = None
    arm: Annotated[str, one_of(ARMS)] = "fr3"
    simulated: bool = False
    seconds: float = 60.0
    controller: Annotated[str, one_of(presets.PRESETS, presets.by_name, presets.FORM)] = "safe"
    against: Annotated[str, one_of(("none", *presets.PRESETS), also=presets.FORM)] = "vices"
    rounds: int = 3
    speed: float = 1.0
    hold: bool = False
    camera: str | None = None
    recover: bool = False
    dry_run: bool = False
    yes: bool = False
    alone: bool = False
    lockstep: bool = False
    seed: int = 0
    out: Path = Path("runs/robot")
    calibration: CalibrationFile = None
    camera_calibration: CalibrationFile = None
    priority: int = 80
    json: bool = False

    def check(self) -> None:
        """Refuse what cannot be."""
        if self.simulated == (self.robot is not None):
            given = "both are" if self.simulated else "neither is"
            raise InvalidInputError(f"give --robot ADDRESS for a Franka, or --simulated for one here; {given} given")
        if not 1.0 <= self.seconds <= 86400.0:
            raise InvalidInputError(f"seconds = {self.seconds}; give 1 to 86400")
        if not 0.05 <= self.speed <= 1.0:
            raise InvalidInputError(f"speed = {self.speed}; give 0.05 to 1")
        if not 1 <= self.rounds <= 60:
            raise InvalidInputError(f"rounds = {self.rounds}; give 1 to 60")
        if not 0 <= self.priority <= 99:
            raise InvalidInputError(f"priority = {self.priority}; give 1 to 99, or 0 for none")
        if self.simulated and (self.dry_run or self.recover):
            raise InvalidInputError("dry_run and recover are for real robots; a simulated one may move")
        if self.simulated and self.arm != "fr3":
            raise InvalidInputError(f"arm = {self.arm}: the simulated robot is an fr3; leave that out")
        if self.robot is not None and self.lockstep:
            raise InvalidInputError("lockstep is for simulated robots; a real one does not wait")


def run(arguments: Sequence[str]) -> None:
    """Let a policy work on a Franka, gently, with all that a real robot needs around it.

    The control loop, the policy, a flight recorder and a watchdog each have a process of their own. With --simulated
    the same processes run against a simulated Franka that speaks the robot's own protocol on this machine, while the
    arm is pushed and meets a bottle.
    """
    asked = parse(Options, "contactsafe run", arguments, description=docstring(run))
    asked.check()
    looks = looks_of(asked)
    described = task_by_name(task_of(arguments))
    if described.robot is None:
        raise InvalidInputError(f"task '{described.name}' says nothing of real robots; see docs/howto/own_task.md")
    bundle = load_bundle(asked.policy, described.name)
    task = described.robot()
    arm = ARMS[asked.arm][0](task.tool)
    if asked.calibration is not None:
        arm = robots.calibrated(arm, asked.calibration)
    asked.out.mkdir(parents=True, exist_ok=True)
    if not asked.simulated:
        from contactsafe.cli.real_robot import run_real

        run_real(asked, task.work(**looks), arm, bundle)
        return
    names = [asked.controller] + ([] if asked.against == "none" else [asked.against])
    runs = [_simulated(asked, task, arm, bundle.folder, name, looks) for name in dict.fromkeys(names)]
    _show(asked, runs, shlex.join(["contactsafe", "run", *arguments]))


def looks_of(asked: Options) -> dict[str, Any]:
    """Return what the task looks with.

    Raises:
        InvalidInputError: the file is no calibration of a camera.
    """
    looks: dict[str, Any] = {"camera": asked.camera}
    if asked.camera_calibration is not None:
        from contactsafe.vision.camera_calibration import CameraCalibration

        looks["camera_calibration"] = CameraCalibration.load(asked.camera_calibration)
    return looks


def _simulated(asked: Options, task: Any, arm: Arm, bundle: Path, controller: str, looks: dict[str, Any]) -> RobotRun:
    """Run once against the simulated robot."""
    folder = asked.out / controller.replace(":", "-")
    folder.mkdir(parents=True, exist_ok=True)
    exchange = Exchange.create(arm.n)
    with contextlib.ExitStack() as left:
        left.callback(exchange.unlink)
        exchange.status["lockstep"] = asked.lockstep
        simulated = task.simulated(arm, exchange.path, asked.seed, asked.rounds, not asked.alone, **looks)
        left.callback(simulated.close)
        with SimulatedRobot(simulated.scene, arm.home, asked.lockstep, simulated.effect, folder / TRUTH) as robot:
            said = said_of(asked, controller) | {"seed": str(asked.seed)}
            parts = parts_of(asked, arm, bundle, simulated.work, controller, robot.address, folder / LOG, said)
            ending = run_crew(exchange, parts, asked.seconds, StatusLine())
        truth = np.load(folder / TRUTH)
        return RobotRun(controller, truth, ending, simulated.figures(truth), bool(simulated.scene.pushes))


def said_of(asked: Options, controller: str) -> dict[str, str]:
    """Return what a log says of its run: all that is needed to compute its torques again."""
    files = {"calibration": asked.calibration, "camera_calibration": asked.camera_calibration}
    calibrated = {name: str(path.resolve()) for name, path in files.items() if path is not None}
    return {"robot": asked.arm, "task": asked.task, "controller": controller, **calibrated}


def parts_of(
    asked: Options, arm: Arm, bundle: Path, work: Work, controller: str, address: str, log: Path, said: dict[str, str]
) -> list[Part]:
    """Return the processes of a run."""
    rights = Realtime(0 if asked.lockstep else asked.priority)
    port = ARMS[asked.arm][1](address, load_of(arm))
    settings = ControlSettings(arm, presets.by_name(controller), port, asked.lockstep, rights)
    rounds = asked.rounds if asked.simulated else 0
    policy = PolicySettings(arm, bundle, work, asked.speed, asked.lockstep, rounds, asked.hold)
    return [
        Part("watchdog", watch),
        Part("recorder", record, (log, said)),
        Part("control", control, (settings,)),
        Part("policy", act_on_robot, (policy,)),
    ]


def load_of(arm: Arm) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Return what the tool adds to the hand that the robot's own settings know, None for nothing.

    Returns:
        Mass, kg, its centre, (3,), m, and inertia about that, (3, 3), kg m², both in the flange's frame.
    """
    description, tool = description_and_tool(arm)
    if tool.inertia.mass - HAND.inertia.mass <= _LEAST_KG:
        return None
    load, R = tool.inertia - HAND.inertia, quat_to_matrix(np.array(description.mount_quat))
    return load.mass, R @ np.array(load.com), R @ load.matrix() @ R.T


class StatusLine(Unique):
    """One line on a terminal that says how a run goes; elsewhere a line every five seconds."""

    _why = "a status line belongs to one terminal; make another one"

    def __init__(self) -> None:
        self._live, self._last = sys.stderr.isatty(), 0.0

    def __call__(self, status: np.void) -> None:
        """Say it."""
        now = time.monotonic()
        if now - self._last < (0.2 if self._live else 5.0):
            return
        self._last = now
        state = STATES[int(status["state"])]
        reason = f" ({REASONS[int(status['reason'])].name})" if status["reason"] else ""
        contact = (
            f"link {status['contact_link']} {status['contact_n']:.0f} N, {status['contact_nm']:.0f} N m"
            if status["contact_link"]
            else "none"
        )
        counts = np.cumsum(status["busy"])
        busy = int(np.searchsorted(counts, 0.99 * counts[-1])) if counts[-1] else 0
        line = (
            f"{status['tick'] / 1000:6.1f} s  {state}{reason}  contact {contact}  tool {status['tool_n']:.0f} N  "
            f"target {status['target_age']} ms old  busy {busy} µs  lost {status['lost']}  refused {status['refused']}"
        )
        print(f"\r{line:110s}" if self._live else line, end="" if self._live else "\n", file=sys.stderr, flush=True)


def _show(asked: Options, runs: Sequence[RobotRun], command: str) -> None:
    """Print the figures, write the page, and fail where a run did not end as it should."""
    results, info = [robot_runs(runs, asked.seed)], {"seeds": [asked.seed], "command": command}
    page = write_report(asked.out, results, info, WORDS)
    print(to_json(summarise(results, info)) if asked.json else terminal_table(results))
    print(f"report: {page}", file=sys.stderr)
    for one in runs:
        refuse_failed(one.ending, one.controller)


def refuse_failed(ending: Ending, name: str) -> None:
    """Say why a run did not end as it should.

    Raises:
        InvalidInputError: it did not.
    """
    if not ending.went_well:
        raise InvalidInputError(f"the run under {name} ended {ending.state}: {ending.reason}; {ending.remedy}")
