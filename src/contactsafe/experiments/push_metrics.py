"""What is measured of one push: where the tool goes, against the same run without the push."""

import math

import numpy as np

from contactsafe.control.codes import FREE, REJECT
from contactsafe.experiments.push_scenes import PushedMotion
from contactsafe.results.metrics import ZERO, Metric

METRICS = (
    Metric("tool_displacement_mm", "tool displaced by the push, most", "mm", main=True),
    Metric("tool_off_path_mm", "of that, across its path", "mm", main=True),
    Metric("tool_error_end_mm", "tool still displaced 2 s after release", "mm", main=True),
    Metric("displacement_ratio", "displacement / that under the baseline, same trial", main=True),
    Metric("worse", "displaced more than under the baseline", main=True, aim=ZERO),
    Metric("tool_displacement_after_mm", "tool displaced after release, most", "mm"),
    Metric("joint_speed_peak_rad_s", "joint speed, peak", "rad/s", main=True),
    Metric("report_ms", "onset to a contact reported", "ms"),
    Metric("reject_ms", "onset to its being named a push", "ms"),
    Metric("tau_peak_nm", "joint torque of the push, peak", "N m"),
    Metric("force_n", "force of the push", "N"),
)

WORSE_MM, WORSE_FRACTION = 5.0, 1.2
"""A trial is worse where its displacement passes the baseline's by both: so much, mm, and this multiple."""

FLOOR_MM = 1.0
"""Least displacement put into a ratio, mm, above and below the line: a push that does nothing has the ratio 1."""


def push_metrics(trace: np.ndarray, calm: np.ndarray, scene: PushedMotion) -> dict[str, float]:
    """Summarise one push by the simulator's truth; times are NaN where a contact was reported before its onset.

    Args:
        trace: `trace_dtype` records, one a ms, (T,).
        calm: the same controller in the same scene without the push, (T,).
        scene: what was done.
    """
    apart = 1000.0 * (trace["position"] - calm["position"])
    away, off_path = np.linalg.norm(apart, axis=1), np.linalg.norm(_across(apart, scene.path), axis=1)
    onset, release = round(1000 * scene.meets_s), round(1000 * scene.release_s)
    speed = 1000.0 * np.abs(np.diff(trace["q"][onset:], axis=0))
    mode = trace["mode"][onset:release]
    early = bool(mode[0] != FREE)
    return {
        "tool_displacement_mm": float(away[onset:release].max()),
        "tool_off_path_mm": float(off_path[onset:release].max()),
        "tool_displacement_after_mm": float(away[release:].max()),
        "tool_error_end_mm": float(away[-1]),
        "joint_speed_peak_rad_s": float(speed.max()),
        "report_ms": math.nan if early else _first(mode != FREE),
        "reject_ms": math.nan if early else _first(mode == REJECT),
        "reported_early": float(early),
        "never_rejected": float(not (mode == REJECT).any()),
        "tau_peak_nm": float(np.abs(trace["tau_arm"][onset:release]).max()),
        "force_n": float(np.linalg.norm(scene.force)),
        "link": float(scene.link),
        "ramp_ms": 1000.0 * scene.ramp_s,
        "angle_deg": math.degrees(scene.angle_rad),
        "moves": float(not scene.holds),
        "stiffness_1_s2": float(scene.stiffness[0]),
    }


def against(mine: dict[str, float], baseline: dict[str, float]) -> dict[str, float]:
    """Compare a trial's displacement with the baseline's in the same trial; see `WORSE_MM` and `FLOOR_MM`."""
    one, other = mine["tool_displacement_mm"], baseline["tool_displacement_mm"]
    return {
        "baseline_mm": other,
        "displacement_ratio": max(one, FLOOR_MM) / max(other, FLOOR_MM),
        "worse": float(one > other + WORSE_MM and one > WORSE_FRACTION * other),
    }


def _across(vectors: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Return what of vectors (T, 3) is across a path (3,), all of them where there is none: a late tool is on it."""
    length = float(np.linalg.norm(path))
    if length == 0.0:
        return vectors
    along = path / length
    return vectors - np.outer(vectors @ along, along)


def _first(true: np.ndarray) -> float:
    return float(np.argmax(true)) if true.any() else math.nan
