"""What a controller can be told: one frozen dataclass, every field with its unit."""

import math
from dataclasses import dataclass, fields

import numpy as np

from contactsafe.control.damping import GAIN_MARGIN, largest_damping
from contactsafe.core.errors import InvalidInputError

_PER_JOINT = ("K_posture", "D_posture")
_POSITIVE = (
    "dt", "loop_delay_s", "observer_gain", "detection_gain", "residual_cutoff_hz", "joint_margin", "tool_contact_n",
    "contact_force_limit_decay_s", "hold_s", "tank_s", "target_timeout_s",
)  # fmt: skip
_SHARES = ("release_fraction", "joint_speed_fraction", "torque_rate_fraction")
_MAY_BE_INFINITE = (
    "observer_gain", "detection_gain", "residual_cutoff_hz", "residual_threshold",
    "contact_torque_limit_comply_nm", "contact_torque_limit_reject_nm", "contact_force_limit_comply_n",
    "contact_force_limit_reject_n", "tool_force_limit_n", "task_acceleration_max_m_s2", "task_acceleration_max_rad_s2",
    "posture_error_max_rad", "tank_j", "target_timeout_s",
)  # fmt: skip


@dataclass(frozen=True)
class ControllerConfig:
    """Parameters of the contact-safe controller. Presets: `contactsafe.presets`.

    Attributes:
        K_posture: K2, posture stiffness, one a joint (the last repeats or is dropped for other arms), N m/rad.
        D_posture: D2, posture damping, N m s/rad.
        contact_aware: switch to the contact-aware law on contact; False is the VICES baseline with a posture task.
        cancel_tool_wrench: take the measured tool wrench out of the residual, (14), so that it shows the arm alone.
        observer_gain: K_I of the residual that compensates, 1/s.
        detection_gain: K_I of the residual that triggers, names the link and gives the direction, 1/s.
        residual_cutoff_hz: low-pass behind both residuals, Hz; inf for none.
        residual_threshold: δ, N m.
        friction_uncertainty: share of the nominal friction torque that is added to δ.
        inertia_uncertainty: share of the inertial torque that is added to δ.
        delay_uncertainty_ticks: by how many ticks a command may come late; its change meanwhile is added to δ.
        mass_uncertainty: standard deviation of the links' relative mass error, which is learned while nothing touches
            the arm; 0 to trust the model.
        payload_uncertainty_kg: the same of the tool's mass, kg; it is not learned, and counts where there is no force
            sensor.
        tool_memory_s: without a force sensor: time constant of the tool's wrench as it was before a contact, s.
        tool_radius_m: without a force sensor: no touch of the tool is further than this from the tool point, m.
        tool_moment_nm: without a force sensor: moment at the tool that noise and model errors may show, N m.
        dwell_s: t_c, least time in contact mode, s.
        release_s: time the residual must have stayed below a share of δ before contact mode ends, s.
        release_fraction: that share.
        recover_s: time constant with which the task's pull comes back after it gave way to a contact, s; 0 for at once.
        reject_recover_s: the same while something pushes the arm, s.
        null_damping: damping kept in the null-space direction that the contact removes, N m s/rad.
        contact_damping: damping of every joint while in contact, N m s/rad.
        approach_damping: damping of motion into an obstacle, along the contact's direction, N m s/rad.
        contact_torque_limit_comply_nm: largest commanded push along the contact while the arm
            is what ran into it, N m; inf for none.
        contact_torque_limit_reject_nm: the same while something pushes the arm, N m; inf for none.
        contact_force_limit_comply_n: the same bounds as a force at the link in contact, N; inf for none.
            The smaller one counts.
        contact_force_limit_reject_n: while something pushes the arm, N; inf for none.
        contact_force_limit_initial_n: the bound with which a contact is met, N; it falls to
            `contact_force_limit_comply_n` within a few `contact_force_limit_decay_s`.
        contact_force_limit_decay_s: time constant with which it falls, s.
        tool_force_limit_n: largest commanded push of the tool against what it touches, N; inf for none.
        tool_contact_n: least force at the tool that counts as its contact, N.
        probe_m: way by which the arm gives way to a contact before it judges whether something pushes it, m.
        probe_s: time constant with which torque, way and the force at the tool are smoothed for that, s.
        obstacle_stiffness_min: of the softest thing that counts as an obstacle and not as a pusher, N/m.
        reject_margin: the arm holds against this multiple of the pusher's torque.
        hold_s: time constant with which it then tries again whether the pusher is still there, s; doubled each time.
        friction_compensation: add the arm's nominal friction torque to the command, and expect it in the observer.
        stiffness_range: allowed K_task, 1/s².
        damping_range: allowed D_task, 1/s.
        joint_margin: distance from the joint limits at which the joint stops begin, rad.
        joint_stop_stiffness: N m/rad.
        joint_deceleration: a joint moves no faster than this can stop it before the margin, rad/s².
        joint_brake: braking of a joint that is too fast, per excess of speed and inertia, 1/s.
        joint_speed_fraction: share of the arm's joint speed limits that is used.
        manipulability_floor: det(J M⁻¹ Jᵀ) below which Λ is damped, as a share of the arm's best.
        manipulability_damping: λ² at a singularity, as a share of the sixth root of that best.
        task_acceleration_max_m_s2: largest acceleration K e that pulls the tool to its target, m/s².
        task_acceleration_max_rad_s2: the same of its turning, rad/s².
        posture_error_max_rad: the posture is pulled as if it were no further away than this, rad.
        passive_gains: raise stiffness and damping no faster than keeps the impedance stable whatever is asked.
        tank_j: energy that the command may give at once, J; inf for no bound.
        tank_power_w: power that it may give for ever, W.
        tank_s: least time in which it may give what the tank holds, s.
        torque_rate_fraction: share of the arm's torque-rate limit that is used.
        loop_delay_s: from the measurement of a velocity to the torque that answers it, beyond the tick itself, s:
            filters, transport, motors. Damping and stiffness are kept below what it makes unstable.
        target_timeout_s: after so long without a new target the tool is brought to rest, s; inf for never.
        dt: tick, s.
    """

    K_posture: tuple[float, ...] = (40.0, 40.0, 40.0, 40.0, 30.0, 20.0, 10.0)
    D_posture: tuple[float, ...] = (12.0, 12.0, 12.0, 12.0, 10.0, 8.0, 6.0)
    contact_aware: bool = True
    cancel_tool_wrench: bool = True
    observer_gain: float = 1.5
    detection_gain: float = 1.5
    residual_cutoff_hz: float = 30.0
    residual_threshold: float = 1.5
    friction_uncertainty: float = 0.0
    inertia_uncertainty: float = 0.0
    delay_uncertainty_ticks: float = 0.0
    mass_uncertainty: float = 0.0
    payload_uncertainty_kg: float = 0.0
    tool_memory_s: float = 0.2
    tool_radius_m: float = 0.08
    tool_moment_nm: float = 2.0
    dwell_s: float = 0.05
    release_s: float = 0.0
    release_fraction: float = 1.0
    recover_s: float = 0.0
    reject_recover_s: float = 0.0
    null_damping: float = 0.0
    contact_damping: float = 0.0
    approach_damping: float = 0.0
    contact_torque_limit_comply_nm: float = math.inf
    contact_torque_limit_reject_nm: float = math.inf
    contact_force_limit_comply_n: float = math.inf
    contact_force_limit_reject_n: float = math.inf
    contact_force_limit_initial_n: float = 20.0
    contact_force_limit_decay_s: float = 0.15
    tool_force_limit_n: float = math.inf
    tool_contact_n: float = 3.0
    probe_m: float = 0.002
    probe_s: float = 0.01
    obstacle_stiffness_min: float = 1500.0
    reject_margin: float = 2.0
    hold_s: float = 0.5
    friction_compensation: bool = True
    stiffness_range: tuple[float, float] = (10.0, 1500.0)
    damping_range: tuple[float, float] = (2.0, 120.0)
    joint_margin: float = 0.1
    joint_stop_stiffness: float = 200.0
    joint_deceleration: float = 8.0
    joint_brake: float = 50.0
    joint_speed_fraction: float = 0.9
    manipulability_floor: float = 0.007
    manipulability_damping: float = 0.047
    task_acceleration_max_m_s2: float = math.inf
    task_acceleration_max_rad_s2: float = math.inf
    posture_error_max_rad: float = math.inf
    passive_gains: bool = False
    tank_j: float = math.inf
    tank_power_w: float = 0.0
    tank_s: float = 0.1
    torque_rate_fraction: float = 0.999
    loop_delay_s: float = 0.002
    target_timeout_s: float = 0.1
    dt: float = 0.001

    def __post_init__(self):
        """Refuse what no controller can mean.

        Raises:
            InvalidInputError: a field is not a number, negative, or out of order.
        """
        for field in fields(self):
            _check_numbers(field.name, getattr(self, field.name), field.default)
        for name in _POSITIVE:
            if getattr(self, name) <= 0:
                raise InvalidInputError(f"{name} = {getattr(self, name)} must be greater than 0")
        for name in _SHARES:
            if not 0 < getattr(self, name) <= 1:
                raise InvalidInputError(f"{name} = {getattr(self, name)} is no share; give more than 0 and at most 1")
        for name in ("stiffness_range", "damping_range"):
            low, high = getattr(self, name)
            if not low < high:
                raise InvalidInputError(f"{name} = ({low}, {high}) is empty; give (lowest, highest)")
        highest = damping_rate(self, GAIN_MARGIN)
        if not self.damping_range[1] < highest:
            raise InvalidInputError(
                f"damping_range = {self.damping_range} reaches what a delay of {self.loop_delay_s} s at a tick of "
                f"{self.dt} s makes unstable; keep it below {highest:.4g} 1/s, or make the loop faster"
            )
        for what in ("torque_limit_{}_nm", "force_limit_{}_n"):
            lower, higher = (f"contact_{what.format(reaction)}" for reaction in ("comply", "reject"))
            if getattr(self, higher) < getattr(self, lower):
                raise InvalidInputError(
                    f"{higher} = {getattr(self, higher)} is below {lower} = {getattr(self, lower)}; "
                    "the arm may push harder to hold than to yield, never less"
                )


def damping_rate(config: ControllerConfig, margin: float) -> float:
    """Return the damping per inertia that stays a margin below what the loop makes unstable, 1/s."""
    return largest_damping(config.loop_delay_s / config.dt) / (margin * config.dt)


def _check_numbers(name: str, value, default) -> None:
    """Check one field: numbers ≥ 0, of its default's shape, but gains of joints may be any number of them."""
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} = {value!r} is not made of numbers; give numbers ≥ 0") from None
    if np.isnan(numbers).any() or (numbers < 0).any():
        raise InvalidInputError(f"{name} = {value} has a negative number or NaN; give numbers ≥ 0")
    if name not in _MAY_BE_INFINITE and np.isinf(numbers).any():
        raise InvalidInputError(f"{name} = {value} is infinite; give finite numbers ≥ 0")
    if name in _PER_JOINT:
        fits, wanted = numbers.ndim == 1 and numbers.size > 0, "one number a joint"
    else:
        fits, wanted = numbers.shape == np.shape(default), "(lowest, highest)" if np.shape(default) else "one number"
    if not fits:
        raise InvalidInputError(f"{name} = {value} has the wrong shape; give {wanted}")
