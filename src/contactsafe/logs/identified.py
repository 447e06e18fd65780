"""An identification as results: declared for the page, the tables and JSON, as those of an experiment."""

import numpy as np

from contactsafe.logs.fitting import Fit
from contactsafe.logs.identification import Identification
from contactsafe.logs.results import joint_figure
from contactsafe.results.experiment import Experiment, Table
from contactsafe.results.recording import Recording
from contactsafe.sim.truth import trace_dtype

BEFORE, AFTER = "description", "identified"

_SECOND = "second half"
_CAPTION = "Torque that the model leaves unexplained, each half by what the other one shows. Shaded: second half."
_CONFIDENCE = 1.96
"""Standard deviations on both sides of a value that hold the true one with 95 %."""

_UNITS = {"bias": "N m", "viscous": "N m s/rad", "coulomb": "N m", "rotor": "kg m²"}
_PARTS = {"sensor": "torque sensors", "losses": "motors and gears"}


def results_of(found: Identification) -> Experiment:
    """Return an identification as an experiment without trials: the check, what was found, and residuals."""
    return Experiment(
        "identify",
        f"Identification from {found.log.source}",
        found.verdict(),
        recordings=tuple(_recording(found, name) for name in (BEFORE, AFTER)),
        figures=(joint_figure(found.arm.n, _CAPTION, _SECOND),),
        tables=(_check(found), *(_joints(found, name) for name in found.fits), *_load(found), _noise(found)),
    )


def _recording(found: Identification, name: str) -> Recording:
    fit = found.fit
    trace = np.zeros(len(fit.impulses.time), dtype=trace_dtype(found.arm.n))
    trace["time"] = fit.impulses.time
    values = fit.nominal if name == BEFORE else fit.check
    curves = {str(i): values[:, i] for i in range(found.arm.n)}
    second = np.arange(len(values)) >= len(values) // 2
    return Recording(found.log.source, name, 0, trace, curves={**curves, _SECOND: second})


def _check(found: Identification) -> Table:
    before, after = found.before, found.after
    rows = tuple(
        (i + 1, float(before[i]), float(after[i]), 100.0 * (1.0 - float(after[i] / np.maximum(before[i], 1e-12))))
        for i in range(found.arm.n)
    )
    total = (*found.rms, 100.0 * found.reduction)
    columns = ("joint", "by the description, rms (N m)", "identified, rms (N m)", "smaller by (%)")
    note = "Residual torque of the second half of the log; identified from the first half alone."
    note += f" {found.carried.left_out[0].upper()}{found.carried.left_out[1:]}." if found.carried.left_out else ""
    return Table("check", "The second half", columns, (*rows, ("all", *total)), note)


def _joints(found: Identification, part: str) -> Table:
    fit: Fit = found.fits[part]
    names, found_of = fit.names, {name: fit.found(name) for name in fit.names}
    values = {name: value for name, (value, _) in found_of.items()}
    intervals = {name: _CONFIDENCE * deviation for name, (_, deviation) in found_of.items()}
    rows = []
    for i in range(found.arm.n):
        cells = [cell for name in names for cell in (float(values[name][i]), float(intervals[name][i]))]
        rest: list[str | float] = [float(found.calibration.stiction[i])] if part == "losses" else []
        rows.append((i + 1, *cells, *rest))
    heads = [head for name in names for head in (f"{name} ({_UNITS[name]})", f"± {name}")]
    heads += ["stiction (N m)"] if part == "losses" else []
    missing = "; ".join(found.not_shown(part))
    note = "From the whole log, ± 95 % confidence." + (
        f" Not identifiable from this log: {missing}." if missing else ""
    )
    return Table(part, f"What was identified: {_PARTS[part]}", ("joint", *heads), tuple(rows), note)


def _load(found: Identification) -> tuple[Table, ...]:
    load = found.carried.payload
    if load is None:
        return ()
    spread = _CONFIDENCE * found.carried.deviation
    row = (load.mass, spread, *(float(value) for value in load.com), *(float(load.inertia[k, k]) for k in range(3)))
    columns = ("mass (kg)", "± mass", "com x (m)", "com y (m)", "com z (m)", "Ixx (kg m²)", "Iyy", "Izz")
    note = "Carried beside what the description has, in the tool's frame; inertia about the centre of mass."
    return (Table("payload", "Payload", columns, (row,), note),)


def _noise(found: Identification) -> Table:
    known = found.calibration
    rows = tuple(
        (i + 1, float(known.torque_noise[i]), 1000.0 * float(known.velocity_noise[i])) for i in range(found.arm.n)
    )
    columns = ("joint", "torque (N m)", "velocity (mrad/s)")
    note = (
        "What smoothing over 40 ms takes off, standard deviation; velocity: the robot's own or that of its positions."
    )
    return Table("noise", "Noise", columns, rows, note)
