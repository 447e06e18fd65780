"""Near a singularity Λ is damped, by as much as the arm's own size and weight call for."""

import copy
import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.control.plant import UNTOUCHED
from tests.robot.worlds import ELBOW, OWN_SCENE

from contactsafe import Controller, Measurement, Target, presets, robots
from contactsafe.control.laws import task_inertia
from contactsafe.robot.mobility import best_mobility

STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)


def six():
    return robots.from_mjcf(mujoco.MjModel.from_xml_string(OWN_SCENE), site="tip")


def heavier(arm, times):
    """Give the same arm of another density, its motors as much stronger."""
    model = copy.copy(arm.model)
    model.body_mass[:] *= times
    model.body_inertia[:] *= times
    model.dof_armature[:] *= times
    model.actuator_ctrlrange[:] *= times
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return replace(arm, model=model, tau_max=times * arm.tau_max, torque_rate_max=times * arm.torque_rate_max)


def lambda_at(arm, q):
    """Give Λ as the arm's controller has it at q, (6, 6)."""
    params, now = Controller(arm).record["params"], arm.dynamics(q, np.zeros(arm.n))
    floor, damping = (
        float(params["impedance"]["manipulability_floor"]),
        float(params["impedance"]["manipulability_damping"]),
    )
    return task_inertia(now["J"].copy(), now["M_inv"].copy(), floor, damping)[0]


def wrist_turned(arm, wrist):
    """Give the home posture with another angle of the fifth joint; at zero the fourth and the sixth are one."""
    q = arm.home.copy()
    q[4] = wrist
    return q


@pytest.mark.parametrize("times", [0.1, 10.0])
@pytest.mark.parametrize("wrist", [0.0, 0.05, -1.0], ids=["singular", "near", "far"])
def test_task_inertia_is_proportional_to_the_arms_density(times, wrist):
    """As M is: the damping is neither too much for a light arm nor too little for a heavy one."""
    arm = six()
    q = wrist_turned(arm, wrist)
    assert_allclose(lambda_at(heavier(arm, times), q), times * lambda_at(arm, q), rtol=1e-6, atol=1e-9 * times)


def test_floor_and_damping_of_the_panda(panda):
    """w₀ and λ² as they were before they became fractions of the arm's own."""
    params = Controller(panda).record["params"]
    assert_allclose(params["impedance"]["manipulability_floor"], 0.01, rtol=0.01)
    assert_allclose(params["impedance"]["manipulability_damping"], 0.05, rtol=0.01)


def test_best_mobility_is_reached_nearly_and_hardly_exceeded(panda):
    """det(J M⁻¹ Jᵀ) over other random postures: none above 1.2 times the best, one above 0.7 times."""
    rng = np.random.default_rng(7)
    for arm in (panda, six()):
        best, seen = best_mobility(arm), []
        for q in rng.uniform(arm.q_min, arm.q_max, (300, arm.n)):
            now = arm.dynamics(q, np.zeros(arm.n))
            seen.append(np.linalg.det(now["J"] @ now["M_inv"] @ now["J"].T))
        assert best.directions == 6
        assert 0.7 < max(seen) / best.mean**6 < 1.2


def test_arm_of_two_joints_is_damped_everywhere():
    """Its floor is infinite, and no eigenvalue of Λ exceeds 1/λ²."""
    arm = robots.from_mjcf(mujoco.MjModel.from_xml_string(ELBOW), site="tip")
    assert best_mobility(arm).directions == 2
    params = Controller(arm).record["params"]
    assert params["impedance"]["manipulability_floor"] == math.inf
    for q in ([0.0, 0.0], [0.5, -1.0]):
        largest = np.linalg.eigvalsh(lambda_at(arm, np.array(q)))[-1]
        assert_allclose(largest * params["impedance"]["manipulability_damping"], 1.0, rtol=1e-9)


@pytest.mark.parametrize("name", ["safe", "paper"])
@pytest.mark.parametrize("times", [0.2, 1.0, 5.0])
def test_six_joint_arm_goes_through_its_wrist_singularity(name, times):
    """The tool turns with the wrist from −0.6 to 0.6 rad in two seconds: no joint races, and the tool arrives."""
    arm = heavier(six(), times)
    model, data = arm.model, mujoco.MjData(arm.model)
    start, ticks = wrist_turned(arm, -0.6), 3000
    data.qpos[:] = start
    controller = Controller(arm, presets.by_name(name))
    controller.reset(start)
    speed, error = np.zeros(ticks), np.zeros(ticks)
    for k in range(ticks):
        done = min(k / 2000, 1.0)
        q = wrist_turned(arm, -0.6 + 1.2 * done**2 * (3.0 - 2.0 * done))
        target = Target(arm.tool_pose(q), STIFFNESS, posture=q)
        out = controller.step(Measurement(data.qpos, data.qvel, UNTOUCHED), target)
        data.ctrl[:] = out.torque
        mujoco.mj_step(model, data)
        speed[k], error[k] = np.abs(data.qvel).max(), np.linalg.norm(out.error)
        assert np.all(np.abs(out.torque) <= arm.tau_max)
    assert out.fault == "none"
    assert speed.max() < 1.5
    assert error.max() < 0.15
    assert error[-1] < 1e-3
