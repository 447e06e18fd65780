"""Three controllers by name, and what no configuration may say."""

import math
from dataclasses import fields

import pytest

from contactsafe import ControllerConfig, presets
from contactsafe.control.config import STAGE_OF, STAGES, DetectionConfig
from contactsafe.control.parameter import declaration
from contactsafe.core.errors import InvalidInputError


def value(config, name):
    """Return a parameter by its name alone."""
    return getattr(getattr(config, STAGE_OF[name]), name)


def test_paper_has_every_printed_parameter_and_nothing_beyond_it():
    config = presets.paper()
    assert config.observer.compensation_gain == config.observer.detection_gain == 1.5
    assert config.detection.residual_threshold == 1.5
    assert config.detection.dwell_s == 0.05
    assert config.impedance.K_posture == (40, 40, 40, 40, 30, 20, 10)
    assert config.impedance.D_posture == (12, 12, 12, 12, 10, 8, 6)
    assert config.reaction.contact_aware
    assert config.observer.cancel_tool_wrench
    for name in ("release_s", "recover_s", "null_damping", "contact_damping", "approach_damping"):
        assert value(config, name) == 0.0
    for name in ("friction_uncertainty", "inertia_uncertainty", "mass_uncertainty", "payload_uncertainty_kg"):
        assert value(config, name) == 0.0
    for name in (
        "contact_torque_limit_comply_nm",
        "contact_torque_limit_reject_nm",
        "contact_force_limit_comply_n",
        "tool_force_limit_n",
        "tank_j",
    ):
        assert value(config, name) == math.inf
    for name in ("task_acceleration_max_m_s2", "task_acceleration_max_rad_s2", "posture_error_max_rad"):
        assert value(config, name) == math.inf
    assert not config.impedance.passive_gains


def test_baseline_differs_from_the_paper_in_being_blind_alone():
    paper, vices = presets.paper(), presets.vices()
    assert {name for name in STAGE_OF if value(paper, name) != value(vices, name)} == {"contact_aware"}
    assert vices.reaction.contact_aware is False


def test_safe_keeps_the_papers_posture_task_and_dwell():
    paper, safe = presets.paper(), presets.safe()
    for name in ("K_posture", "D_posture", "dwell_s", "contact_aware", "stiffness_range", "damping_range", "dt"):
        assert value(safe, name) == value(paper, name)
    assert safe.reaction.contact_torque_limit_comply_nm < safe.reaction.contact_torque_limit_reject_nm < math.inf
    assert safe.reaction.contact_force_limit_comply_n < safe.reaction.contact_force_limit_initial_n < math.inf


@pytest.mark.parametrize("name", ["vices", "paper", "safe"])
def test_preset_by_name(name):
    assert presets.by_name(name) == getattr(presets, name)()


def test_preset_with_other_values_of_parameters():
    config = presets.by_name("safe:tank_j=2:passive_gains=no:stiffness_range=20/900:K_posture=30/20")
    assert config == presets.safe().with_(
        tank_j=2.0, passive_gains=False, stiffness_range=(20.0, 900.0), K_posture=(30.0, 20.0)
    )


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("safe:tank_j", "'tank_j' in 'safe:tank_j' has no value; write parameter=value"),
        ("safe:tank=2", "parameter 'tank' is unknown; did you mean 'tank_s'?"),
        ("safe:tank_s=0", "tank_s = 0.0 must be greater than 0"),
        ("gentle:tank_j=2", "controller 'gentle' is unknown; choose from vices, paper, safe"),
    ],
)
def test_preset_with_values_that_cannot_be(name, text):
    with pytest.raises(InvalidInputError) as caught:
        presets.by_name(name)
    assert str(caught.value) == text


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
        ({"compensation_gain": 0.0}, "compensation_gain = 0.0 must be greater than 0"),
        ({"detection_gain": 0}, "detection_gain = 0 must be greater than 0"),
        ({"residual_cutoff_hz": 0.0}, "residual_cutoff_hz = 0.0 must be greater than 0"),
        ({"joint_margin": 0.0}, "joint_margin = 0.0 must be greater than 0"),
        ({"tank_s": 0.0}, "tank_s = 0.0 must be greater than 0"),
        ({"tool_contact_n": 0.0}, "tool_contact_n = 0.0 must be greater than 0"),
        ({"contact_force_limit_decay_s": 0.0}, "contact_force_limit_decay_s = 0.0 must be greater than 0"),
        ({"reject_decay_s": 0.0}, "reject_decay_s = 0.0 must be greater than 0"),
        ({"release_fraction": 0.0}, "release_fraction = 0.0 is no fraction; give more than 0 and at most 1"),
        ({"torque_rate_fraction": 5.0}, "torque_rate_fraction = 5.0 is no fraction; give more than 0 and at most 1"),
        ({"joint_speed_fraction": 1.1}, "joint_speed_fraction = 1.1 is no fraction; give more than 0 and at most 1"),
        ({"stiffness_range": (20.0, 10.0)}, "stiffness_range = (20.0, 10.0) is empty; give (lowest, highest)"),
        ({"damping_range": (5.0, 5.0)}, "damping_range = (5.0, 5.0) is empty; give (lowest, highest)"),
        (
            {"contact_torque_limit_comply_nm": 5.0, "contact_torque_limit_reject_nm": 4.0},
            "contact_torque_limit_reject_nm = 4.0 is below contact_torque_limit_comply_nm = 5.0; "
            "the bound of mode REJECT may be the higher one, never the lower",
        ),
    ],
)
def test_config_that_no_controller_can_mean(changed, text):
    with pytest.raises(InvalidInputError) as caught:
        ControllerConfig().with_(**changed)
    assert str(caught.value) == text


def test_infinite_bounds_mean_none():
    config = ControllerConfig().with_(
        contact_torque_limit_comply_nm=math.inf, contact_torque_limit_reject_nm=math.inf, residual_cutoff_hz=math.inf
    )
    assert config.observer.residual_cutoff_hz == math.inf


def test_bounds_may_be_infinite_and_nothing_else():
    with pytest.raises(InvalidInputError) as caught:
        DetectionConfig(dwell_s=math.inf)
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
        ControllerConfig().with_(**changed)
    assert str(caught.value) == text


def test_names_are_the_same_in_no_two_stages():
    """So that `with_` finds a parameter without its stage."""
    assert len(STAGE_OF) == sum(len(fields(stage)) for stage in STAGES.values())


def test_with_changes_what_is_named_and_nothing_else():
    config = presets.paper().with_(dwell_s=0.2, tank_j=3.0)
    assert {name for name in STAGE_OF if value(config, name) != value(presets.paper(), name)} == {"dwell_s", "tank_j"}
    assert (config.detection.dwell_s, config.limits.tank_j) == (0.2, 3.0)


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("dwel_s", "did you mean 'dwell_s'?"), ("xyz", "choose from " + ", ".join(STAGE_OF))],
)
def test_unknown_parameter(name, remedy):
    with pytest.raises(InvalidInputError) as caught:
        presets.paper().with_(**{name: 1.0})
    assert str(caught.value) == f"parameter '{name}' is unknown; {remedy}"


def test_every_parameter_is_declared_with_a_sentence():
    for stage in STAGES.values():
        for field in fields(stage):
            assert declaration(field).doc.strip()


def test_every_value_of_safe_differs_from_the_papers_and_has_its_reason():
    for name, (chosen, reason) in presets.SAFE.items():
        assert value(presets.safe(), name) == chosen != value(presets.paper(), name)
        assert len(reason.split()) > 2
