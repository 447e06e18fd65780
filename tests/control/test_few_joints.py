"""Arms of fewer than six joints: the tool's position, and the orientation nearest to the one asked for."""

import mujoco
import numpy as np
import pytest
from tests.control.plant import UNTOUCHED, Plant, controller_at
from tests.robot.worlds import OWN_SCENE

from contactsafe import Measurement, Pose, Target, presets, robots
from contactsafe.core.errors import UnreachableError
from contactsafe.core.rotation import orientation_error, quat_to_matrix
from contactsafe.robot.ik import InverseKinematics
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


def test_of_the_orientations_at_the_position_the_nearest_is_taken(arm):
    """No other posture with the tool at the position, near by, turns it nearer."""
    ik, rng = InverseKinematics(arm), np.random.default_rng(0)
    asked = arm.tool_pose(arm.home + 0.2)
    asked = Pose(asked.position, arm.tool_pose(arm.home - 0.1).quat)
    q = ik.posture(asked)
    found = arm.tool_pose(q)
    assert np.linalg.norm(found.position - asked.position) <= POSITION_TOLERANCE

    def turn(pose):
        return np.linalg.norm(orientation_error(asked.quat, quat_to_matrix(pose.quat)))

    for _ in range(20):
        other = arm.tool_pose(q + 0.03 * rng.normal(size=arm.n))
        other = arm.tool_pose(ik.solve(Pose(asked.position, other.quat), q))
        assert turn(other) > turn(found) - 0.01


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
