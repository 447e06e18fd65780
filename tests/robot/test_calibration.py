"""A calibration is written and read back to the bit, and an arm that has it is what was identified."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe import ContactEstimator, Measurement, Payload, robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.calibrated import arm_for, can_carry, is_body
from contactsafe.robot.calibration import Calibration, Losses
from contactsafe.robot.description import Inertia
from contactsafe.robot.friction import joint_drag, joint_friction

RNG = np.random.default_rng(0)
LOAD = Payload(0.7, np.array([0.01, 0.02, 0.03]), np.diag([1e-3, 1.1e-3, 1.2e-3]))


def losses(seed=0):
    rng = np.random.default_rng(seed)
    bias, viscous, coulomb = rng.normal(size=7), rng.random(7), rng.random(7)
    return Losses(bias, viscous, coulomb, 0.5 * coulomb, 12.0 + 0.0 * bias, 0.01 * bias)


def known(**changes):
    everything = {
        "robot": "panda",
        "tool": "franka hand",
        "torque_noise": RNG.random(7),
        "velocity_noise": RNG.random(7),
        "stiction": np.where(np.arange(7) == 2, np.nan, 0.5),
        "losses": losses(),
        "rotor": 0.1 + RNG.random(7),
        "sensor": losses(1),
        "payload": LOAD,
        "source": "log.csv",
    }
    return Calibration(**{**everything, **changes})


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


@pytest.mark.parametrize("changes", [{}, {"losses": None, "rotor": None}, {"sensor": None}, {"payload": None}])
def test_it_reads_back_as_it_was(tmp_path, changes):
    written = known(**changes)
    written.save(tmp_path / "robot.json")
    read = Calibration.load(tmp_path / "robot.json")
    assert read.as_dict() == written.as_dict()
    assert_array_equal(read.stiction, written.stiction)


def test_the_file_is_plain_json_with_units(tmp_path):
    known().save(tmp_path / "robot.json")
    found = json.loads((tmp_path / "robot.json").read_text(encoding="utf-8"))
    assert found["payload"]["mass_kg"] == LOAD.mass
    assert set(found["losses"]) == {
        "bias_nm", "viscous_nm_s_rad", "dry_nm", "smooth_nm", "steep_s_rad", "shift_rad_s",
    }  # fmt: skip
    assert found["stiction_nm"][2] is None


@pytest.mark.parametrize("content", ["", "{}", "[1]", "null", '{"format": "other"}', "\x00", "[" * 100_000])
def test_another_file_is_told_in_one_line(tmp_path, content):
    (tmp_path / "robot.json").write_text(content, encoding="utf-8")
    with pytest.raises(InvalidInputError, match="is no calibration; give what `contactsafe identify` wrote") as caught:
        Calibration.load(tmp_path / "robot.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rotor_kg_m2", [1.0]),
        ("torque_noise_nm", "much"),
        ("losses", {"bias_nm": [0.0] * 7}),
        ("payload", {"mass_kg": 1.0, "com_m": [0.0], "inertia_kg_m2": []}),
        ("sensor", 3),
        ("payload", {"mass_kg": None, "com_m": [0.0] * 3, "inertia_kg_m2": [0.0] * 9}),
        ("velocity_noise_rad_s", [float("inf")] * 7),
    ],
)
def test_a_damaged_one_is_told_in_one_line(tmp_path, name, value):
    found = known().as_dict() | {name: value}
    (tmp_path / "robot.json").write_text(json.dumps(found), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"calibration.*identify anew|calibration.*give 7 numbers") as caught:
        Calibration.load(tmp_path / "robot.json")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InvalidInputError, match="cannot be read"):
        Calibration.load(tmp_path / "none.json")


def test_an_arm_takes_all_of_it(arm, tmp_path):
    one = known()
    one.save(tmp_path / "robot.json")
    found = robots.calibrated(arm, tmp_path / "robot.json")
    qd = RNG.normal(size=7)
    step = np.tanh(6.0 * (qd + one.losses.shift)) - np.tanh(6.0 * one.losses.shift)
    lost = one.losses.bias + one.losses.viscous * qd + one.losses.smooth * step + one.losses.dry * np.tanh(20.0 * qd)
    assert_allclose(one.losses.at(qd), lost)
    assert_allclose(joint_drag(found.friction, found.drag, qd), lost)
    assert_allclose(found.model.dof_armature, one.rotor)
    assert_allclose(found.model.body_mass.sum(), arm.model.body_mass.sum() + LOAD.mass)
    assert_allclose(found.description.links[-1].inertia.mass, arm.description.links[-1].inertia.mass + LOAD.mass)


def test_what_was_not_identified_stays(arm):
    found = robots.calibrated(arm, known(losses=None, rotor=None, sensor=None, payload=None))
    assert_array_equal(found.friction, arm.friction)
    assert_array_equal(found.model.dof_armature, arm.model.dof_armature)
    assert_array_equal(found.model.body_mass, arm.model.body_mass)
    assert not found.sensor_drag.any()


def test_the_payload_stays_with_its_tool():
    other = robots.calibrated(robots.panda("wiper"), known())
    assert_allclose(other.model.body_mass.sum(), robots.panda("wiper").model.body_mass.sum())


def test_another_robot_is_refused():
    with pytest.raises(InvalidInputError, match="is of 'panda' with 7 joints, the arm is 'fr3' with 7"):
        robots.calibrated(robots.fr3("hand"), known())


def test_an_arm_is_not_calibrated_twice(arm):
    """The payload would count twice."""
    once = robots.calibrated(arm, known())
    assert once.calibrated
    assert not arm.calibrated
    with pytest.raises(InvalidInputError, match="arm 'panda' is calibrated already, and a payload would count twice"):
        robots.calibrated(once, known())


@pytest.mark.parametrize("name", ["torque_noise", "velocity_noise", "stiction"])
def test_negative_noise_is_refused(name):
    with pytest.raises(InvalidInputError, match=f"calibration: {name} has a negative number; identify anew"):
        known(**{name: np.full(7, -0.1)})


def test_a_payload_that_leaves_no_body_is_refused(arm):
    nothing = Payload(-9.0, np.zeros(3), np.zeros((3, 3)))
    assert not can_carry(arm, nothing)
    with pytest.raises(InvalidInputError, match="leaves the last link of 'panda' no body"):
        robots.calibrated(arm, known(payload=nothing))


def test_an_arm_is_chosen(arm):
    assert arm_for(None, lambda: arm) is arm
    assert arm_for(arm, robots.fr3) is arm
    assert_allclose(arm_for(known(), lambda: arm).model.dof_armature, known().rotor, atol=1.0)


def test_a_body_has_mass_and_moments():
    assert is_body(Inertia(1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)))
    assert not is_body(Inertia(1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 3.0, 0.0, 0.0, 0.0)))
    assert not is_body(Inertia(-1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)))


def test_no_drag_changes_no_bit(arm):
    for qd in (np.zeros(7), -np.zeros(7), RNG.normal(size=7), 1e-300 * RNG.normal(size=7)):
        plain, full = joint_friction(arm.friction, qd), joint_drag(arm.friction, np.zeros((7, 3)), qd)
        assert_array_equal(plain.view(np.int64), full.view(np.int64))


def test_the_estimator_takes_a_sensors_bias_off(arm):
    """A bias of 2 N m in one joint's sensor, and an estimator that was told and one that was not."""
    beside = replace(losses(1), bias=np.eye(7)[1] * 2.0, viscous=np.zeros(7), dry=np.zeros(7), smooth=np.zeros(7))
    told = robots.calibrated(arm, known(sensor=beside, payload=None, losses=None, rotor=None))
    torque = arm.dynamics(arm.home, np.zeros(7))["g"] + beside.bias
    shown = []
    for one in (arm, told):
        estimator = ContactEstimator(one)
        estimator.reset(arm.home)
        for _ in range(300):
            contact = estimator.step(Measurement(arm.home, np.zeros(7), np.zeros(6), torque=torque))
        shown.append(abs(contact.torque[1]))
    assert shown[0] > 0.1
    assert shown[1] < 1e-6


def test_dry_friction_at_rest_is_what_was_identified_and_no_more_than_the_file_says(arm):
    """A controller overcomes it at rest: more than there is would drive the joints."""
    declared = replace(arm, friction_unknown=np.tile([0.1, 0.8], (arm.n, 1)))
    stiction = np.array([0.5, 1.5, np.nan, 0.5, 0.5, 0.5, 0.5])
    found = robots.calibrated(declared, known(stiction=stiction))
    np.testing.assert_array_equal(found.friction_unknown[:, 1], [0.5, 0.8, 0.8, 0.5, 0.5, 0.5, 0.5])
    np.testing.assert_array_equal(found.friction_unknown[:, 0], 0.0)
