"""Arms of fewer than six joints: the tool's position, and the orientation nearest to the one asked for."""

import mujoco
import numpy as np
import pytest
from tests.control.plant import UNTOUCHED, Plant, controller_at
from tests.robot.worlds import OWN_SCENE

from contactsafe import Measurement, Pose, Target, presets, robots
from contactsafe.core.errors import UnreachableError
from contactsafe.core.rotation import orientation_error, quat_to_matrix
from contactsafe.robot.ik import InverseKinematics, finite_range
from contactsafe.robot.posture import POSITION_TOLERANCE

K = np.array([200.0] * 3 + [300.0] * 3)


@pytest.fixture(scope="module", params=[3, 4, 5])
def arm(request):
    """The own scene's arm with its last joints locked."""
    model = mujoco.MjModel.from_xml_string(OWN_SCENE)
    names = [model.joint(i).name for i in range(request.param)]
    with pytest.warns(match="takes the orientation nearest"):
        return robots.from_mjcf(model, site="tip", joints=names)


def moved(pose, offset):
    return Pose(pose.position + offset, pose.quat)


def test_straight_moves_raised_unreachable_error(arm):
    """10 cm along a line of poses of one orientation, in 2 s."""
    plant = Plant(arm)
    controller, start = controller_at(arm, presets.safe()), arm.tool_pose(arm.home)
    move = np.array([-0.06, 0.0, -0.08])
    for k in range(3000):
        target = Target(moved(start, min(k / 2000, 1.0) * move), K)
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), target)
        plant.step(out.torque)
    assert np.linalg.norm(plant.tool_position() - (start.position + move)) < 0.002
    assert np.abs(out.error).max() < 0.01  # it is asked for no rotation that it cannot have
    assert str(out.fault) == "none"


def turned(arm, pose, quat):
    """Return how far a pose is turned from an orientation, rad."""
    return float(np.linalg.norm(orientation_error(quat, quat_to_matrix(pose.quat))))


def test_of_the_orientations_at_the_position_the_nearest_is_taken(arm):
    """No posture with the tool at the position turns it nearer, of those that lead there from it step by step."""
    ik, rng = InverseKinematics(arm), np.random.default_rng(0)
    asked = Pose(arm.tool_pose(arm.home + 0.2).position, arm.tool_pose(arm.home - 0.1).quat)
    q = ik.posture(asked)
    assert np.linalg.norm(arm.tool_pose(q).position - asked.position) <= POSITION_TOLERANCE
    nearest = turned(arm, arm.tool_pose(q), asked.quat)
    for _ in range(20):
        beside = arm.tool_pose(q + rng.choice([0.1, 0.3]) * rng.normal(size=arm.n))
        other = ik.solve(Pose(asked.position, beside.quat), q)
        assert turned(arm, arm.tool_pose(other), asked.quat) > nearest - 0.003


def test_an_orientation_that_the_arm_has_was_missed_by_half_a_radian(arm):
    """A pose that it can have in full: nearly always found, whichever joints it was made by."""
    ik, rng = InverseKinematics(arm), np.random.default_rng(3)
    low, high = finite_range(arm.q_min, arm.q_max)
    off = []
    for _ in range(100):
        pose = arm.tool_pose(rng.uniform(0.9 * low, 0.9 * high))
        try:
            off.append(turned(arm, arm.tool_pose(ik.posture(pose)), pose.quat))
        except UnreachableError:
            off.append(np.inf)
    assert np.mean(np.array(off) < 0.01) > 0.9


def test_a_posture_that_was_given_does_not_turn_the_tool(arm):
    """It says where the joints are to be if they can; the orientation asked for is that of the pose."""
    plant = Plant(arm)
    controller, start = controller_at(arm, presets.safe()), arm.tool_pose(arm.home)
    target = Target(moved(start, np.array([-0.05, 0.0, -0.05])), K, posture=arm.home)
    plant.run(controller, target, 1500, UNTOUCHED)
    assert np.linalg.norm(plant.tool_position() - target.pose.position) < 0.002
    best = arm.tool_pose(InverseKinematics(arm).posture(target.pose))
    reached = arm.tool_pose(plant.q)
    assert turned(arm, reached, start.quat) < turned(arm, best, start.quat) + 0.02


def test_out_of_reach_is_refused_with_the_distance_alone(arm):
    ik, home = InverseKinematics(arm), arm.tool_pose(arm.home)
    with pytest.raises(UnreachableError, match=r"the nearest found is \d+\.\d mm away, allowed is 0\.1 mm; move it"):
        ik.solve(moved(home, np.array([0.0, 0.0, 3.0])))
    with pytest.raises(UnreachableError, match="no posture within reach"):
        ik.posture(moved(home, np.array([0.0, 0.0, 3.0])))


def test_a_direction_of_no_stiffness_is_let_go(panda):
    """A torque about the tool's axis turns it away; the position stays, and other turns do."""
    plant, controller = Plant(panda), controller_at(panda, presets.vices())
    target = Target(panda.tool_pose(panda.home), np.array([200.0, 200.0, 200.0, 400.0, 400.0, 0.0]))
    last = panda.model.site_bodyid[panda.model.site(panda.site).id]
    plant.data.xfrc_applied[last, 5] = 0.5
    out = plant.run(controller, target, 2000, UNTOUCHED)
    assert abs(out.error[5]) > 0.3
    assert np.linalg.norm(out.error[:3]) < 0.01
    assert np.abs(out.error[3:5]).max() < 0.1


def test_a_direction_that_was_let_go_stays_so_where_no_target_comes(panda):
    """It has no place to come to, and what held it is not a number."""
    plant, controller = Plant(panda), controller_at(panda, presets.safe().with_(friction_compensation=False))
    start = panda.tool_pose(panda.home)
    target = Target(moved(start, np.array([0.05, 0.0, 0.0])), np.array([200.0, 0.0, 200.0, 400.0, 400.0, 0.0]))
    out = plant.run(controller, target, 60, UNTOUCHED)
    out = plant.run(controller, None, 1500, UNTOUCHED)
    assert out.target_late
    assert np.isfinite(out.torque).all()
    assert np.abs(plant.qd).max() < 0.1
