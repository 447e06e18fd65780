"""The clock experiment's tables: the worst of all seeds, what is bridged and what is braked."""

from collections.abc import Mapping, Sequence

import numpy as np

from contactsafe.experiments.clock_cases import SITUATIONS, Case, heading
from contactsafe.results.experiment import Table, Trial


def clock_tables(trials: Sequence[Trial], controllers: Sequence[str], cases: Sequence[Case]) -> list[Table]:
    """Return the worst of all seeds, one table of what is bridged and one of what is not, for each controller."""
    tables = []
    for name in controllers:
        of_controller: dict[str, list[dict[str, float]]] = {}
        for trial in trials:
            if trial.controller == name:
                of_controller.setdefault(trial.scenario, []).append(trial.metrics)
        for stops, columns, metric, title, note in (
            (False, _AWAY, "tool_away_mm", "bridged", _AWAY_NOTE),
            (True, _TRAVEL, "tool_travel_mm", "braked", _TRAVEL_NOTE),
        ):
            rows = tuple(
                _row(of_controller, case, timed, metric, stops)
                for case in cases if (case.stops or case.silent_s > 0.0) == stops
                for timed in (False, True)
            )  # fmt: skip
            heading = f"{name}: what is {title}, the worst of all seeds"
            tables.append(Table(f"{title}_{name}", heading, columns, rows, note))
    return tables


_FIRST = ("what happens", "time", "false ms", "step N m", *SITUATIONS)
_AWAY = (*_FIRST, "force N", "calm N")
_TRAVEL = (*_FIRST, "speed", "fault", "reset")
_FIRST_NOTE = "False: how long a contact is reported that is none. Step: largest change of a torque in a tick."
_AWAY_NOTE = (
    f"{_FIRST_NOTE} From {SITUATIONS[0]} to {SITUATIONS[-1]}: largest distance of the tool from the same run "
    "undisturbed, mm. Force: peak force of the obstacle on the arm; calm: the same undisturbed."
)
_TRAVEL_NOTE = (
    f"{_FIRST_NOTE} From {SITUATIONS[0]} to {SITUATIONS[-1]}: path of the tool until it rests, mm. Speed: of the "
    "fastest joint in the end, rad/s. Reset: largest torque step, N m, when the arm is then taken over."
)


def _row(
    of_controller: Mapping[str, list[dict[str, float]]], case: Case, timed: bool, metric: str, stops: bool
) -> tuple[str | float, ...]:
    rows = {situation: of_controller[heading(case, timed, situation)] for situation in SITUATIONS}
    everything = [row for found in rows.values() for row in found]

    def worst(name: str, found: Sequence[dict[str, float]] | None = None) -> float:
        values = [row[name] for row in (everything if found is None else found) if np.isfinite(row[name])]
        return max(values, default=np.nan)

    first = (case.name, "given" if timed else "-", worst("false_contact_ms"), worst("torque_step_nm"))
    middle = tuple(worst(metric, rows[situation]) for situation in SITUATIONS)
    if not stops:
        return (*first, *middle, worst("contact_peak_n"), worst("contact_peak_calm_n"))
    faults = ", ".join(str(fault) for fault in sorted({int(row["fault"]) for row in everything}))
    return (*first, *middle, worst("joint_speed_left_rad_s"), faults, worst("torque_step_back_nm"))
