"""Three controllers by name: the baseline, the paper, and the default."""

from collections.abc import Callable
from dataclasses import replace

from contactsafe.control.config import ControllerConfig
from contactsafe.core.errors import InvalidInputError

__all__ = ["PRESETS", "by_name", "paper", "safe", "vices"]


def paper() -> ControllerConfig:
    """Give the controller of the paper with its parameters: K_I 1.5 1/s, δ 1.5 N m, t_c 50 ms, K2 and D2 as printed.

    The cut-off of the residual's low-pass is not printed; 30 Hz lies far above K_I.
    """
    return ControllerConfig()


def vices() -> ControllerConfig:
    """Give the baseline: variable impedance control with a posture task and the same parameters, blind to arm contact.

    Martín-Martín et al. 2019, with the posture task the paper adds to it. Its residual is computed and reported only.
    """
    return replace(paper(), contact_aware=False)


def safe() -> ControllerConfig:
    """Give the default: `paper()` with a fast trigger, damping where the paper leaves none, and a bounded push.

    A fast residual triggers and compensates; damping stays in the null-space direction that the contact removes, and in
    every joint; motion into the contact is braked; and the command never pushes along the contact harder than a bound,
    low where the arm ran into something, higher where something pushes the arm. Contact mode ends, and the posture's
    stiffness comes back, slowly, so that there is no second blow.
    """
    return replace(
        paper(),
        observer_gain=50.0,
        detection_gain=250.0,
        residual_cutoff_hz=40.0,
        residual_threshold=1.5,
        friction_uncertainty=0.3,
        inertia_uncertainty=0.15,
        delay_uncertainty_ticks=1.5,
        mass_uncertainty=0.06,
        payload_uncertainty_kg=0.12,
        release_s=1.0,
        release_fraction=0.5,
        recover_s=1.0,
        null_damping=10.0,
        contact_damping=5.0,
        approach_damping=150.0,
        contact_torque_limit_comply_nm=2.0,
        contact_torque_limit_reject_nm=22.0,
        contact_force_limit_comply_n=2.5,
        contact_force_limit_reject_n=45.0,
        contact_force_limit_initial_n=17.0,
        probe_m=0.0005,
        tool_force_limit_n=20.0,
        reject_recover_s=0.03,
        joint_margin=0.2,
        joint_speed_fraction=0.6,
        task_acceleration_max_m_s2=15.0,
        task_acceleration_max_rad_s2=80.0,
        posture_error_max_rad=0.5,
        passive_gains=True,
        tank_j=5.0,
        tank_power_w=10.0,
    )


PRESETS: dict[str, Callable[[], ControllerConfig]] = {"vices": vices, "paper": paper, "safe": safe}


def by_name(name: str) -> ControllerConfig:
    """Look a preset up by its name.

    Raises:
        InvalidInputError: no such preset.
    """
    if name not in PRESETS:
        raise InvalidInputError(f"controller '{name}' is unknown; choose from {', '.join(PRESETS)}")
    return PRESETS[name]()
