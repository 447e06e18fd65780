"""Dynamics against Pinocchio, which shares no code with MuJoCo and reads the URDF: so this checks the URDF too."""

import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from contactsafe.robot.urdf import arm_urdf

WORLD = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
TIGHT = {"rtol": 0.0, "atol": 1e-9}


@pytest.fixture(scope="module")
def models(arms):
    return {arm.name: pinocchio.buildModelFromXML(arm_urdf(arm.description, arm.tool)) for arm in arms}


@pytest.fixture(scope="module")
def cases(models, states):
    """Pinocchio's model, q, qd, and what we make of them; rotor inertia, which URDF cannot say, is added by hand."""
    found = []
    for arm, q, qd in states:
        model = models[arm.name]
        model.armature = arm.description.joint_array("armature")
        found.append((model, q, qd, arm.dynamics(q, qd)))
    return found


def test_inertia(cases):
    for model, q, _, ours in cases:
        M = pinocchio.crba(model, model.createData(), q)
        M = np.triu(M) + np.triu(M, 1).T
        assert_allclose(ours["M"], M, **TIGHT)


def test_gravity(cases):
    for model, q, _, ours in cases:
        assert_allclose(ours["g"], pinocchio.computeGeneralizedGravity(model, model.createData(), q), **TIGHT)


def test_coriolis_torque_and_its_transpose(cases):
    for model, q, qd, ours in cases:
        C = pinocchio.computeCoriolisMatrix(model, model.createData(), q, qd)
        assert_allclose(ours["c"], C @ qd, **TIGHT)
        assert_allclose(ours["CT_qd"], C.T @ qd, **TIGHT)


def test_tool_frame_jacobian_and_its_rate(cases):
    for model, q, qd, ours in cases:
        data, frame = model.createData(), model.getFrameId("tcp")
        pinocchio.forwardKinematics(model, data, q, qd, np.zeros(model.nv))
        placement = pinocchio.updateFramePlacement(model, data, frame)
        assert_allclose(ours["position"], placement.translation, **TIGHT)
        assert_allclose(ours["rotation"], placement.rotation, **TIGHT)
        assert_allclose(ours["J"], pinocchio.computeFrameJacobian(model, data, q, frame, WORLD), **TIGHT)
        pinocchio.forwardKinematics(model, data, q, qd, np.zeros(model.nv))
        rate = pinocchio.getFrameClassicalAcceleration(model, data, frame, WORLD)
        assert_allclose(ours["Jdot_qd"], rate.vector, **TIGHT)
