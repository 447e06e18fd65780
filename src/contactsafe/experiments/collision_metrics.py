"""What is measured of one collision, by the simulator's truth."""

import numpy as np

from contactsafe.control.codes import COMPLY, FREE, REJECT
from contactsafe.experiments.collision_motions import Motion
from contactsafe.experiments.collision_scenes import Meeting
from contactsafe.experiments.obstacle_metrics import obstacle_metrics
from contactsafe.results.metrics import Metric
from contactsafe.robot.arm import Arm

METRICS = (
    Metric("contact_peak_n", "contact force, peak", "N", main=True),
    Metric("contact_steady_n", "contact force, steady", "N", main=True),
    Metric("impulse_ns", "impulse of the contact", "N s"),
    Metric("tau_peak_nm", "external joint torque, peak", "N m"),
    Metric("tau_steady_nm", "external joint torque, steady", "N m"),
    Metric("detect_ms", "contact to its detection", "ms"),
    Metric("tool_error_mm", "tool away from its free motion, most", "mm"),
    Metric("tool_error_end_mm", "tool away from its free motion, at the end", "mm"),
    Metric("tool_force_peak_n", "tool force, peak", "N"),
    Metric("comply_fraction", "time complying", "%", 100.0),
    Metric("reject_fraction", "time rejecting", "%", 100.0),
    Metric("mode_switches", "changes of mode"),
    Metric("limit_touches", "touches of joint limits"),
    Metric("met", "trials in which the obstacle was touched, mean", "%", 100.0, mean=True),
)
STEADY_S = 0.5
"""The last part of a trial, over which steady figures are means, s."""

_AT_LIMIT_RAD = 1e-3
_FIXED_N_M = 1e6  # what stands for the stiffness of an obstacle that cannot move


def describe(motion: Motion) -> str:
    """Return in words what the tool does."""
    return f"{'hold' if motion.holds else 'sweep'} {'on a surface' if motion.slides else 'in free air'}"


def scene_metrics(motion: Motion, meetings: tuple[Meeting, ...]) -> dict[str, float]:
    """Describe a trial's scene by numbers; of two obstacles the stiffer one."""
    stiffest = max(meetings, key=lambda meeting: meeting.obstacle.stiffness)
    return {
        "obstacles": float(len(meetings)),
        "link": float(stiffest.link),
        "obstacle_stiffness_n_m": _FIXED_N_M if stiffest.obstacle.fixed else stiffest.obstacle.stiffness,
        "obstacle_mass_kg": stiffest.obstacle.mass,
        "speed_m_s": 0.0 if motion.holds else motion.speed_m_s,
        "target_offset_limited": float(motion.limited),
    }


def collision_metrics(trace: np.ndarray, free: np.ndarray, arm: Arm) -> dict[str, float]:
    """Summarise one collision by the simulator's truth.

    Args:
        trace: `trace_dtype` records, (T,).
        free: the same motion with nothing in its path, (T,).
        arm: for its joint range.
    """
    away = np.linalg.norm(trace["position"] - free["position"], axis=1)
    at_limit = ((trace["q"] < arm.q_min + _AT_LIMIT_RAD) | (trace["q"] > arm.q_max - _AT_LIMIT_RAD)).any(axis=1)
    return {
        **obstacle_metrics(trace, STEADY_S, of_met_only=False, reported_before_ms=0.0),
        "tool_error_mm": float(1000.0 * away.max()),
        "tool_error_end_mm": float(1000.0 * away[-1]),
        "tool_force_peak_n": float(np.linalg.norm(trace["tool_force"], axis=1).max()),
        "comply_fraction": float((trace["mode"] == COMPLY).mean()),
        "reject_fraction": float((trace["mode"] == REJECT).mean()),
        "mode_switches": float(np.count_nonzero(np.diff(trace["mode"] != FREE))),
        "limit_touches": float(np.count_nonzero(np.diff(at_limit.astype(int)) > 0)),
    }
