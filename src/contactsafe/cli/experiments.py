"""`contactsafe demo` and `contactsafe experiment`."""

import datetime
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, get_args

import tyro

from contactsafe.cli.arms import CalibrationFile, load_calibration
from contactsafe.cli.common import BundleFolder, Controllers, TaskName, described, load_bundle, progress
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import docstring, one_of, parse, some_of
from contactsafe.experiments import registry
from contactsafe.experiments.config import PLANTS, Entry, ExperimentConfig, Taken
from contactsafe.experiments.sensors import sensors_words
from contactsafe.experiments.task import ExperimentTask
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.manifest import MANIFEST, digest
from contactsafe.results.experiment import Experiment, to_json
from contactsafe.robot import robots
from contactsafe.robot.calibrated import arm_for
from contactsafe.robot.calibration import Calibration
from contactsafe.sim.config import SENSORS
from contactsafe.tasks import DEFAULT_TASK, task_by_name
from contactsafe.tasks.base.registry import place_of

_MODELS = tyro.conf.arg(metavar="PATH[:TOOL]...", help_behavior_hint="(of robots alone)")


def _usual_trials() -> str:
    by_number: dict[int, list[str]] = {}
    for name, entry in registry.ENTRIES.items():
        by_number.setdefault(entry.trials, []).append(name)
    return "; ".join(f"{number} for {', '.join(names)}" for number, names in by_number.items())


def demo(
    out: Path = Path("contactsafe-demo"),
    trials: int = 10,
    seed: int = 0,
    controllers: Controllers = ExperimentConfig.controllers,
    bundle: BundleFolder = None,
    task: TaskName = DEFAULT_TASK,
    calibration: CalibrationFile = None,
) -> None:
    """Run the paper's three experiments and write a page about them.

    Args:
        out: folder for report.html, summary.json and the trials as CSV.
        trials: seeds tried with each controller.
        seed: first seed.
        controllers: presets to compare.
        bundle: folder of another policy.
        task: what the policy does.
        calibration: what `contactsafe identify` wrote of the robot.
    """
    from contactsafe.report import prepare_output, terminal_table, write_report

    loaded = load_bundle(bundle, task)
    scenes = scenes_of(task, loaded, load_calibration(calibration))
    config = ExperimentConfig(controllers, trials, seed, task=scenes, bundle=loaded)
    folder = prepare_output(out)
    started = time.monotonic()
    results = _run(registry.PAPER, config)
    info = _run_info(_command("demo", config, task, bundle, calibration), config, time.monotonic() - started)
    print(terminal_table(results))
    page = write_report(folder, results, info)
    print(f"\nreport:  {page}\nsummary: {page.with_name('summary.json')}")


@dataclass(frozen=True)
class Options:
    """What can be asked of an experiment.

    Attributes:
        name: what to run.
        controllers: presets to compare.
        trials: seeds tried with each controller.
        seed: first seed.
        plants: collisions with an arm and sensors that have errors (real), without any (clean), or both side by side.
        sensors: of an arm that has errors: encoders of 19 bit alone, or a Franka's torque sensors and noisy velocity.
        minutes: simulated time in which detection counts false alarms.
        models: arms of model files, each PATH of an MJCF, or PATH:TOOL with a site, body or URDF link.
        out: folder for report.html, summary.json and the trials as NAME.csv.
        json: print tables, spreads and trials as JSON instead of text.
        bundle: folder of another policy.
        task: what the policy does.
        calibration: what `contactsafe identify` wrote of the robot.
    """

    name: Annotated[str, one_of(registry.ENTRIES), tyro.conf.Positional]
    controllers: Controllers = ExperimentConfig.controllers
    trials: Annotated[int | None, tyro.conf.arg(help_behavior_hint=f"(default: {_usual_trials()})")] = None
    seed: int = 0
    plants: Annotated[tuple[str, ...], some_of(PLANTS)] = PLANTS
    sensors: Annotated[str, one_of(SENSORS)] = ExperimentConfig.sensors
    minutes: float = ExperimentConfig.minutes
    models: Annotated[tuple[str, ...], _MODELS] = ()
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none is written)")] = None
    json: bool = False
    bundle: BundleFolder = None
    task: TaskName = DEFAULT_TASK
    calibration: CalibrationFile = None


def experiment(arguments: Sequence[str]) -> None:
    """Run one of the experiments.

      EXPERIMENTS

    The first two run a policy, the first three a task; the others drive an arm by scripts. A trial depends on its own
    seed alone: `--seed 17 --trials 1 --out DIR` runs trial 17 of any batch once more and draws it.
    """
    from contactsafe.report import prepare_output, terminal_table, write_report
    from contactsafe.report.summary import summarise

    asked = parse(Options, "contactsafe experiment", arguments, description=docstring(experiment))
    entry = registry.by_name(asked.name)
    config = _config(asked, entry)
    folder = prepare_output(asked.out) if asked.out else None
    started = time.monotonic()
    results = _run([asked.name], config)
    command = _command(f"experiment {asked.name}", config, asked.task, asked.bundle, asked.calibration)
    info = _run_info(command, config, time.monotonic() - started)
    page = write_report(folder, results, info) if folder else None
    print(to_json(summarise(results, info)) if asked.json else terminal_table(results))
    if page:
        print(f"report: {page}", file=sys.stderr)


def _config(asked: Options, entry: Entry) -> ExperimentConfig:
    """Return the configuration of an experiment as it was asked for, with the task and the policy that it takes.

    Raises:
        InvalidInputError: something was asked for that it does not take.
    """
    usual = {field.name: field.default for field in fields(Options)}
    unread = [
        f"--{name}" for name in get_args(Taken) if name not in entry.takes and getattr(asked, name) != usual[name]
    ]
    if unread:
        raise InvalidInputError(f"experiment {entry.name} takes no {' and no '.join(unread)}; leave that out")
    trials = entry.trials if asked.trials is None else asked.trials
    bundle = load_bundle(asked.bundle, asked.task) if "bundle" in entry.takes else None
    known = load_calibration(asked.calibration)
    scenes = scenes_of(asked.task, bundle, known) if "task" in entry.takes else None
    return ExperimentConfig(
        asked.controllers,
        trials,
        asked.seed,
        asked.plants,
        asked.sensors,
        asked.minutes,
        asked.models,
        scenes,
        bundle,
        arm_for(known, robots.panda),
        None if asked.calibration is None else ("--calibration", str(asked.calibration)),
    )


experiment.__doc__ = docstring(experiment).replace(
    "  EXPERIMENTS", "\n".join(f"  {entry.name:14s}{entry.about}" for entry in registry.ENTRIES.values())
)


def scenes_of(task: str, bundle: Bundle | None = None, known: Calibration | None = None) -> ExperimentTask:
    """Return what the experiments ask of a task, under the conditions of the policy that does it.

    Raises:
        InvalidInputError: no task has this name, or it has nothing for them.
    """
    described = task_by_name(task)
    if described.scenes is None:
        raise InvalidInputError(f"task '{task}' has no scenes for experiments; see docs/howto/own_task.md")
    config = described.config(None, None if bundle is None else bundle.conditions)
    return described.scenes(config) if known is None else described.scenes(config, known)


def _run(names: Sequence[str], config: ExperimentConfig) -> list[Experiment]:
    entries = {name: registry.by_name(name) for name in names}
    results = []
    with progress(names[0], sum(entry.count(config) for entry in entries.values())) as bar:
        for name, entry in entries.items():
            bar.set_description_str(described(name))
            results.append(entry.run(config, bar.update))
    return results


def _command(
    name: str, config: ExperimentConfig, task: str, bundle: Path | None, calibration: Path | None = None
) -> str:
    """Return a command that runs a configuration again; it names what is not the default."""
    words = ["contactsafe", *name.split(), "--trials", f"{config.trials}", "--seed", f"{config.seed}"]
    words += ["--controllers", ",".join(config.controllers)]
    if task != DEFAULT_TASK:
        words += ["--task", place_of(task)]
    if bundle is not None:
        words += ["--bundle", str(bundle)]
    if calibration is not None:
        words += ["--calibration", str(calibration)]
    if config.plants != ExperimentConfig.plants:
        words += ["--plants", ",".join(config.plants)]
    words += sensors_words(config.sensors)
    if config.minutes != ExperimentConfig.minutes:
        words += ["--minutes", f"{config.minutes:g}"]
    if config.models:
        words += ["--models", *config.models]
    return shlex.join(words)


def _run_info(command: str, config: ExperimentConfig, seconds: float) -> dict:
    info = {
        "command": command,
        "when": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "seeds": list(config.seeds),
        "seconds": round(seconds, 1),
    }
    if config.bundle is not None:
        info["bundle_sha256"] = digest((Path(config.bundle.folder) / MANIFEST).read_bytes())
    return info
