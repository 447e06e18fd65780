"""Parameters as compiled code reads them: what the configuration declares, resolved for one arm and one tick."""

import math

import numpy as np

from contactsafe.control.config import STAGES, ControllerConfig, damping_rate
from contactsafe.control.damping import BRAKING_MARGIN, GAIN_MARGIN
from contactsafe.control.laws import filter_gain
from contactsafe.control.parameter import fill_record, record_fields
from contactsafe.robot.arm import Arm
from contactsafe.robot.mobility import best_mobility

_f = np.float64
_i = np.int64

UNKNOWN_SPEED_LIMIT = 4.0 * math.pi
"""Speed limit of a joint whose own is not known, rad/s: two turns a second, more than arms of a person's size do."""

OUTSIDE_RAD = 0.5
"""A joint measured further outside its range than this is not there: no stop yields so far."""

_TURNS_RAD = 1e4
"""Joints that turn without end are believed to have turned so far."""

_FASTER = 5.0
"""Multiple of a joint's speed limit at which its measured speed is not believed."""

step_dtype = np.dtype(
    [
        ("ticks", _f),
        ("dt", _f),  # s
        # fractions of a step that first-order filters take up
        ("detection_filter_gain", _f),
        ("compensation_filter_gain", _f),
        ("lowpass_gain", _f),
        ("full_filter_gain", _f),  # of detection, whatever bandwidth is in force
        ("full_lowpass_gain", _f),
        ("recover_gain", _f),
        ("reject_recover_gain", _f),
        ("probe_gain", _f),
        ("tool_memory_gain", _f),
        ("torque_step", _f),  # by which a command may change, N m
    ]
)
"""What gains and rates come to over the time that one tick stands for."""


def _resolved(n: int) -> dict[str, list[tuple]]:
    """Return by stage the fields that follow from its parameters, the arm and the tick."""
    return {
        "detection": [("dwell_ticks", _i), ("release_ticks", _i)],
        "identification": [("mass_variance", _f, (n + 1,))],
        "reaction": [("posture_scale", _f)],  # of K_posture in contact
        "limits": [("damping_rate", _f), ("braking_rate", _f)],  # that the sampled loop takes, 1/s
    }


def arm_dtype(n: int) -> np.dtype:
    """Describe what is read of the arm beside its model: the limits in force, and what a user knows of it."""
    return np.dtype(
        [(name, _f, (n,)) for name in ("q_min", "q_max", "qd_max", "tau_max", "runaway_speed", "reversal_s")]
        + [(name, _f, (n,)) for name in ("q_least", "q_most", "qd_most")]  # that are believed of a measurement
        + [("friction", _f, (n, 3)), ("drag", _f, (n, 3)), ("friction_unknown", _f, (n, 2))]
        + [("sensor_friction", _f, (n, 3)), ("sensor_drag", _f, (n, 3))]
        + [("sensor_errs", np.int64)]  # 1 where the sensors of torque show something beside it
        + [("rotor", _f, (n,)), ("lever_doubted", _f)]  # kg m², m
    )


def params_dtype(n: int) -> np.dtype:
    """Describe a configuration resolved for one arm: a sub-record a stage, the arm's limits, the gains of one tick."""
    more = _resolved(n)
    return np.dtype(
        [(name, np.dtype(record_fields(stage, n) + more.get(name, []))) for name, stage in STAGES.items()]
        + [("arm", arm_dtype(n)), ("one_tick", step_dtype)]
    )


def fill_params(params: np.void, config: ControllerConfig, arm: Arm) -> None:
    """Resolve a configuration for an arm into a `params_dtype` record."""
    for name in STAGES:
        fill_record(params[name], getattr(config, name))
    _fill_resolved(params, config, arm)
    _fill_one_tick(params["one_tick"], config, arm)
    _fill_arm(params["arm"], config, arm)


def _fill_resolved(params: np.void, config: ControllerConfig, arm: Arm) -> None:
    dt, detection, impedance = config.clock.dt, config.detection, params["impedance"]
    mobility = best_mobility(arm)
    impedance["manipulability_damping"] *= mobility.mean
    # An arm that can never move its tool in all directions is singular wherever it is.
    impedance["manipulability_floor"] *= mobility.mean**6
    if mobility.directions < 6:
        impedance["manipulability_floor"] = math.inf
    # A spring that acts late drives what it holds, as a damper of −K τ would: put in twice that at least.
    impedance["D_posture"] = np.maximum(
        impedance["D_posture"], 2.0 * config.clock.loop_delay_s * impedance["K_posture"]
    )
    params["detection"]["dwell_ticks"] = round(detection.dwell_s / dt)
    params["detection"]["release_ticks"] = round(detection.release_s / dt)
    params["identification"]["mass_variance"] = mass_variance(config, arm)
    params["reaction"]["posture_scale"] = 0.0 if config.reaction.recover_s > 0 else 1.0
    params["limits"]["damping_rate"] = damping_rate(config, GAIN_MARGIN)
    params["limits"]["braking_rate"] = damping_rate(config, BRAKING_MARGIN)


def _fill_one_tick(step: np.void, config: ControllerConfig, arm: Arm) -> None:
    dt, observer, reaction = config.clock.dt, config.observer, config.reaction
    step["ticks"], step["dt"] = 1.0, dt
    step["detection_filter_gain"] = filter_gain(observer.detection_gain, dt)
    step["compensation_filter_gain"] = filter_gain(observer.compensation_gain, dt)
    step["lowpass_gain"] = filter_gain(2.0 * math.pi * observer.residual_cutoff_hz, dt)
    step["full_filter_gain"], step["full_lowpass_gain"] = step["detection_filter_gain"], step["lowpass_gain"]
    step["recover_gain"] = fraction_per_tick(reaction.recover_s, dt)
    step["reject_recover_gain"] = fraction_per_tick(reaction.reject_recover_s, dt)
    step["probe_gain"] = fraction_per_tick(config.classification.probe_s, dt)
    step["tool_memory_gain"] = fraction_per_tick(config.identification.tool_memory_s, dt)
    step["torque_step"] = config.limits.torque_rate_fraction * arm.torque_rate_max * dt


def _fill_arm(limits: np.void, config: ControllerConfig, arm: Arm) -> None:
    # Where the stops of a narrow range would overlap, they begin later: half of it stays free.
    narrower = np.maximum(config.limits.joint_margin - 0.25 * (arm.q_max - arm.q_min), 0.0)
    limits["q_min"], limits["q_max"] = arm.q_min - narrower, arm.q_max + narrower
    limits["runaway_speed"] = np.where(np.isfinite(arm.qd_max), arm.qd_max, UNKNOWN_SPEED_LIMIT)
    limits["qd_max"] = config.limits.joint_speed_fraction * limits["runaway_speed"]
    # From full drive to full braking of all that may drive a joint, and the lag of what is measured.
    limits["reversal_s"] = 2.0 * arm.tau_max.max() / arm.torque_rate_max + 10.0 * config.clock.loop_delay_s
    limits["tau_max"], limits["friction"], limits["lever_doubted"] = arm.tau_max, arm.friction, arm.lever_doubted
    limits["drag"], limits["friction_unknown"] = arm.drag, arm.friction_unknown
    limits["sensor_friction"], limits["sensor_drag"] = arm.sensor_friction, arm.sensor_drag
    limits["sensor_errs"] = bool(np.any(arm.sensor_friction[:, 0]) or np.any(arm.sensor_drag))
    limits["rotor"] = arm.model.dof_armature
    limits["q_least"] = np.maximum(arm.q_min, -_TURNS_RAD) - OUTSIDE_RAD
    limits["q_most"] = np.minimum(arm.q_max, _TURNS_RAD) + OUTSIDE_RAD
    limits["qd_most"] = np.minimum(_FASTER * arm.qd_max, _speed_gained(arm))


def _speed_gained(arm: Arm) -> np.ndarray:
    """Return the speed that full torque gives each joint over one turn, √(4π tau_max (M⁻¹)ᵢᵢ), (n,), rad/s."""
    M_inv = arm.dynamics(arm.home, np.zeros(arm.n))["M_inv"]
    return np.minimum(np.sqrt(4.0 * math.pi * arm.tau_max * np.diag(M_inv)), 1e5)


def fraction_per_tick(time_constant_s: float, dt: float) -> float:
    """Return the fraction of a step that a first-order filter takes up in one tick; 1 where its time constant is 0."""
    return 1.0 - math.exp(-dt / time_constant_s) if time_constant_s > 0 else 1.0


def mass_variance(config: ControllerConfig, arm: Arm) -> np.ndarray:
    """Return the variance of the relative mass error of each link and of the tool, (n + 1,)."""
    model = arm.model
    tool_kg = float(model.body_mass[int(model.jnt_bodyid[0]) + arm.n :].sum())
    variance = np.full(arm.n + 1, config.identification.mass_uncertainty**2)
    variance[-1] = (config.identification.payload_uncertainty_kg / tool_kg) ** 2 if tool_kg > 0 else 0.0
    return variance
