"""Three controllers by name: the baseline, the paper, and the default."""

from collections.abc import Callable

from contactsafe.control.config import ControllerConfig, value_from_text
from contactsafe.core.errors import InvalidInputError, shown

__all__ = ["ABOUT", "PRESETS", "SAFE", "by_name", "paper", "safe", "vices"]


def paper() -> ControllerConfig:
    """Return the controller of the paper with its parameters: K_I 1.5 1/s, δ 1.5 N m, t_c 50 ms, K2 and D2 as printed.

    The cut-off of the residual's low-pass is not printed; 30 Hz lies far above K_I.
    """
    return ControllerConfig()


def vices() -> ControllerConfig:
    """Return the baseline: variable impedance control with a posture task and the same parameters, blind to contact.

    Martín-Martín et al. 2019, with the posture task the paper adds to it. Its residual is computed and reported only.
    """
    return paper().with_(contact_aware=False)


SAFE: dict[str, tuple[float | bool | str, str]] = {
    "compensation_gain": (50.0, "the printed 1.5 1/s answers a contact after most of its impulse has passed"),
    "detection_gain": (250.0, "lag of 4 ms, that of the low-pass behind it"),
    "velocity_source": ("quieter", "a real Panda's own velocity has noise of 4 to 6 mrad/s, which looks like contact"),
    "residual_noise_nm": (
        0.25,
        "a sixth of δ; noise beyond it is filtered, or it would reach δ within hours",
    ),
    "residual_cutoff_hz": (40.0, "noise of joint velocities stays below δ, and the lag at 4 ms"),
    "friction_uncertainty": (0.3, "friction models are off by 20 %; what is left would look like contact"),
    "inertia_uncertainty": (0.15, "so are inertias; quick motion would look like contact"),
    "delay_uncertainty_ticks": (1.5, "a command reaches the motors up to so late; its change would look like contact"),
    "mass_uncertainty": (
        0.06,
        "links 10 % heavier exceed δ at a Panda's shoulder; identified in free motion",
    ),
    "payload_uncertainty_kg": (0.12, "about the mass of the tool, which no force sensor takes out"),
    "release_s": (1.0, "a contact kept gentle drops below δ at times; released at once, the arm would hit again"),
    "release_fraction": (0.5, "the residual of a bounded contact lies around δ: hysteresis keeps one mode"),
    "recover_s": (1.0, "slow enough that the task does not drive the arm into a second impact"),
    "reject_recover_s": (0.03, "against a push the task must be back before the tool has left its path"),
    "null_damping": (10.0, "(21) takes all posture damping of a seven-joint arm away; about D_posture"),
    "contact_damping": (5.0, "takes out what an impact leaves in the joints; half of D_posture"),
    "approach_damping": (150.0, "stops the motion into an obstacle as fast as the sampled loop stays stable"),
    "contact_torque_limit_comply_nm": (2.0, "just above δ, so that the contact stays detected while the arm complies"),
    "contact_torque_limit_reject_nm": (30.0, "a push of 30 N at a metre; something stiff is pressed with no more"),
    "contact_force_limit_comply_n": (2.5, "less than what pushes a light obstacle along"),
    "reject_force_n": (50.0, "a push of 30 N, and what moves the arm back against it"),
    "contact_force_limit_initial_n": (17.0, "a push that begins must not displace the tool before it is classified"),
    "tool_force_limit_n": (20.0, "room for what a tool needs; a policy can press with no more"),
    "probe_m": (0.0005, "the shortest displacement that stands out of the noise: the tool hardly moves under a push"),
    "joint_margin": (0.2, "room to stop before the limit, whatever the policy asks"),
    "joint_speed_fraction": (0.6, "what runs into something at full speed cannot be stopped by any law"),
    "task_acceleration_max_m_s2": (15.0, "a target far away would accelerate the arm beyond what its brakes undo"),
    "task_acceleration_max_rad_s2": (80.0, "the same of a rotation"),
    "posture_error_max_rad": (0.5, "a posture far away would do the same"),
    "passive_gains": (True, "a policy that modulates stiffness could otherwise feed energy into a contact"),
    "tank_j": (5.0, "no targets and gains, whatever they are, give the arm more than this at once"),
    "tank_power_w": (10.0, "and no more than this in the long run"),
}
"""What `safe()` has otherwise than `paper()`: value and reason."""


def safe() -> ControllerConfig:
    """Return the default: `paper()` with fast detection, damping where the paper leaves none, bounded contact force.

    A fast residual detects and compensates; damping stays in the null-space direction that the contact removes, and in
    every joint; motion into the contact is braked; and the commanded force along the contact has a bound, low where the
    arm ran into something, higher where something pushes the arm. The contact-aware law is left, and the posture's
    stiffness comes back, slowly, so that there is no second impact. `SAFE` says why each value is what it is.
    """
    return paper().with_(**{name: value for name, (value, _) in SAFE.items()})


PRESETS: dict[str, Callable[[], ControllerConfig]] = {"vices": vices, "paper": paper, "safe": safe}

FORM = "NAME:PARAMETER=VALUE"
"""What `by_name` takes beside a name."""

ABOUT = {
    "vices": "the baseline: variable impedance control (Martín-Martín et al. 2019) with a posture task, "
    "blind to contact of the arm",
    "paper": "the contact-aware controller with the parameters of its paper",
    "safe": "this package's default: the paper's laws, fast detection, null-space damping and a bounded contact force",
}
"""Each in a few words."""


def by_name(name: str) -> ControllerConfig:
    """Return a preset by its name, as it is or with other values of parameters: `safe:tank_j=2:passive_gains=no`.

    Args:
        name: of the preset; then, each after a colon, parameters and their values (`parameter.from_text`).

    Raises:
        InvalidInputError: no such preset or parameter, or a value that no controller can mean.
    """
    preset, *changes = name.split(":")
    if preset not in PRESETS:
        raise InvalidInputError(f"controller {shown(preset)} is unknown; choose from {', '.join(PRESETS)}")
    changed = {}
    for change in changes:
        parameter, equals, text = change.partition("=")
        if not equals:
            raise InvalidInputError(f"'{change}' in '{name}' has no value; write parameter=value")
        changed[parameter] = value_from_text(parameter, text)
    return PRESETS[preset]().with_(**changed)
