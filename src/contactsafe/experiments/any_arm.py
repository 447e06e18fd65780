"""Any arm: models as people download them, each put through the same under every controller."""

import math
import warnings
from collections.abc import Mapping, Sequence

import numpy as np

from contactsafe.control import presets
from contactsafe.core.errors import ContactSafeError, InvalidInputError, ModelWarning
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.robot_trials import HOLD_S, MOVE_S, PUSH_S, SETTLE_S, SPRING_N_M, swept_sphere, trial
from contactsafe.results.experiment import Experiment, Table, Trial
from contactsafe.results.metrics import BASELINE, ZERO, Aim, Metric
from contactsafe.results.recording import Portrait, Stage, level_rectangle
from contactsafe.sim.model_scenes import MOVES_M, SPHERE_M, ModelArm, load_model

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
    Metric("harder", "pressed harder than under the baseline", main=True, aim=ZERO),
    Metric("false_contact", "contact reported where there is none, part of the time", main=True, aim=ZERO),
    Metric("joint_speed_peak_rad_s", "joint speed, peak", "rad/s"),
    Metric("joint_speed_of_limit", "the same, of the joint's limit", aim=Aim(at_most=1.0, always=True)),
    Metric("finite", "all numbers finite", aim=Aim(at_least=1.0)),
)

FURTHER_MM, FURTHER = 2.0, 1.2
HARDER_N, HARDER = 5.0, 1.05
"""A trial is worse than the baseline's by both: so much, and this multiple."""

NOTE = (
    f"Hold: {HOLD_S:g} s. Move: {1000 * MOVES_M:g} mm in {MOVE_S:g} s along an axis of the world, {SETTLE_S:g} s "
    f"later. Push: 25 N for {PUSH_S:g} s on the middle of the arm, or a tenth of what it can hold. Sphere: of "
    f"{SPHERE_M:g} m in the path of the arm's outer half, fixed or on springs of {SPRING_N_M:g} N/m; peak / steady. "
    "With a wrench the "
    "controller is told that nothing touches the tool. '-': the joints do not allow it, or nothing of the arm meets "
    f"anything. Further: by {FURTHER_MM:g} mm and {100 * (FURTHER - 1):.0f} %; harder: by {HARDER_N:g} N and "
    f"{100 * (HARDER - 1):.0f} %."
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
            of, centre = _loaded(place)
        except (ContactSafeError, ValueError) as error:
            rows.append((place, math.nan, "", "", *6 * ("",), f"not loaded: {error}"))
            if progress:
                progress(2 * len(config.controllers))
            continue
        found = _trials(of, number, config.controllers, centre, progress)
        trials += found
        rows += _rows(of, found)
        portraits.append(_portrait(of, centre))
    if not trials:
        raise InvalidInputError("; ".join(str(row[-1]) for row in rows))
    return Experiment(
        NAME, "Any arm", QUESTION, compared(trials), METRICS, tables=(_table(rows),), portraits=tuple(portraits)
    )


ENTRY = Entry(
    NAME,
    "arms of model files hold, move, are pushed, run into a sphere.",
    any_arm,
    count=lambda config: 2 * len(config.models) * len(config.controllers),
    takes=("models",),
)


def _loaded(place: str) -> tuple[ModelArm, np.ndarray | None]:
    """Return a model, and where the sphere is in its path."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        of = load_model(place)
    return of, swept_sphere(of, presets.vices())


def _trials(
    of: ModelArm, number: int, controllers: Sequence[str], centre: np.ndarray | None, progress: Progress | None
) -> list[Trial]:
    found = []
    for scenario in (WITH_WRENCH, WITHOUT):
        for name in controllers:
            figures = trial(of, presets.by_name(name), scenario == WITH_WRENCH, centre)
            found.append(Trial(scenario, name, number, figures))
            if progress:
                progress(1)
    return found


def compared(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    """Add to each trial whether it is worse than the baseline's of the same model; nothing without a baseline."""
    before = {(t.scenario, t.seed): t.metrics for t in trials if t.controller == BASELINE}
    return tuple(
        Trial(t.scenario, t.controller, t.seed, t.metrics | _against(t.metrics, before.get((t.scenario, t.seed), {})))
        for t in trials
    )


def _against(mine: Mapping[str, float], baseline: Mapping[str, float]) -> dict[str, float]:
    if not baseline:
        return {}
    further = mine["pushed_mm"] > FURTHER * baseline["pushed_mm"] + FURTHER_MM
    peaks = [name for name in ("fixed_peak_n", "sprung_peak_n") if name in mine and name in baseline]
    harder = any(mine[name] > HARDER * baseline[name] + HARDER_N for name in peaks)
    return {"pushed_further": float(further), "harder": float(harder)}


def _rows(of: ModelArm, trials: Sequence[Trial]) -> list[tuple[str | float, ...]]:
    rows: list[tuple[str | float, ...]] = []
    for t in trials:
        spheres = [_pair(t.metrics, name) for name in ("fixed", "sprung")]
        figures = [t.metrics.get(name, math.nan) for name in ("hold_mm", "move_mm", "pushed_mm")]
        speed = t.metrics["joint_speed_peak_rad_s"]
        rows.append((of.name, of.arm.n, t.controller, t.scenario, *figures, *spheres, speed, "loads"))
    return rows


def _pair(metrics: Mapping[str, float], name: str) -> str:
    if f"{name}_peak_n" not in metrics:
        return "-"
    return f"{metrics[f'{name}_peak_n']:.0f} / {metrics[f'{name}_steady_n']:.1f}"


def _table(rows: Sequence[tuple[str | float, ...]]) -> Table:
    columns = (
        "model", "joints", "controller", "sensor", "hold (mm)", "move (mm)", "pushed (mm)", "fixed sphere (N)",
        "sprung sphere (N)", "joint speed (rad/s)", "loading",
    )  # fmt: skip
    return Table("models", "Every model", columns, tuple(rows), NOTE)


def _portrait(of: ModelArm, centre: np.ndarray | None) -> Portrait:
    """Draw an arm at home, and the sphere that it meets."""
    arm = of.arm
    assert arm.description is not None and arm.tool is not None
    x, y, z = of.floor
    stage = Stage(arm.description, arm.tool, level_rectangle((x, y, z), (1.2, 1.2)))
    return Portrait(f"{of.name}: {arm.n} joints", stage, arm.home, centre, SPHERE_M)
