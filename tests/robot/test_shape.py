"""Capsules and tip lie where MuJoCo puts the geoms of the generated model."""

import mujoco
import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.franka import HAND, WIPER
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.panda import PANDA
from contactsafe.robot.shape import arm_capsules, tip_box


@pytest.fixture(scope="module")
def postures():
    low, high = PANDA.joint_array("q_min"), PANDA.joint_array("q_max")
    return np.random.default_rng(0).uniform(low, high, (25, 7))


@pytest.mark.parametrize("tool", [WIPER, HAND], ids=["wiper", "hand"])
def test_capsules_are_mujocos(postures, tool):
    model = mujoco.MjModel.from_xml_string(arm_mjcf(PANDA, tool))
    data = mujoco.MjData(model)
    geoms = [i for i in range(model.ngeom) if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    starts, ends, radii, links = arm_capsules(PANDA, tool, postures)
    assert starts.shape == ends.shape == (25, len(geoms), 3)
    np.testing.assert_allclose(radii, model.geom_size[geoms, 0])
    np.testing.assert_array_equal(links, model.geom_bodyid[geoms] - 1)  # body 1 is the base
    for i, q in enumerate(postures):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose((starts[i] + ends[i]) / 2, data.geom_xpos[geoms], atol=1e-9)
        axis = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :, 2] * model.geom_size[geoms, 1, None] * 2
        length = ends[i] - starts[i]
        sign = np.sign(np.sum(axis * length, axis=1, keepdims=True))  # MuJoCo may run a capsule the other way
        np.testing.assert_allclose(length, sign * axis, atol=1e-9)


def test_tip_is_mujocos(postures):
    model = mujoco.MjModel.from_xml_string(arm_mjcf(PANDA, WIPER))
    data = mujoco.MjData(model)
    centre, half, rotation = tip_box(PANDA, WIPER, postures)
    np.testing.assert_allclose(half, model.geom("tip").size)
    for i, q in enumerate(postures):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(centre[i], data.geom("tip").xpos, atol=1e-9)
        np.testing.assert_allclose(rotation[i], data.geom("tip").xmat.reshape(3, 3), atol=1e-9)


def test_wrong_shape_is_refused():
    with pytest.raises(InvalidInputError, match=r"q has shape \(7,\); give F × 7 joint positions, one row a posture"):
        arm_capsules(PANDA, WIPER, np.zeros(7))


def test_tool_without_a_box_for_a_tip_is_refused():
    with pytest.raises(InvalidInputError, match="tool 'franka hand' has no box for a tip"):
        tip_box(PANDA, HAND, np.zeros((1, 7)))
