"""The tables of localisation: beside each estimator the limit that the torques themselves set, and figures by link."""

import math
from collections.abc import Sequence

import numpy as np

from contactsafe.results.experiment import Table, Trial

_ROWS = (
    ("felt", "contacts felt", "%", 100.0, ""),
    ("within_5_cm", "best point within 5 cm", "%", 100.0, "70"),
    ("within_5_cm_moved", "best point within 5 cm", "%", 100.0, "85"),
    ("point_error_cm", "best point, from the true one, median", "cm", 1.0, ""),
    ("link_right", "link right", "%", 100.0, ""),
    ("in_set", "true point in the 95 % set", "%", 100.0, "95"),
    ("set_area_cm2", "area of the set, median", "cm²", 1.0, ""),
    ("force_within", "force within 15 % or 2 N", "%", 100.0, "80"),
    ("force_size_within", "its size alone within that", "%", 100.0, ""),
    ("force_error_n", "force, from the true one, median", "N", 1.0, ""),
    ("force_error_deg", "angle between the two, median", "°", 1.0, ""),
    ("nearest_within_5_cm", "best point within 5 cm of either", "%", 100.0, ""),
    ("nearest_point_error_cm", "best point, from the nearest of them, median", "cm", 1.0, ""),
    ("nearest_link_right", "link either of the two", "%", 100.0, ""),
    ("nearest_in_set", "either true point in the 95 % set", "%", 100.0, ""),
    ("told", "told that no single contact explains it", "%", 100.0, ""),
)
_NOTE = (
    "Limit: the posterior over points of the surface from the true torque of the contact and the noise of the sensors "
    "alone, nothing else being unknown; moved, from three postures and a force that turns with its link. The limit's "
    "force is that where the place is known. Figures but the first are of contacts that were felt. In the set: one of "
    "its places, on the touched link, is no further from the true point than the places are apart. The estimator takes "
    "every contact for one, and tells where no single one explains the torques."
)


def localisation_tables(trials: Sequence[Trial]) -> tuple[Table, ...]:
    """Gather the trials by scenario, a table a plant, and by link on the first plant, a table an estimator."""
    plants = dict.fromkeys(trial.plant for trial in trials)
    names = list(dict.fromkeys(trial.controller for trial in trials))
    tables = [_beside_limit([t for t in trials if t.plant == plant], names, plant) for plant in plants]
    first = [t for t in trials if t.plant == next(iter(plants)) and "limit_in_set" in t.metrics]
    return (*tables, *(_by_link([t for t in first if t.controller == name], name) for name in names))


def _beside_limit(trials: Sequence[Trial], names: Sequence[str], plant: str) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for scenario in dict.fromkeys(trial.scenario for trial in trials):
        here = [trial for trial in trials if trial.scenario == scenario]
        for key, label, unit, scale, aim in _ROWS:
            if not any(key in trial.metrics or f"limit_{key}" in trial.metrics for trial in here):
                continue
            limit = _middle([t for t in here if t.controller == names[0]], f"limit_{key}", unit, scale)
            found = [_middle([t for t in here if t.controller == name], key, unit, scale) for name in names]
            rows.append((scenario, label, unit, limit, *found, aim))
    columns = ("contact", "figure", "unit", "limit", *names, "aim, at least")
    return Table(
        f"limit_{plant}", f"Estimated places beside what torques allow, {plant} plant", columns, tuple(rows), _NOTE
    )


def _by_link(trials: Sequence[Trial], name: str) -> Table:
    rows: list[tuple[str | float, ...]] = []
    headings = dict.fromkeys((trial.scenario, trial.plant) for trial in trials)
    for scenario, plant in headings:
        of = [t for t in trials if (t.scenario, t.plant) == (scenario, plant)]
        for link in sorted({trial.metrics["link"] for trial in of}):
            here = [trial for trial in of if trial.metrics["link"] == link]
            within = "within_5_cm" if any("within_5_cm" in t.metrics for t in here) else "within_5_cm_moved"
            shown = [(within, "%"), (f"limit_{within}", "%"), ("link_right", "%"), ("limit_link_right", "%")]
            shown += [("in_set", "%"), ("force_within", "%"), ("set_area_cm2", "cm²"), ("limit_set_area_cm2", "cm²")]
            figures = [_middle(here, key, unit, 100.0 if unit == "%" else 1.0) for key, unit in shown]
            rows.append((f"{scenario}, {plant}", int(link), len(here), *figures))
    columns = (
        "contact", "link", "contacts", "within 5 cm (%)", "its limit", "link right (%)", "limit of it",
        "in the set (%)", "force within (%)", "set (cm²)", "limit of that",
    )  # fmt: skip
    return Table(f"links_{name}", f"{name} by link", columns, tuple(rows))


def _middle(trials: Sequence[Trial], key: str, unit: str, scale: float) -> float:
    """Return the mean of what is a fraction, else the median, of the trials that have it."""
    values = np.array([trial.metrics.get(key, math.nan) for trial in trials])
    values = values[np.isfinite(values)]
    if not values.size:
        return math.nan
    return float(scale * (values.mean() if unit == "%" else np.median(values)))
