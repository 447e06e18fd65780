"""Any arm: models as people download them, each put through the same under every controller."""

import math
from collections.abc import Sequence

import numpy as np

from contactsafe.control import presets
from contactsafe.core.errors import ContactSafeError, InvalidInputError
from contactsafe.experiments.any_arm_tables import compared, model_rows, model_table
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.robot_trials import swept_sphere, trial
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.metrics import ZERO, Aim, Metric
from contactsafe.results.recording import Portrait, Stage, level_rectangle
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.model_arms import ModelArm, load_model
from contactsafe.sim.model_scenes import SPHERE_M

NAME = "robots"
QUESTION = (
    "An arm out of a model file holds still, moves its tool by 10 cm, is pushed amid the arm, and runs into a sphere: "
    "is it stable, does it arrive, and is it gentle?"
)
WITH_WRENCH, WITHOUT = "with wrench", "without wrench"

METRICS = (
    Metric("hold_mm", "tool off while it holds, most", "mm", main=True, aim=Aim(at_most=1.0, always=True)),
    Metric("move_mm", "tool off at the end of a move", "mm", main=True, aim=Aim(at_most=2.0, always=True)),
    Metric("pushed_mm", "tool moved by a push amid the arm", "mm", main=True, aim=Aim(ratio_at_most=1 / 3)),
    Metric("pushed_further", "moved further than under the baseline", main=True, aim=ZERO),
    Metric("fixed_peak_n", "fixed sphere in its path: force, peak", "N", main=True),
    Metric("fixed_steady_n", "the same, steady", "N"),
    Metric("sprung_peak_n", "sphere on springs: force, peak", "N", main=True),
    Metric("sprung_steady_n", "the same, steady", "N", main=True),
    Metric("peak_regression", "a larger force than under the baseline", main=True, aim=ZERO),
    Metric("false_contact", "contact reported where there is none, part of the time", main=True, aim=ZERO),
    Metric("joint_speed_peak_rad_s", "joint speed, peak", "rad/s"),
    Metric("not_finite", "numbers that are not finite", main=True, aim=ZERO),
)


def any_arm(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the battery on the models of a configuration; it needs no policy.

    Args:
        config: controllers and models.
        progress: told of every trial done.

    Raises:
        InvalidInputError: no model is given, or none of them can be driven.
    """
    if not config.models:
        raise InvalidInputError("no model given; give --models with paths of MJCF or URDF files, PATH or PATH:TOOL")
    trials, rows, portraits = list[Trial](), list[tuple[str | float, ...]](), list[Portrait]()
    for number, place in enumerate(config.models):
        try:
            of = load_model(place)
            centre = swept_sphere(of, presets.vices())
            found = _trials(of, number, config.controllers, centre)
            portraits.append(_portrait(of, centre))
        except (ContactSafeError, ValueError) as error:
            rows.append((place, math.nan, "", "", *6 * ("",), f"refused: {error}"))
        else:
            trials += found
            rows += model_rows(of, found)
        if progress:
            progress(2 * len(config.controllers))
    if not trials:
        raise InvalidInputError("; ".join(str(row[-1]) for row in rows))
    return Experiment(
        NAME, "Any arm", QUESTION, compared(trials), METRICS, tables=(model_table(rows),), portraits=tuple(portraits)
    )


ENTRY = Entry(
    NAME,
    "arms of model files hold, move, are pushed, run into a sphere.",
    any_arm,
    count=lambda config: 2 * len(config.models) * len(config.controllers),
    takes=("models",),
)


def _trials(of: ModelArm, number: int, controllers: Sequence[str], centre: np.ndarray | None) -> list[Trial]:
    return [
        Trial(scenario, name, number, trial(of, presets.by_name(name), scenario == WITH_WRENCH, centre))
        for scenario in (WITH_WRENCH, WITHOUT)
        for name in controllers
    ]


def _portrait(of: ModelArm, centre: np.ndarray | None) -> Portrait:
    """Draw an arm at home, and the sphere that it meets."""
    description, tool = description_and_tool(of.arm)
    starts, ends, radii, _ = arm_capsules(description, tool, of.arm.home[None])
    lowest = min(float((ends_at[0, :, 2] - radii).min()) for ends_at in (starts, ends))
    x, y = (float(value) for value in of.arm.model.body_pos[1][:2])
    stage = Stage(description, tool, level_rectangle((x, y, lowest), (1.2, 1.2)))
    return Portrait(f"{of.name}: {of.arm.n} joints", stage, of.arm.home, centre, SPHERE_M)
