"""Capsules and tip lie where MuJoCo puts the geoms of the generated model."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.description import Tip
from contactsafe.robot.franka import HAND, WIPER
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.panda import PANDA
from contactsafe.robot.shape import arm_capsules, tip_corners

PEG = replace(HAND, name="hand with peg", tcp=(0.0, 0.0, 0.15), tip=Tip((0.01, 0.01, 0.03), "cylinder"))


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
        sign = np.sign(np.sum(axis * length, axis=1, keepdims=True))  # MuJoCo may run a capsule in the other direction
        np.testing.assert_allclose(length, sign * axis, atol=1e-9)


@pytest.mark.parametrize("tool", [WIPER, PEG], ids=["box", "cylinder"])
def test_tip_is_mujocos(postures, tool):
    model = mujoco.MjModel.from_xml_string(arm_mjcf(PANDA, tool))
    data = mujoco.MjData(model)
    corners = tip_corners(PANDA, tool, postures)
    for i, q in enumerate(postures):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        geom = data.geom("tip")
        local = (corners[i] - geom.xpos) @ geom.xmat.reshape(3, 3)
        np.testing.assert_allclose(local.mean(axis=(0, 1)), 0.0, atol=1e-9)
        np.testing.assert_allclose(local[..., 2], np.outer([1, -1], np.full(local.shape[1], tool.tip.half_size[2])))
        across = np.abs(local[..., :2])
        if tool.tip.shape == "box":
            np.testing.assert_allclose(across, np.broadcast_to(tool.tip.half_size[:2], across.shape))
        else:
            np.testing.assert_allclose(np.linalg.norm(across, axis=-1), tool.tip.half_size[0])


def test_wrong_shape_is_refused():
    with pytest.raises(InvalidInputError, match=r"q has shape \(7,\); give F × 7 joint positions, one row a posture"):
        arm_capsules(PANDA, WIPER, np.zeros(7))


def test_tool_without_a_tip_is_refused():
    with pytest.raises(InvalidInputError, match="tool 'franka hand' has no tip"):
        tip_corners(PANDA, HAND, np.zeros((1, 7)))
