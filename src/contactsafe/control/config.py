"""What a controller can be told: a frozen dataclass for each stage, every parameter declared in its field."""

import difflib
import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

from contactsafe.control.damping import GAIN_MARGIN, largest_damping
from contactsafe.control.parameter import Stage, from_text, parameter
from contactsafe.control.velocity import VELOCITY_SOURCES
from contactsafe.core.errors import InvalidInputError

_INF = math.inf


@dataclass(frozen=True)
class ClockConfig(Stage):
    """Time: the tick, what comes late, and how long a target holds."""

    dt: float = parameter(0.001, "s", "tick", positive=True)
    loop_delay_s: float = parameter(
        0.002, "s", "from the measurement of a velocity to the torque that answers it, beyond the tick itself: "
        "filters, transport, motors; damping and stiffness are kept below what it makes unstable", positive=True,
    )  # fmt: skip
    target_timeout_s: float = parameter(
        0.1, "s", "after so long without a new target the tool is brought to rest", positive=True, infinite=True
    )


@dataclass(frozen=True)
class ObserverConfig(Stage):
    """Residuals: estimates of the external joint torque from momentum."""

    compensation_gain: float = parameter(
        1.5, "1/s", "K_I of the residual that the law compensates", positive=True, infinite=True
    )
    detection_gain: float = parameter(
        1.5, "1/s", "K_I of the residual that detects, isolates and gives the direction", positive=True, infinite=True
    )
    velocity_source: str = parameter(
        "robot", "", "where the residuals take the joints' velocity from: the robot's own signal, the difference of "
        "its positions, or of the two the quieter one, joint by joint", choices=VELOCITY_SOURCES,
    )  # fmt: skip
    residual_noise_nm: float = parameter(
        _INF, "N m", "noise of the detecting residual, standard deviation, beyond which it is filtered more; measured "
        "while nothing touches the arm", positive=True, infinite=True,
    )  # fmt: skip
    residual_cutoff_hz: float = parameter(30.0, "Hz", "low-pass behind both residuals", positive=True, infinite=True)
    cancel_tool_wrench: bool = parameter(
        True, "", "take the measured tool wrench out of the residual, (14), so that it shows the arm alone"
    )


@dataclass(frozen=True)
class DetectionConfig(Stage):
    """Thresholds of the residual, and when a contact ends."""

    residual_threshold: float = parameter(1.5, "N m", "δ", infinite=True)
    friction_uncertainty: float = parameter(0.0, "", "fraction of the nominal friction torque that is added to δ")
    inertia_uncertainty: float = parameter(0.0, "", "fraction of the inertial torque that is added to δ")
    delay_uncertainty_ticks: float = parameter(
        0.0, "ticks", "by which a command may come late; its change meanwhile is added to δ"
    )
    dwell_s: float = parameter(0.05, "s", "t_c, least time in contact")
    release_s: float = parameter(
        0.0, "s", "time for which the residual must have stayed below `release_fraction` of δ before a contact ends"
    )
    release_fraction: float = parameter(1.0, "", "of δ, below which a contact may end", fraction=True)


@dataclass(frozen=True)
class IdentificationConfig(Stage):
    """What is not known of masses, and what of the residual is the tool's where no sensor tells."""

    mass_uncertainty: float = parameter(
        0.0, "", "standard deviation of the links' relative mass error, which is identified while nothing touches the "
        "arm; 0 to trust the model",
    )  # fmt: skip
    payload_uncertainty_kg: float = parameter(
        0.0, "kg", "the same of the tool's mass; it is not identified, and counts where there is no force sensor"
    )
    tool_memory_s: float = parameter(
        0.2, "s", "without a force sensor: time constant of the tool's wrench as it was before a contact"
    )
    tool_radius_m: float = parameter(
        0.08, "m", "without a force sensor: no contact of the tool is further than this from the tool point"
    )
    tool_moment_nm: float = parameter(
        2.0, "N m", "without a force sensor: moment at the tool that noise and model errors may show"
    )


@dataclass(frozen=True)
class ClassificationConfig(Stage):
    """What tells a push from an obstacle, and a contact of the tool from none."""

    probe_m: float = parameter(
        0.002, "m", "displacement by which the arm recedes before a contact is classified, unless its work tells first"
    )
    probe_s: float = parameter(
        0.01, "s", "time constant with which torque, displacement and the force at the tool are smoothed for that"
    )
    obstacle_stiffness_min: float = parameter(
        1500.0,
        "N/m",
        "of the softest thing that counts as an obstacle; the line is drawn at half of it",
    )
    tool_contact_n: float = parameter(3.0, "N", "least force at the tool that counts as its contact", positive=True)


@dataclass(frozen=True)
class ReactionConfig(Stage):
    """The contact-aware law: compensation, bounds on the commanded contact force, damping in contact, recovery."""

    contact_aware: bool = parameter(
        True, "", "switch to the contact-aware law on contact; no: the VICES baseline with a posture task"
    )
    recover_s: float = parameter(
        0.0, "s", "time constant with which the task scale comes back to 1 after a contact lowered it; 0 for at once"
    )
    reject_recover_s: float = parameter(0.0, "s", "the same in mode REJECT")
    null_damping: float = parameter(
        0.0, "N m s/rad", "damping kept in the null-space direction that the contact removes"
    )
    contact_damping: float = parameter(0.0, "N m s/rad", "damping of every joint in contact")
    approach_damping: float = parameter(
        0.0, "N m s/rad", "damping of motion into an obstacle, along the contact's direction"
    )
    contact_torque_limit_comply_nm: float = parameter(
        _INF, "N m", "largest commanded torque along the contact in mode COMPLY", infinite=True
    )
    contact_torque_limit_reject_nm: float = parameter(_INF, "N m", "the same in mode REJECT", infinite=True)
    contact_force_limit_comply_n: float = parameter(
        _INF, "N", "the bound of mode COMPLY as a force at the link in contact; the smaller one counts", infinite=True
    )
    reject_force_n: float = parameter(
        0.0, "N", "force at the longest lever arm that the contact may have: up to which mode REJECT resists a push at "
        "least", infinite=True,
    )  # fmt: skip
    contact_force_limit_initial_n: float = parameter(
        20.0, "N", "the bound when a contact begins; it falls exponentially, and from "
        "`contact_force_limit_comply_n` on that one is in force",
    )  # fmt: skip
    contact_force_limit_decay_s: float = parameter(0.05, "s", "time constant with which it falls", positive=True)
    tool_force_limit_n: float = parameter(
        _INF,
        "N",
        "largest commanded force of the tool against what it touches; without a force sensor "
        "`reject_force_n` against what has done work on the arm, where that is more",
        infinite=True,
    )
    reject_margin: float = parameter(
        2.0, "", "multiple of a push's torque up to which mode REJECT resists it at least, within its limit in N m"
    )
    reject_decay_s: float = parameter(
        0.5, "s", "time constant with which that bound falls, to find out whether the push goes on; doubled each time",
        positive=True,
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse bounds of mode REJECT below those of mode COMPLY.

        Raises:
            InvalidInputError: as it says.
        """
        super().__post_init__()
        lower, higher = self.contact_torque_limit_comply_nm, self.contact_torque_limit_reject_nm
        if higher < lower:
            raise InvalidInputError(
                f"contact_torque_limit_reject_nm = {higher} is below contact_torque_limit_comply_nm = {lower}; "
                "the bound of mode REJECT may be the higher one, never the lower"
            )


@dataclass(frozen=True)
class ImpedanceConfig(Stage):
    """The free-space law: task impedance, posture, gains."""

    K_posture: tuple[float, ...] = parameter(
        (40.0, 40.0, 40.0, 40.0, 30.0, 20.0, 10.0), "N m/rad", "K2, posture stiffness, one a joint (the last repeats "
        "or is dropped for other arms)", per_joint=True,
    )  # fmt: skip
    D_posture: tuple[float, ...] = parameter(
        (12.0, 12.0, 12.0, 12.0, 10.0, 8.0, 6.0), "N m s/rad", "D2, posture damping, one a joint", per_joint=True
    )
    friction_compensation: bool = parameter(
        True,
        "",
        "add the arm's nominal friction torque to the command, and expect it in the observer; while nothing touches "
        "the arm add, in the direction of the task's torque, most of what else of friction the arm's file declares",
    )
    stiffness_range: tuple[float, float] = parameter((10.0, 1500.0), "1/s²", "allowed K_task")
    damping_range: tuple[float, float] = parameter((2.0, 120.0), "1/s", "allowed D_task")
    passive_gains: bool = parameter(
        False, "", "raise stiffness and damping no faster than keeps the impedance stable whatever is asked"
    )
    task_acceleration_max_m_s2: float = parameter(
        _INF, "m/s²", "largest acceleration K e of the tool to its target", infinite=True
    )
    task_acceleration_max_rad_s2: float = parameter(_INF, "rad/s²", "the same of its rotation", infinite=True)
    posture_error_max_rad: float = parameter(
        _INF, "rad", "the posture task acts as if the posture were no further away than this", infinite=True
    )
    manipulability_floor: float = parameter(
        0.007, "", "det(J M⁻¹ Jᵀ) below which Λ is damped, as a fraction of the arm's best"
    )
    manipulability_damping: float = parameter(
        0.047, "", "λ² at a singularity, as a fraction of the sixth root of that best"
    )


@dataclass(frozen=True)
class LimitsConfig(Stage):
    """What keeps any command within bounds: joint range and speed, energy, torque rate."""

    joint_margin: float = parameter(0.1, "rad", "distance from the joint limits at which stops begin", positive=True)
    joint_stop_stiffness: float = parameter(200.0, "N m/rad", "of the joint stops")
    joint_deceleration: float = parameter(
        8.0, "rad/s²", "a joint moves no faster than this can stop it before the margin"
    )
    joint_brake: float = parameter(50.0, "1/s", "braking of a joint that is too fast, per excess of speed and inertia")
    joint_speed_fraction: float = parameter(0.9, "", "of the arm's joint speed limits, that is used", fraction=True)
    tank_j: float = parameter(_INF, "J", "energy that the command may give at once", infinite=True)
    tank_power_w: float = parameter(0.0, "W", "power that it may give for ever")
    tank_s: float = parameter(0.1, "s", "least time in which it may give what the tank contains", positive=True)
    torque_rate_fraction: float = parameter(0.999, "", "of the arm's torque-rate limit, that is used", fraction=True)


@dataclass(frozen=True)
class ControllerConfig:
    """Parameters of the contact-safe controller by stage of its pipeline. Presets: `contactsafe.presets`.

    `config.detection.residual_threshold` reads one; `config.with_(residual_threshold=2.0)` returns a configuration with
    another value. The names are the same in no two stages.

    Attributes:
        clock: the tick, what comes late, how long a target holds.
        observer: gains of the residuals.
        detection: thresholds, and when a contact ends.
        identification: what is not known of masses and of the tool's wrench.
        classification: what tells a push from an obstacle.
        reaction: the contact-aware law and its bounds.
        impedance: the free-space law.
        limits: joint range and speed, energy, torque rate.
    """

    clock: ClockConfig = field(default_factory=ClockConfig)
    observer: ObserverConfig = field(default_factory=ObserverConfig)
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    identification: IdentificationConfig = field(default_factory=IdentificationConfig)
    classification: ClassificationConfig = field(default_factory=ClassificationConfig)
    reaction: ReactionConfig = field(default_factory=ReactionConfig)
    impedance: ImpedanceConfig = field(default_factory=ImpedanceConfig)
    limits: LimitsConfig = field(default_factory=LimitsConfig)

    def __post_init__(self) -> None:
        """Refuse damping that the loop's delay makes unstable.

        Raises:
            InvalidInputError: `damping_range` reaches it.
        """
        highest = damping_rate(self, GAIN_MARGIN)
        if not self.impedance.damping_range[1] < highest:
            raise InvalidInputError(
                f"damping_range = {self.impedance.damping_range} reaches what a delay of {self.clock.loop_delay_s} s "
                f"at a tick of {self.clock.dt} s makes unstable; keep it below {highest:.4g} 1/s, "
                "or make the loop faster"
            )

    def with_(self, **changed: Any) -> "ControllerConfig":
        """Return a configuration with other values of some parameters, named without their stage.

        Raises:
            InvalidInputError: no such parameter, or a value that no controller can mean.
        """
        by_stage: dict[str, dict[str, Any]] = {}
        for name, value in changed.items():
            by_stage.setdefault(stage_of(name), {})[name] = value
        return replace(self, **{stage: replace(getattr(self, stage), **values) for stage, values in by_stage.items()})


STAGES: dict[str, type[Stage]] = {declared.name: declared.default_factory for declared in fields(ControllerConfig)}  # type: ignore[misc]
"""The stages of a configuration by name."""

STAGE_OF = {declared.name: name for name, stage in STAGES.items() for declared in fields(stage)}
"""The stage of each parameter."""


def stage_of(name: str) -> str:
    """Return the name of a parameter's stage.

    Raises:
        InvalidInputError: no such parameter.
    """
    if name not in STAGE_OF:
        near = difflib.get_close_matches(name, STAGE_OF, 1)
        remedy = f"did you mean '{near[0]}'?" if near else f"choose from {', '.join(STAGE_OF)}"
        raise InvalidInputError(f"parameter '{name}' is unknown; {remedy}")
    return STAGE_OF[name]


def value_from_text(name: str, text: str) -> Any:
    """Return the value of a parameter as written on a command line; see `parameter.from_text`.

    Raises:
        InvalidInputError: no such parameter, or text that says no value of it.
    """
    declared = next(declared for declared in fields(STAGES[stage_of(name)]) if declared.name == name)
    return from_text(declared, text)


def damping_rate(config: ControllerConfig, margin: float) -> float:
    """Return the damping per inertia that stays a margin below what the loop makes unstable, 1/s."""
    return largest_damping(config.clock.loop_delay_s / config.clock.dt) / (margin * config.clock.dt)
