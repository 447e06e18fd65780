"""The controller refuses at the door what it cannot mean, and says what to do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import STIFFNESS, Plant, controller_at, hold, reach

from contactsafe import Controller, Measurement, Pose, Target, presets
from contactsafe.control.records import controller_dtype
from contactsafe.core.errors import InvalidInputError, UnreachableError

OUTSIDE = "is outside [10, 1500] and not 0; scale it or widen stiffness_range of the ControllerConfig"


@pytest.fixture(scope="module")
def controller(panda):
    return controller_at(panda, presets.safe())


def refusal(call, *arguments, error=InvalidInputError):
    with pytest.raises(error) as caught:
        call(*arguments)
    return str(caught.value)


def test_arm_of_the_wrong_kind():
    assert refusal(Controller, "panda") == "arm is str; give an Arm such as contactsafe.robots.panda()"


@pytest.mark.parametrize("given", [None, (np.zeros(7), np.zeros(7)), "still"])
def test_measurement_of_the_wrong_kind(panda, controller, given):
    assert refusal(controller.step, given).endswith("give a contactsafe.Measurement")


@pytest.mark.parametrize(
    "given", [("pose", STIFFNESS), Target(None, STIFFNESS), Target(([0, 0, 0], [1, 0, 0, 0]), STIFFNESS)]
)
def test_target_of_the_wrong_kind(panda, controller, given):
    assert "give a contactsafe." in refusal(controller.step, Measurement(panda.home, np.zeros(7)), given)


@pytest.mark.parametrize("index", [-1, 2, 1.5, [0], None])
def test_a_place_that_is_not_there(panda, index):
    records = np.zeros(2, dtype=controller_dtype(7))
    assert "is no place in 2 records" in refusal(Controller, panda, None, records, index)


def test_records_that_no_controller_can_live_in(panda):
    frozen = np.zeros(2, dtype=controller_dtype(7))
    frozen.flags.writeable = False
    for records in (frozen, np.zeros((1, 2), dtype=controller_dtype(7)), np.zeros(2, dtype=controller_dtype(6)), []):
        assert "controller_dtype(7)" in refusal(Controller, panda, None, records)


def test_config_of_the_wrong_kind(panda):
    text = "config is str; give a ControllerConfig such as contactsafe.presets.safe()"
    assert refusal(Controller, panda, "safe") == text


def test_reset_holds_the_pose_with_the_stiffness_that_is_given_and_knows_where_the_tool_is(panda):
    made, stiffness = Controller(panda), np.array([100.0, 200.0, 300.0, 400.0, 500.0, 600.0])
    made.reset(panda.home, stiffness=stiffness)
    for held in (made.record["target"], made.record["state"]["target"]):
        assert_array_equal(held["K_task"], stiffness)
        assert_array_equal(held["D_task"], 2.0 * np.sqrt(stiffness))
    assert_allclose(made.record["output"]["position"], panda.tool_pose(panda.home).position, rtol=0, atol=1e-12)
    made.reset(panda.home)
    assert_array_equal(made.record["target"]["K_task"], np.full(6, 150.0))


def test_reset_with_a_stiffness_that_is_not_allowed(panda):
    text = f"stiffness[0] = 2000 1/s² {OUTSIDE}"
    assert refusal(Controller(panda).reset, panda.home, None, None, np.full(6, 2000.0)) == text
    assert refusal(Controller(panda).reset, panda.home, None, None, 200.0).startswith("stiffness has shape ()")


def test_step_before_reset(panda):
    text = "the controller was not reset; call reset(q) with the measured joint positions first"
    assert refusal(Controller(panda).step, Measurement(panda.home, np.zeros(7)), hold(panda)) == text


@pytest.mark.parametrize(
    ("q", "text"),
    [
        (np.zeros(6), "q has shape (6,); give 7 finite numbers"),
        (np.full(7, np.nan), "q[0] = nan; every number must be finite"),
        (
            np.zeros(7),
            "q[3] = 0.0000 rad, joint 'joint4', is 0.0698 rad above its limit -0.0698; 0.02 is tolerated: "
            "move the joint back by hand or in the robot's own mode, or correct the arm's range",
        ),
        (
            np.array([0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0]),
            "q[1] = -45.0000 rad, joint 'joint2', is 43.2372 rad below its limit -1.7628; 0.02 is tolerated: "
            "these are degrees, give radians",
        ),
    ],
)
def test_reset_at_what_is_no_posture(panda, q, text):
    assert refusal(Controller(panda).reset, q) == text


@pytest.mark.parametrize("past", [1e-9, 0.002, 0.0199])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_joint_that_stands_a_little_past_its_limit_is_no_obstacle(panda, past, side):
    """Simulators' limits are soft and encoders are off; the joint is brought back, the command does not jump."""
    q = panda.home.copy()
    q[3] = panda.q_max[3] + past if side > 0 else panda.q_min[3] - past
    plant, controller = Plant(panda, q), controller_at(panda, presets.safe(), q)
    torques = [panda.dynamics(q, np.zeros(7))["g"]]
    plant.run(controller, hold(panda, q), 1000, each=lambda out: torques.append(out.torque))
    assert (
        np.abs(np.diff(torques, axis=0)).max() <= float(controller.record["params"]["one_tick"]["torque_step"]) + 1e-9
    )
    assert panda.q_min[3] - 1e-3 < plant.q[3] < panda.q_max[3] + 1e-3


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"q": np.zeros(6)}, "q has shape (6,); give 7 numbers"),
        ({"qd": 0.0}, "qd has shape (); give 7 numbers"),
        ({"wrench_ee": np.zeros(3)}, "wrench_ee has shape (3,); give 6 numbers"),
        ({"q": "up"}, "q is str, not numbers; give 7 numbers"),
        ({"q": np.ones(7) * 1j}, "q is ndarray, not numbers; give 7 numbers"),
        ({"qd": [[0.0], 1.0]}, "qd is list, not numbers; give 7 numbers"),
        ({"time": 10**400}, "time is int, not a number; give seconds"),
    ],
)
def test_measurement_of_the_wrong_shape(panda, controller, changed, text):
    measurement = Measurement(panda.home, np.zeros(7))._replace(**changed)
    assert refusal(controller.step, measurement, hold(panda)) == text


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"stiffness": 150.0}, "stiffness has shape (); give 6 finite numbers"),
        ({"stiffness": np.full(6, np.nan)}, "stiffness[0] = nan; every number must be finite"),
        (
            {"stiffness": [150, 150, 4000, 150, 150, 150]},
            f"stiffness[2] = 4000 1/s² {OUTSIDE}",
        ),
        (
            {"damping": [1, 20, 20, 20, 20, 20]},
            "damping[0] = 1 1/s is outside [2, 120]; scale it or widen damping_range of the ControllerConfig",
        ),
        ({"damping": "soft"}, "damping is str, not numbers; give 6 finite numbers"),
        ({"posture": np.zeros(6)}, "posture has shape (6,); give 7 finite numbers"),
        ({"pose": Pose(np.zeros(2), [1, 0, 0, 0])}, "pose.position has shape (2,); give 3 finite numbers"),
        (
            {"pose": Pose(np.array([0.4, 0.0, 0.4]), np.array([0.0, 2.0, 0.0, 0.0]))},
            "pose.quat has length 2; give a unit quaternion w x y z (divide by its length)",
        ),
    ],
)
def test_target_that_means_nothing_leaves_the_last_one_in_force(panda, controller, changed, text):
    controller.set_target(hold(panda))
    before = controller.record["target"].copy()
    target = hold(panda)._replace(**changed)
    assert refusal(controller.step, Measurement(panda.home, np.zeros(7)), target) == text
    assert controller.record["target"] == before


def changeable(panda):
    """Make a target of arrays and lists that may be changed in place."""
    pose = Pose(np.array([0.4, 0.0, 0.4]), np.array([0.0, 1.0, 0.0, 0.0]))
    return Target(pose, [150.0] * 6, np.full(6, 25.0), panda.home.copy())


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("position", lambda target: target.pose.position.__setitem__(0, 0.41)),
        ("quat", lambda target: target.pose.quat.__setitem__(slice(None), (0.0, 0.0, 1.0, 0.0))),
        ("K_task", lambda target: target.stiffness.__setitem__(2, 90.0)),
        ("D_task", lambda target: target.damping.__imul__(1.1)),
        ("q_posture", lambda target: target.posture.__iadd__(0.01)),
    ],
)
def test_a_target_that_is_changed_in_place_is_taken(panda, field, change):
    controller, target = controller_at(panda, presets.safe()), changeable(panda)
    measured = Measurement(panda.home, np.zeros(7))
    controller.step(measured, target)
    before = controller.record["target"].copy()
    change(target)
    controller.step(measured, target)
    changed = {
        name for name in before.dtype.names if not np.array_equal(before[name], controller.record["target"][name])
    }
    assert changed == {field}


def test_a_target_that_is_changed_in_place_is_checked_at_every_step(panda):
    controller, target = controller_at(panda, presets.safe()), changeable(panda)
    measured = Measurement(panda.home, np.zeros(7))
    controller.step(measured, target)
    before = controller.record["target"].copy()
    target.pose.position[1] = np.nan
    for _ in range(2):
        text = refusal(controller.step, measured, target)
        assert text == "pose.position[1] = nan; every number must be finite"
    assert controller.record["target"] == before
    target.pose.position[1] = 0.0
    controller.step(measured, target)


def test_a_target_that_stays_as_it_is_costs_no_search(panda, monkeypatch):
    controller, target = controller_at(panda, presets.safe()), changeable(panda)._replace(posture=None)
    measured = Measurement(panda.home, np.zeros(7))
    controller.step(measured, target)
    monkeypatch.setattr(controller._ik, "posture_near", lambda *asked: pytest.fail("it was searched again"))
    controller.step(measured, target)
    controller.step(measured, target._replace(pose=Pose(target.pose.position.copy(), target.pose.quat.copy())))


@pytest.mark.parametrize(
    ("posture", "told"),
    [(np.full(7, 5.0), "give one within the range"), ("degrees", "these are degrees, give radians")],
)
def test_a_posture_that_the_arm_cannot_have(panda, controller, posture, told):
    posture = np.degrees(panda.home) if isinstance(posture, str) else posture
    text = refusal(controller.step, Measurement(panda.home, np.zeros(7)), hold(panda)._replace(posture=posture))
    assert text.startswith("posture[")
    assert text.endswith(told)


def test_a_speed_that_the_arm_cannot_have_at_reset(panda, controller):
    assert "faster than this arm gets" in refusal(controller.reset, panda.home, np.full(7, 100.0))


def test_pose_out_of_reach_without_a_posture(panda, controller):
    far = Target(Pose(np.array([3.0, 0.0, 0.5]), np.array([0.0, 1.0, 0.0, 0.0])), STIFFNESS)
    text = refusal(controller.set_target, far, error=UnreachableError)
    assert text == (
        "pose at [3.000, 0.000, 0.500] m has no posture within reach of home's, or none at all; move it "
        "towards the arm, turn it, or give a posture of your own, such as InverseKinematics.solve may find"
    )


def test_pose_out_of_reach_with_a_posture_is_only_a_direction(panda, controller):
    far = Target(Pose(np.array([3.0, 0.0, 0.5]), np.array([0.0, 1.0, 0.0, 0.0])), STIFFNESS, posture=panda.home)
    assert np.isfinite(controller.step(Measurement(panda.home, np.zeros(7)), far).torque).all()


def test_posture_comes_from_inverse_kinematics_where_none_is_given(panda):
    controller = controller_at(panda, presets.safe())
    target = reach(panda, [0.05, 0.1, -0.05])._replace(posture=None)
    controller.set_target(target)
    posture = controller.record["target"]["q_posture"]
    assert np.linalg.norm(panda.tool_pose(posture).position - target.pose.position) < 1e-4
    assert np.abs(posture - panda.home).max() < 1.0


def test_damping_is_critical_where_none_is_given(panda, controller):
    K = np.array([10.0, 25.0, 100.0, 400.0, 900.0, 1500.0])
    controller.set_target(hold(panda)._replace(stiffness=K))
    assert_allclose(controller.record["target"]["D_task"], 2 * np.sqrt(K), rtol=1e-15)


def test_quaternion_sign_and_small_errors_of_length_do_not_matter(panda):
    torques = []
    for scale in (1.0, -1.0, 1.0009):
        controller, target = controller_at(panda, presets.safe()), hold(panda)
        target = target._replace(pose=Pose(target.pose.position, scale * target.pose.quat))
        torques.append(controller.step(Measurement(panda.home, np.zeros(7)), target).torque)
    assert_allclose(torques[1:], [torques[0]] * 2, rtol=0, atol=1e-9)


def test_output_is_a_copy(panda):
    controller = controller_at(panda, presets.safe())
    first = controller.step(Measurement(panda.home, np.zeros(7)), hold(panda))
    kept = first.torque.copy()
    controller.step(Measurement(panda.home, np.full(7, 0.5)), hold(panda))
    assert_array_equal(first.torque, kept)


def test_default_is_safe(panda):
    assert Controller(panda).config == presets.safe()


def test_nothing_is_made_for_seven_joints_only(six_joint_arm):
    """Six joints, a user's own model without description, no null space: it holds, follows, and feels a push."""
    arm = six_joint_arm
    plant, controller = Plant(arm), controller_at(arm, presets.safe())
    plant.run(controller, hold(arm), 200)
    assert_allclose(plant.q, arm.home, rtol=0, atol=1e-9)
    target = reach(arm, [0.03, -0.02, -0.03])._replace(posture=None)
    out = plant.run(controller, target, 1500)
    assert_allclose(out.error, 0, atol=1e-3)
    assert out.torque.shape == out.residual.shape == (6,)
    assert not out.contact.in_contact
    body = int(arm.model.jnt_bodyid[3])
    plant.push(body, (0.0, 20.0, 0.0))
    out = plant.run(controller, target, 200)
    assert out.contact.in_contact
    assert out.contact.link >= 1
    assert np.dot(out.contact.torque, plant.push_torque()) > 0
    assert controller.record["params"]["impedance"]["K_posture"].tolist() == [40, 40, 40, 40, 30, 20]
