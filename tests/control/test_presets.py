"""Three controllers by name, and what no configuration may say."""

import math
from dataclasses import asdict, replace

import pytest

from contactsafe import ControllerConfig, presets
from contactsafe.core.errors import InvalidInputError


def test_paper_has_every_printed_parameter_and_nothing_beyond_it():
    config = presets.paper()
    assert config.observer_gain == config.detection_gain == 1.5
    assert config.residual_threshold == 1.5
    assert config.dwell_s == 0.05
    assert config.K_posture == (40, 40, 40, 40, 30, 20, 10)
    assert config.D_posture == (12, 12, 12, 12, 10, 8, 6)
    assert config.contact_aware
    assert config.cancel_tool_wrench
    for name in ("release_s", "recover_s", "null_damping", "contact_damping", "approach_damping"):
        assert getattr(config, name) == 0.0
    for name in ("friction_uncertainty", "inertia_uncertainty", "mass_uncertainty", "payload_uncertainty_kg"):
        assert getattr(config, name) == 0.0
    for name in (
        "contact_torque_limit_comply_nm",
        "contact_torque_limit_reject_nm",
        "contact_force_limit_comply_n",
        "contact_force_limit_reject_n",
        "tool_force_limit_n",
        "tank_j",
    ):
        assert getattr(config, name) == math.inf
    for name in ("task_acceleration_max_m_s2", "task_acceleration_max_rad_s2", "posture_error_max_rad"):
        assert getattr(config, name) == math.inf
    assert not config.passive_gains


def test_baseline_differs_from_the_paper_in_being_blind_alone():
    paper, vices = asdict(presets.paper()), asdict(presets.vices())
    assert {name for name in paper if paper[name] != vices[name]} == {"contact_aware"}
    assert vices["contact_aware"] is False


def test_safe_keeps_the_papers_posture_task_and_dwell():
    paper, safe = presets.paper(), presets.safe()
    for name in ("K_posture", "D_posture", "dwell_s", "contact_aware", "stiffness_range", "damping_range", "dt"):
        assert getattr(safe, name) == getattr(paper, name)
    assert safe.contact_torque_limit_comply_nm < safe.contact_torque_limit_reject_nm < math.inf
    assert (
        safe.contact_force_limit_comply_n
        < safe.contact_force_limit_initial_n
        < safe.contact_force_limit_reject_n
        < math.inf
    )


@pytest.mark.parametrize("name", ["vices", "paper", "safe"])
def test_preset_by_name(name):
    assert presets.by_name(name) == getattr(presets, name)()


def test_unknown_preset():
    with pytest.raises(InvalidInputError) as caught:
        presets.by_name("gentle")
    assert str(caught.value) == "controller 'gentle' is unknown; choose from vices, paper, safe"


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"null_damping": -1.0}, "null_damping = -1.0 has a negative number or NaN; give numbers ≥ 0"),
        ({"dwell_s": math.nan}, "dwell_s = nan has a negative number or NaN; give numbers ≥ 0"),
        ({"K_posture": (1.0, -2.0)}, "K_posture = (1.0, -2.0) has a negative number or NaN; give numbers ≥ 0"),
        ({"dt": 0.0}, "dt = 0.0 must be greater than 0"),
        ({"observer_gain": 0.0}, "observer_gain = 0.0 must be greater than 0"),
        ({"detection_gain": 0}, "detection_gain = 0 must be greater than 0"),
        ({"residual_cutoff_hz": 0.0}, "residual_cutoff_hz = 0.0 must be greater than 0"),
        ({"joint_margin": 0.0}, "joint_margin = 0.0 must be greater than 0"),
        ({"tank_s": 0.0}, "tank_s = 0.0 must be greater than 0"),
        ({"tool_contact_n": 0.0}, "tool_contact_n = 0.0 must be greater than 0"),
        ({"contact_force_limit_decay_s": 0.0}, "contact_force_limit_decay_s = 0.0 must be greater than 0"),
        ({"hold_s": 0.0}, "hold_s = 0.0 must be greater than 0"),
        ({"release_fraction": 0.0}, "release_fraction = 0.0 is no share; give more than 0 and at most 1"),
        ({"torque_rate_fraction": 5.0}, "torque_rate_fraction = 5.0 is no share; give more than 0 and at most 1"),
        ({"joint_speed_fraction": 1.1}, "joint_speed_fraction = 1.1 is no share; give more than 0 and at most 1"),
        (
            {"contact_force_limit_comply_n": 5.0, "contact_force_limit_reject_n": 4.0},
            "contact_force_limit_reject_n = 4.0 is below contact_force_limit_comply_n = 5.0; the arm may push "
            "harder to hold than to yield, never less",
        ),
        ({"stiffness_range": (20.0, 10.0)}, "stiffness_range = (20.0, 10.0) is empty; give (lowest, highest)"),
        ({"damping_range": (5.0, 5.0)}, "damping_range = (5.0, 5.0) is empty; give (lowest, highest)"),
        (
            {"contact_torque_limit_comply_nm": 5.0, "contact_torque_limit_reject_nm": 4.0},
            "contact_torque_limit_reject_nm = 4.0 is below contact_torque_limit_comply_nm = 5.0; "
            "the arm may push harder to hold than to yield, never less",
        ),
    ],
)
def test_config_that_no_controller_can_mean(changed, text):
    with pytest.raises(InvalidInputError) as caught:
        replace(ControllerConfig(), **changed)
    assert str(caught.value) == text


def test_infinite_bounds_mean_none():
    config = ControllerConfig(
        contact_torque_limit_comply_nm=math.inf, contact_torque_limit_reject_nm=math.inf, residual_cutoff_hz=math.inf
    )
    assert config.residual_cutoff_hz == math.inf


def test_bounds_may_be_infinite_and_nothing_else():
    with pytest.raises(InvalidInputError) as caught:
        ControllerConfig(dwell_s=math.inf)
    assert str(caught.value) == "dwell_s = inf is infinite; give finite numbers ≥ 0"


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"dwell_s": "long"}, "dwell_s = 'long' is not made of numbers; give numbers ≥ 0"),
        ({"dwell_s": None}, "dwell_s = None has a negative number or NaN; give numbers ≥ 0"),
        ({"dwell_s": (0.1, 0.2)}, "dwell_s = (0.1, 0.2) has the wrong shape; give one number"),
        ({"K_posture": 40.0}, "K_posture = 40.0 has the wrong shape; give one number a joint"),
        ({"D_posture": ()}, "D_posture = () has the wrong shape; give one number a joint"),
        ({"stiffness_range": 100.0}, "stiffness_range = 100.0 has the wrong shape; give (lowest, highest)"),
        (
            {"damping_range": (1.0, 2.0, 3.0)},
            "damping_range = (1.0, 2.0, 3.0) has the wrong shape; give (lowest, highest)",
        ),
    ],
)
def test_what_is_no_number_or_too_many(changed, text):
    with pytest.raises(InvalidInputError) as caught:
        ControllerConfig(**changed)
    assert str(caught.value) == text
