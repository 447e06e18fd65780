"""What an arm puts on its base, against MuJoCo's own momentum and what its sensors show under the base."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.robot.worlds import TWO_JOINTS

from contactsafe import robots
from contactsafe.core.compiled import compiled
from contactsafe.robot import base_dynamics
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics

ARMS = {"panda": robots.panda(), "of a scene": robots.from_mjcf(mujoco.MjModel.from_xml_string(TWO_JOINTS), "tip")}
arms = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)


@compiled
def _fill(handles, qd, momentum, weight, regressor):
    base_dynamics.arm_momentum_into(handles[0], qd, momentum)
    base_dynamics.arm_weight_into(handles[0], weight)
    base_dynamics.weight_moment_regressor(handles[0], regressor)


def of(arm, q, qd):
    """Give momentum, weight and regressor of an arm in motion."""
    nominal, found = arm.nominal(), (np.zeros(6), np.zeros(6), np.zeros((3, arm.n + 1)))
    update_dynamics(nominal.handle, q, qd, np.zeros(1, dynamics_dtype(arm.n))[0])
    _fill(np.array([nominal.handle]), qd, *found)
    return found


def state_of(arm, seed):
    rng = np.random.default_rng(seed)
    return arm.home + rng.uniform(-0.6, 0.6, arm.n), rng.normal(0.0, 1.0, arm.n)


@arms
@given(seed=st.integers(0, 10_000))
def test_momentum_is_that_of_every_body(arm, seed):
    q, qd = state_of(arm, seed)
    data = mujoco.MjData(arm.model)
    data.qpos[:], data.qvel[:] = q, qd
    mujoco.mj_forward(arm.model, data)
    momentum, velocity = np.zeros(6), np.zeros(6)
    for body in range(1, arm.model.nbody):
        mujoco.mj_objectVelocity(arm.model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        omega, p = velocity[:3], arm.model.body_mass[body] * velocity[3:]
        R = data.ximat[body].reshape(3, 3)
        momentum[:3] += p
        momentum[3:] += R @ (arm.model.body_inertia[body] * (R.T @ omega)) + np.cross(data.xipos[body], p)
    assert_allclose(of(arm, q, qd)[0], momentum, rtol=1e-9, atol=1e-9)


@arms
@given(seed=st.integers(0, 10_000))
def test_weight_is_that_of_every_body_and_the_regressor_adds_up_to_its_moment(arm, seed):
    q, qd = state_of(arm, seed)
    data = mujoco.MjData(arm.model)
    data.qpos[:] = q
    mujoco.mj_kinematics(arm.model, data)
    forces = arm.model.body_mass[1:, None] * arm.model.opt.gravity
    moments = np.cross(data.xipos[1:], forces)
    _, weight, regressor = of(arm, q, qd)
    assert_allclose(weight, np.concatenate([forces.sum(axis=0), moments.sum(axis=0)]), rtol=1e-9, atol=1e-9)
    first = arm.model.jnt_bodyid[0] - 1  # what is fixed before the first joint is no link's
    assert_allclose(regressor.sum(axis=1), moments[first:].sum(axis=0), rtol=1e-9, atol=1e-9)
