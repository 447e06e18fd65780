"""The table of the battery on models, and what of them is worse than under the baseline."""

import math
from collections.abc import Mapping, Sequence

from contactsafe.experiments.robot_trials import HOLD_S, MOVE_S, PUSH_S, SETTLE_S, SPRING_N_M
from contactsafe.results.experiment import Table, Trial
from contactsafe.results.metrics import BASELINE
from contactsafe.sim.model_arms import MOVES_M, ModelArm
from contactsafe.sim.model_scenes import SPHERE_M

FURTHER_MM, FURTHER = 2.0, 1.2
LARGER_N, LARGER = 5.0, 1.05
"""A trial is worse than the baseline's by both: so much, and this multiple."""

NOTE = (
    f"Hold: {HOLD_S:g} s. Move: {1000 * MOVES_M:g} mm in {MOVE_S:g} s along an axis of the world, {SETTLE_S:g} s "
    f"later. Push: 25 N for {PUSH_S:g} s on the middle of the arm, or a tenth of what it can hold. Sphere: of "
    f"{SPHERE_M:g} m in the path of the arm's outer half, fixed or on springs of {SPRING_N_M:g} N/m; peak / steady. "
    "With a wrench the controller is told that nothing touches the tool. '-': the joints do not allow it, or nothing "
    f"of the arm meets anything. Further: by {FURTHER_MM:g} mm and {100 * (FURTHER - 1):.0f} %; larger force: by "
    f"{LARGER_N:g} N and {100 * (LARGER - 1):.0f} %."
)


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
    larger = any(mine[name] > LARGER * baseline[name] + LARGER_N for name in peaks)
    return {"pushed_further": float(further), "peak_regression": float(larger)}


def model_rows(of: ModelArm, trials: Sequence[Trial]) -> list[tuple[str | float, ...]]:
    """Return the rows of a model in `model_table`, one a controller and sensor."""
    rows: list[tuple[str | float, ...]] = []
    for t in trials:
        spheres = [_pair(t.metrics, name) for name in ("fixed", "sprung")]
        figures = [t.metrics.get(name, math.nan) for name in ("hold_mm", "move_mm", "pushed_mm")]
        speed = t.metrics["joint_speed_peak_rad_s"]
        rows.append((of.name, of.arm.n, t.controller, t.scenario, *figures, *spheres, speed, of.notes or "loads"))
    return rows


def _pair(metrics: Mapping[str, float], name: str) -> str:
    if f"{name}_peak_n" not in metrics:
        return "-"
    return f"{metrics[f'{name}_peak_n']:.0f} / {metrics[f'{name}_steady_n']:.1f}"


def model_table(rows: Sequence[tuple[str | float, ...]]) -> Table:
    """Return the table of all models, those that were not loaded as well."""
    columns = (
        "model", "joints", "controller", "sensor", "hold (mm)", "move (mm)", "pushed (mm)", "fixed sphere (N)",
        "sprung sphere (N)", "joint speed (rad/s)", "loading",
    )  # fmt: skip
    return Table("models", "Every model", columns, tuple(rows), NOTE)
