"""`contactsafe evaluate`: a policy on episodes it was never trained on, with the options of its task."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from contactsafe.cli.arms import CalibrationFile, load_calibration
from contactsafe.cli.common import BundleFolder, TaskName, load_bundle, progress, task_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import docstring, one_of, parse
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.conditions import Conditions
from contactsafe.policy.policy import Policy
from contactsafe.results.experiment import to_json
from contactsafe.tasks import DEFAULT_TASK, ENGINES, make_vec, task_by_name
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED, evaluate_policy, figures_of, side_by_side
from contactsafe.tasks.base.figures import names
from contactsafe.tasks.base.task import Task

_MOST_SIDE_BY_SIDE = {"pybullet": 2}
"""Environments at a time: PyBullet's run one after the other, and those that are done go on until the last is."""


@dataclass(frozen=True)
class Options:
    """What can be asked of any task.

    Attributes:
        bundle: folder of the policy.
        task: what the policy does.
        episodes: how many.
        seed: of episodes and noise.
        json: print JSON instead of a table.
        calibration: what `contactsafe identify` wrote of the robot.
    """

    bundle: Annotated[BundleFolder, tyro.conf.Positional] = None
    task: TaskName = DEFAULT_TASK
    episodes: int = 50
    seed: int = 0
    json: bool = False
    calibration: CalibrationFile = None

    def check(self) -> None:
        """Refuse numbers that cannot be."""
        if self.episodes < 1:
            raise InvalidInputError(f"episodes = {self.episodes}; give 1 or more")
        if self.seed < 0:
            raise InvalidInputError(f"seed = {self.seed}; give 0 or more")


def evaluate(arguments: Sequence[str]) -> None:
    """Let a policy do its task in episodes it has never seen.

    Reports success, forces and times. For one seed and number of episodes all policies and controllers meet the same.
    The options from --controller on are those of the task.
    """
    described = task_by_name(task_of(arguments))
    asked = parse(_options_of(described), "contactsafe evaluate", arguments, description=docstring(evaluate))
    asked.check()
    if asked.scripted is not None and asked.bundle is not None:
        raise InvalidInputError(f"a bundle and --scripted {asked.scripted} are both given; name one")
    bundle = None if asked.scripted else load_bundle(asked.bundle, described.name)
    config = described.config(asked, None if bundle is None else bundle.conditions)
    most = _MOST_SIDE_BY_SIDE.get(asked.engine, 16)
    known = load_calibration(asked.calibration)
    others: dict[str, Any] = {} if known is None else {"arm": known}
    env = make_vec(described.name, side_by_side(asked.episodes, most), config, asked.engine, **others)
    if bundle is None:
        policy = described.scripted_policy(asked.scripted, config, env, asked.seed)
    else:
        policy = Policy(bundle, getattr(env.unwrapped, "camera_homography", None))
    with progress("episodes", asked.episodes) as bar:
        seed = HELD_OUT_SEED + asked.seed
        results = evaluate_policy(policy, env, asked.episodes, seed, on_episode=lambda record: bar.update())
    env.close()
    _show(asked, _conditions(config, bundle), results, names(figures_of(env)), _own_options(described))


def _options_of(task: Task) -> type:
    """Make the dataclass of all options that there are for a task."""
    said = tyro.conf.arg(help="a scripted policy in place of the learned one.", help_behavior_hint="(default: none)")
    computes = tyro.conf.arg(help="what computes the physics.")
    return dataclasses.make_dataclass(
        "Evaluation",
        [
            ("engine", Annotated[str, one_of(ENGINES), computes], ENGINES[0]),
            ("scripted", Annotated[str | None, one_of(task.scripted), said], None),
        ],
        bases=(task.options, Options),
        frozen=True,
    )


def _own_options(task: Task) -> list[str]:
    """Return the names of the options that describe the task, all but the controller, which stands alone."""
    own = [field.name for field in dataclasses.fields(task.options) if field.name != "controller"]
    return [*own, "engine"]


def _conditions(config: TaskConfig, bundle: Bundle | None) -> dict[str, Any]:
    """Return under what the episodes ran: the controller, and what else of a policy's conditions is not the default."""
    gains = {} if config.action.gains == Conditions.gains else {"gains": config.action.gains}
    as_paper = {"as_paper": True} if bundle is not None and bundle.conditions.as_paper else {}
    return {"controller": config.controller, **gains, **as_paper}


def _show(asked: Any, conditions: dict[str, Any], results: dict[str, Any], meaning: Any, own: list[str]) -> None:
    records = results.pop("records")
    task = {name: getattr(asked, name) for name in own}
    said = {
        "task": asked.task,
        "policy": asked.scripted or str(asked.bundle or "shipped"),
        "seed": asked.seed,
        **({} if asked.calibration is None else {"calibration": str(asked.calibration)}),
        **conditions,
    }
    if asked.json:
        print(to_json({**results, **said, "options": task, "records": records}))
        return
    print(", ".join(f"{name} {value}" for name, value in {**said, **task}.items()))
    for key, value in results.items():
        print(f"{key:24s}{value:>10{'d' if isinstance(value, int) else '.4g'}}  {meaning[key]}")
