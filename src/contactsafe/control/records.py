"""State is data: everything a controller is made of, as NumPy records that compiled code reads by name.

One controller is one record of `controller_dtype(n)`; many are an array of them; its state is saved by copying it.
"""

import functools
import math
from dataclasses import fields

import numpy as np

from contactsafe.control.config import ControllerConfig, damping_rate
from contactsafe.control.damping import BRAKING_MARGIN, GAIN_MARGIN
from contactsafe.control.laws import observer_gain
from contactsafe.robot.arm import Arm
from contactsafe.robot.dynamics import dynamics_dtype, handle_dtype
from contactsafe.robot.mobility import best_mobility

_f = np.float64
_i = np.int64

UNKNOWN_SPEED_LIMIT = 4.0 * math.pi
"""Speed limit of a joint whose own is not known, rad/s: two turns a second, more than arms of a person's size do."""

FREE, CONTACT = 0, 1
"""Modes of the supervisor."""

OUTSIDE_RAD = 0.5
"""A joint measured further outside its range than this is not there: no stop gives way so far."""

_TURNS_RAD = 1e4
"""Joints that turn without end are believed to have turned so far."""

_FASTER = 5.0
"""Multiple of a joint's speed limit at which its measured speed is not believed."""

BAD_MEASUREMENT, BAD_TARGET, BAD_QUATERNION, BAD_GAIN, MISSING, NO_TORQUE = 1, 2, 3, 4, 5, 6
REPEATED, OVERDUE, UNTRUE, LOAD, RUNAWAY, CLOCK = 7, 8, 9, 10, 11, 12
"""Faults, see `FAULTS`."""

LIMITED_BY_CONTACT, LIMITED_BY_TOOL_FORCE, LIMITED_BY_ENERGY, LIMITED_BY_RATE, LIMITED_BY_RANGE = 1, 2, 4, 8, 16
LIMITED_BY_LOAD = 32

LIMITS = {
    LIMITED_BY_CONTACT: "contact",
    LIMITED_BY_TOOL_FORCE: "tool force",
    LIMITED_BY_ENERGY: "energy",
    LIMITED_BY_RATE: "rate",
    LIMITED_BY_RANGE: "range",
    LIMITED_BY_LOAD: "load",
}
"""What takes something off a command: the bound on the push along a contact, the one on what the tool presses, the
energy tank, torque and its rate, joint range and speed; and whether it was a load that did."""

FAULTS = {
    0: "none",
    BAD_MEASUREMENT: "a measurement is not finite or beyond what the arm can do; it was bridged by a prediction",
    BAD_TARGET: "target is not finite or absurdly large; the last good target holds",
    BAD_QUATERNION: "target quaternion is not of unit length; the last good target holds",
    BAD_GAIN: "target stiffness or damping is out of range; the last good target holds",
    MISSING: "measurements stayed unusable for over 20 ticks; the arm was braked until reset",
    NO_TORQUE: "the law gave no finite torque; the last torque was repeated",
    REPEATED: "the same measurement of motion, or with its time, for over 20 ticks; the arm was braked until reset",
    OVERDUE: "over 20 ticks passed between two measurements; the arm was braked until reset",
    UNTRUE: "measurements contradict each other, or go on elsewhere, for over 20 ticks; the arm was braked until reset",
    LOAD: "a load, or a push like one, that the controller was not told of keeps the tool off; see payload_estimate()",
    RUNAWAY: "a joint stays beyond its speed limit though it is braked: the arm runs away; it is damped, nothing else",
    CLOCK: "the time of a measurement stood or went back while the joints went on; they tell the time instead",
}
"""What `fault` in the state and output means. The first is latched until reset, but what brakes the arm replaces it:
MISSING, REPEATED, OVERDUE, UNTRUE and RUNAWAY; and so does LOAD where nothing brakes, which goes once it is told."""


def measurement_dtype(n: int) -> np.dtype:
    """Describe what sensors give each tick."""
    return np.dtype(
        [
            ("q", _f, (n,)),  # rad
            ("qd", _f, (n,)),  # rad/s
            ("wrench_ee", _f, (6,)),  # environment on end effector, at the tool point, world axes, N and N m
            ("has_wrench", _i),  # 0 where no force sensor is there
            ("time", _f),  # when it was measured, s
            ("has_time", _i),  # 0 where that is not known
        ]
    )


def target_dtype(n: int) -> np.dtype:
    """Describe what a policy asks for."""
    return np.dtype(
        [
            ("position", _f, (3,)),  # m
            ("quat", _f, (4,)),  # w x y z
            ("K_task", _f, (6,)),  # 1/s²
            ("D_task", _f, (6,)),  # 1/s
            ("q_posture", _f, (n,)),  # rad
            ("kept", _i),  # 1 in a tick for which no new one came
        ]
    )


_SHARES = (
    "detection_filter_gain",
    "compensation_filter_gain",
    "lowpass_gain",
    "recover_gain",
    "probe_gain",
    "reject_recover_gain",
    "tool_share",
)
"""Parts of their way that first-order filters go in one tick."""


def _copied(kind: type) -> list[str]:
    """Name the fields of a configuration that the tick reads as they are: its single numbers and its switches."""
    return [field.name for field in fields(ControllerConfig) if type(field.default) is kind]


def params_dtype(n: int) -> np.dtype:
    """Describe a configuration resolved for one arm: per-joint arrays, per-tick factors."""
    return np.dtype(
        [(name, _f) for name in _copied(float)]
        + [(name, _i) for name in _copied(bool)]
        + [
            (name, _f)
            for name in (
                "stiffness_min",
                "stiffness_max",
                "damping_min",
                "damping_max",
                "torque_step",
                "damping_rate",
                "braking_rate",
                "posture_in_contact",
            )
        ]
        + [(name, _f) for name in _SHARES]
        + [("dwell_ticks", _i), ("release_ticks", _i)]
        + [(name, _f, (n,)) for name in ("K_posture", "D_posture", "q_min", "q_max", "qd_max", "tau_max")]
        + [("runaway_speed", _f, (n,)), ("reversal_s", _f, (n,))]
        + [(name, _f, (n,)) for name in ("q_least", "q_most", "qd_most")]  # that are believed of a measurement
        + [("friction", _f, (n, 3)), ("mass_variance", _f, (n + 1,))]
    )


payload_dtype = np.dtype(
    [
        ("mass", _f),  # kg
        ("com", _f, (3,)),  # in the tool's frame, m
        ("inertia", _f, (3, 3)),  # about it, in the tool's axes, kg m²
        ("in_wrench", _i),  # 1 where the measured wrench has its weight in it
    ]
)
"""What the tool is known to carry; the handle's model has it."""


def state_dtype(n: int) -> np.dtype:
    """Describe what a controller remembers from tick to tick."""
    return np.dtype(
        [
            ("started", _i),  # 0 before the first tick after a reset
            ("turn", _i),  # joint whose torque is weighed next
            ("ticks", _i),  # since reset
            ("fault", _i),  # first fault since reset
            *_clocked(n),
            *_estimated(n),
            *_supervised(n),
            *_commanded(n),
        ]
    )


step_dtype = np.dtype([("ticks", _f), ("dt", _f), *((name, _f) for name in _SHARES), ("torque_step", _f)])
"""What a tick comes to when so many ticks of time passed in it: s, shares, N m."""


def _clocked(n: int) -> list[tuple]:
    """Where the arm is believed to be, and since when it was not seen."""
    return [
        ("q", _f, (n,)),  # as measured, or as predicted where that failed, rad
        ("qd", _f, (n,)),  # rad/s
        ("wrench_ee", _f, (6,)),  # last good one
        ("has_wrench", _i),
        ("q_good", _f, (n,)),  # last good measurement, rad
        ("qd_good", _f, (n,)),  # rad/s
        ("time", _f),  # of it, s
        ("timed", _i),  # 0 where that is not known
        ("lead", _f),  # of the time as counted on it, where the clock is wrong, ticks
        ("doubted", _i),  # 1 once the clock was wrong, until reset
        ("pace", _f),  # ticks of time that a call usually comes to
        ("pace_variance", _f),
        ("elapsed", _f),  # ticks of time that passed since the last tick
        ("since", _f),  # ticks of time between the last good measurement and the one before it, or now
        ("unclear", _i),  # 1 where that time is not known for sure
        ("bridged", _i),  # ticks in a row whose measurement was predicted
        ("braking", _i),  # 1 once the arm is braked, until reset
        ("rests", _i),  # 1 once it was braked to rest
        ("q_hold", _f, (n,)),  # where, rad
        ("step", step_dtype),
        ("target_age", _f),  # ticks of time since a new target came
        ("target_late", _i),  # 1 where that is too long ago
    ]


def _estimated(n: int) -> list[tuple]:
    """What acts on the arm and what its links weigh."""
    return [
        ("momentum", _f, (n,)),  # at the last tick, kg m²/s
        ("wrench_before", _f, (6,)),  # at the last good measurement, on the tool, N and N m
        ("felt", _f, (n,)),  # largest torque of the tool's wrench of late, N m
        ("unseen", _f, (n,)),  # torque of the tool that a gap in the measurements may have hidden, N m
        ("beta", _f, (n,)),  # g − Cᵀ q̇ at the last tick, N m
        ("impulse", _f, (n,)),  # of the command less friction and β since the last good measurement, N m ticks
        ("impulse_ticks", _f),  # in so many ticks
        ("observed", _f, (n,)),  # residual before its low-pass, compensating observer, N m
        ("observed_fast", _f, (n,)),  # the same, triggering observer, N m
        ("residual", _f, (n,)),  # N m
        ("residual_fast", _f, (n,)),  # N m
        ("observed_rate", _f, (n,)),  # momentum's rate of change through the triggering observer's filter, N m
        ("momentum_rate", _f, (n,)),  # the same behind the low-pass, N m
        ("observed_ramp", _f, (n,)),  # change of the command per tick through the triggering observer's filter, N m
        ("torque_ramp", _f, (n,)),  # the same behind the low-pass, N m
        ("tool_wrench", _f, (6,)),  # of the environment on the tool, where no sensor says it, N and N m
        ("arm_torque", _f, (n,)),  # residual less the tool's share, compensating, N m
        ("arm_torque_fast", _f, (n,)),  # the same, triggering, N m
        ("alarm", _f, (n,)),  # what is held against the thresholds, N m
        ("threshold", _f, (n,)),  # N m
        ("unknown", _f, (n,)),  # of it, what friction, inertia and a late command may come to, N m
        ("mass_error", _f, (n + 1,)),  # relative, of the links and of the tool, as found by weighing
        ("mass_covariance", _f, (n + 1, n + 1)),
        ("gravity_sigma", _f, (n,)),  # standard deviation of the gravity torque, N m
        ("payload_momentum", _f, (6,)),  # of the known payload at the last good measurement, kg m/s and kg m²/s
        ("load", _f, (4,)),  # that the tool carries beyond it: mass, and mass times centre in its frame, kg and kg m
        ("load_covariance", _f, (4, 4)),
        ("load_torque", _f),  # smoothed square of what acts from outside, in units of its error
        ("load_left", _f),  # the same of what the load does not explain
        ("slow_s", _f),  # time since a joint was fast, s
        ("loaded", _i),  # 1 where what acts is such a load
        ("sags_s", _f),  # time for which it has kept the tool below its target, s
    ]


def _supervised(n: int) -> list[tuple]:
    """Mode, the contact, and who pushes whom."""
    return [
        ("mode", _i),
        ("mode_ticks", _i),  # ticks spent in the mode
        ("displacement_rad", _f),  # by which the arm has receded along the contact's direction since the reference
        ("displacement_smooth_rad", _f),  # the same, smoothed
        ("torque_smooth_nm", _f),  # contact torque along its direction, smoothed
        ("decide_rad", _f),  # where it is judged next whether something pushes
        ("reference_nm", _f),  # contact torque then, N m
        ("hold_nm", _f),  # push limit while holding, N m
        ("hold_s", _f),  # time constant with which it falls, s
        ("meet_n", _f),  # push limit with which the contact was met, falling, N
        ("quiet_ticks", _i),  # ticks since the residual was above what keeps the mode
        ("direction", _f, (n,)),  # unit joint-space direction of the contact's torque on the arm, last seen
        ("contact_link", _i),  # link that the contact is on, 1 … n
        ("lever", _f),  # joint torque per newton there, m
        ("lever_most", _f),  # the same, were the push not along the surface's normal, m
        ("search_at", _i),  # next point of the surface to be searched
        ("search_point", _i),  # best one of this search so far, −1 for none
        ("search_fit", _f),  # cosine between its torque and the one found
        ("velocity_observed", _f, (n,)),  # joint velocity through the triggering observer's filter, rad/s
        ("velocity_seen", _f, (n,)),  # the same behind the low-pass: in step with residual_fast, rad/s
        ("holding", _i),  # 1 while something pushes the arm
    ]


def _commanded(n: int) -> list[tuple]:
    """What is followed, what of it is in force, and what was sent."""
    return [
        ("tau", _f, (n,)),  # last command sent, N m
        ("tau_before", _f, (n,)),  # the command before that, N m
        ("friction", _f, (n,)),  # friction torque contained in the last, N m
        ("target", target_dtype(n)),  # last good target
        ("tool_force", _f, (3,)),  # of the environment on the tool, smoothed, N
        ("unweighed", _f, (n,)),  # less the gravity torque found by weighing, which the command does without, N m
        ("K_task", _f, (6,)),  # in force, 1/s²
        ("D_task", _f, (6,)),  # in force, 1/s
        ("tank_j", _f),  # energy that the command may still give, J
        ("task_damping", _f),  # largest of the task's damping in force, 1/s
        ("damping_limit", _f, (n,)),  # what dampers of each joint may come to, N m s/rad
        ("joint_damping", _f, (n,)),  # what they come to, N m s/rad
        ("damping_scale", _f, (n,)),  # of each joint's damping in force
        ("runaway", _i),  # 1 once a joint stayed beyond its speed limit though it was braked, until reset
        ("overspeed_s", _f, (n,)),  # time beyond the speed limit, s
        ("posture_scale", _f),  # of K_posture in force
        ("scale_reason", _i),  # key of LIMITS that took what is missing of it
        ("task_scale", _f),  # of what pulls to the target in force, 0 … 1
    ]


def output_dtype(n: int) -> np.dtype:
    """Describe what a tick reports."""
    return np.dtype(
        [
            ("torque", _f, (n,)),  # command, N m
            ("residual", _f, (n,)),  # compensating, N m
            ("residual_fast", _f, (n,)),  # N m
            ("error", _f, (6,)),  # x_d − x, m and rad
            ("position", _f, (3,)),  # of the tool, m
            ("rotation", _f, (3, 3)),
            ("velocity", _f, (6,)),  # of the tool
            ("mode", _i),
            ("holding", _i),
            ("link", _i),  # 1 … n, 0 for none
            ("push_nm", _f),  # commanded push along the contact before the bound, N m
            ("push_limit_nm", _f),  # the bound in force; inf where there is none
            ("limited_by", _i),  # sum of the keys of LIMITS that took something off the command
            ("bridged", _i),  # ticks in a row whose measurement was predicted
            ("target_late", _i),  # 1 where no new target came for too long
            ("braked", _i),  # 1 where the arm is braked, until reset
            ("fault", _i),
        ]
    )


@functools.cache  # numba compares types of records that are not the very same field by field, 10 us a call
def controller_dtype(n: int) -> np.dtype:
    """Describe one whole controller for an arm of n joints."""
    return np.dtype(
        [
            ("handle", handle_dtype),
            ("params", params_dtype(n)),
            ("payload", payload_dtype),
            ("state", state_dtype(n)),
            ("measurement", measurement_dtype(n)),
            ("target", target_dtype(n)),
            ("dynamics", dynamics_dtype(n)),
            ("output", output_dtype(n)),
        ],
        align=True,
    )


def index_bounds(controller) -> dict[str, tuple[float, float]]:
    """Give what those integers of a `controller_dtype` record may be that compiled code uses as an index, by name."""
    n, points = len(controller["state"]["tau"]), int(controller["handle"]["surface_points"])
    return {
        "state.turn": (0, n - 1),
        "state.mode": (FREE, CONTACT),
        "state.contact_link": (0, n),
        "state.search_at": (0, max(points - 1, 0)),
        "state.search_point": (-1, points - 1),
        "output.mode": (FREE, CONTACT),
        "output.link": (0, n),
    }


def fill_params(params, config: ControllerConfig, arm: Arm) -> None:
    """Resolve a configuration for an arm into a `params_dtype` record."""
    dt = config.dt
    for name in (*_copied(float), *_copied(bool)):
        params[name] = getattr(config, name)
    params["detection_filter_gain"] = observer_gain(config.detection_gain, dt)
    params["compensation_filter_gain"] = observer_gain(config.observer_gain, dt)
    params["lowpass_gain"] = observer_gain(2.0 * math.pi * config.residual_cutoff_hz, dt)
    mobility = best_mobility(arm)
    params["manipulability_damping"] *= mobility.mean
    # An arm that can never move its tool every way is singular wherever it is.
    params["manipulability_floor"] *= mobility.mean**6
    if mobility.directions < 6:
        params["manipulability_floor"] = math.inf
    params["stiffness_min"], params["stiffness_max"] = config.stiffness_range
    params["damping_min"], params["damping_max"] = config.damping_range
    params["torque_step"] = config.torque_rate_fraction * arm.torque_rate_max * dt
    params["dwell_ticks"] = round(config.dwell_s / dt)
    params["release_ticks"] = round(config.release_s / dt)
    params["recover_gain"] = fraction_per_tick(config.recover_s, dt)
    params["posture_in_contact"] = 0.0 if config.recover_s > 0 else 1.0
    params["probe_gain"] = fraction_per_tick(config.probe_s, dt)
    params["tool_share"] = fraction_per_tick(config.tool_memory_s, dt)
    params["mass_variance"] = mass_variance(config, arm)
    params["reject_recover_gain"] = fraction_per_tick(config.reject_recover_s, dt)
    params["K_posture"] = _per_joint(config.K_posture, arm.n)
    # A spring that acts late drives what it holds, as a damper of −K τ would: put in twice that at least.
    params["D_posture"] = np.maximum(
        _per_joint(config.D_posture, arm.n), 2.0 * config.loop_delay_s * params["K_posture"]
    )
    params["damping_rate"] = damping_rate(config, GAIN_MARGIN)
    params["braking_rate"] = damping_rate(config, BRAKING_MARGIN)
    # Where the stops of a narrow range would overlap, they begin later: half of it stays free.
    narrower = np.maximum(config.joint_margin - 0.25 * (arm.q_max - arm.q_min), 0.0)
    params["q_min"], params["q_max"] = arm.q_min - narrower, arm.q_max + narrower
    params["runaway_speed"] = np.where(np.isfinite(arm.qd_max), arm.qd_max, UNKNOWN_SPEED_LIMIT)
    params["qd_max"] = config.joint_speed_fraction * params["runaway_speed"]
    # From full drive to full braking of all that may drive a joint, and the lag of what is measured.
    params["reversal_s"] = 2.0 * arm.tau_max.max() / arm.torque_rate_max + 10.0 * config.loop_delay_s
    params["tau_max"], params["friction"] = arm.tau_max, arm.friction
    params["q_least"] = np.maximum(arm.q_min, -_TURNS_RAD) - OUTSIDE_RAD
    params["q_most"] = np.minimum(arm.q_max, _TURNS_RAD) + OUTSIDE_RAD
    params["qd_most"] = np.minimum(_FASTER * arm.qd_max, _speed_gained(arm))


def _speed_gained(arm: Arm) -> np.ndarray:
    """Give the speed that full torque gives each joint over one turn, √(4π tau_max (M⁻¹)ᵢᵢ), (n,), rad/s."""
    M_inv = arm.dynamics(arm.home, np.zeros(arm.n))["M_inv"]
    return np.minimum(np.sqrt(4.0 * math.pi * arm.tau_max * np.diag(M_inv)), 1e5)


def fraction_per_tick(time_constant_s: float, dt: float) -> float:
    """Give the share of its way that a first-order filter goes in one tick; all of it where its time constant is 0."""
    return 1.0 - math.exp(-dt / time_constant_s) if time_constant_s > 0 else 1.0


def mass_variance(config: ControllerConfig, arm: Arm) -> np.ndarray:
    """Give the variance of the relative mass error of each link and of the tool, (n + 1,)."""
    model = arm.model
    tool_kg = float(model.body_mass[int(model.jnt_bodyid[0]) + arm.n :].sum())
    variance = np.full(arm.n + 1, config.mass_uncertainty**2)
    variance[-1] = (config.payload_uncertainty_kg / tool_kg) ** 2 if tool_kg > 0 else 0.0
    return variance


def _per_joint(values: tuple[float, ...], n: int) -> np.ndarray:
    """Fit a list of gains to n joints: drop what is too much, repeat the last."""
    return np.array([values[min(i, len(values) - 1)] for i in range(n)])
