"""What must hold of any arm's dynamics, whoever computes them."""

import copy

import mujoco
import numpy as np
from numpy.testing import assert_allclose

from contactsafe.robot.dynamics import dynamics_dtype, mass_regressor, update_dynamics


def test_inertia_is_symmetric_and_positive_definite(states):
    for arm, q, qd in states:
        M = arm.dynamics(q, qd)["M"]
        assert_allclose(M, M.T, rtol=0, atol=1e-14)
        assert np.linalg.eigvalsh(M)[0] > 0


def test_inverse_inertia(states):
    for arm, q, qd in states:
        now = arm.dynamics(q, qd)
        assert_allclose(now["M"] @ now["M_inv"], np.eye(arm.n), rtol=0, atol=1e-10)


def test_inertia_changes_as_the_coriolis_terms_say(states):
    """Ṁ q̇ = C q̇ + Cᵀ q̇: what the momentum observer rests on."""
    for arm, q, qd in states:
        h = 1e-5
        M_dot = (arm.dynamics(q + h * qd, qd)["M"] - arm.dynamics(q - h * qd, qd)["M"]) / (2 * h)
        now = arm.dynamics(q, qd)
        assert_allclose(M_dot @ qd, now["c"] + now["CT_qd"], rtol=0, atol=1e-7)


def test_coriolis_torque_does_no_work_beyond_the_change_of_inertia(states):
    """q̇ᵀ (Ṁ − 2C) q̇ = 0, here q̇ᵀ C q̇ = q̇ᵀ Cᵀ q̇."""
    for arm, q, qd in states:
        now = arm.dynamics(q, qd)
        assert_allclose(qd @ now["c"], qd @ now["CT_qd"], rtol=0, atol=1e-10)


def test_tool_velocity_is_jacobian_times_joint_velocity(states):
    for arm, q, qd in states:
        now = arm.dynamics(q, qd)
        assert_allclose(now["velocity"], now["J"] @ qd, rtol=0, atol=1e-13)


def test_tool_velocity_is_the_change_of_the_tool_frame(states):
    for arm, q, qd in states:
        h = 1e-6
        now, later, earlier = (arm.dynamics(q + s * h * qd, qd) for s in (0, 1, -1))
        spin = (later["rotation"] - earlier["rotation"]) / (2 * h) @ now["rotation"].T
        turning = [spin[2, 1], spin[0, 2], spin[1, 0]]
        assert_allclose(now["velocity"][:3], (later["position"] - earlier["position"]) / (2 * h), rtol=0, atol=1e-8)
        assert_allclose(now["velocity"][3:], turning, rtol=0, atol=1e-8)


def test_jacobian_rate_is_the_change_of_the_jacobian(states):
    for arm, q, qd in states:
        h = 1e-6
        J_dot = (arm.dynamics(q + h * qd, qd)["J"] - arm.dynamics(q - h * qd, qd)["J"]) / (2 * h)
        assert_allclose(arm.dynamics(q, qd)["Jdot_qd"], J_dot @ qd, rtol=0, atol=1e-7)


def test_nothing_coriolis_at_rest(states):
    for arm, q, _ in states:
        still = arm.dynamics(q, np.zeros(arm.n))
        assert_allclose(still["c"], 0, atol=1e-12)
        assert_allclose(still["CT_qd"], 0, atol=0)
        assert_allclose(still["Jdot_qd"], 0, atol=0)


def test_gravity_is_the_slope_of_potential_energy(states):
    for arm, q, qd in states:
        h = 1e-6
        g = [(_potential(arm, q + h * e) - _potential(arm, q - h * e)) / (2 * h) for e in np.eye(arm.n)]
        assert_allclose(arm.dynamics(q, qd)["g"], g, rtol=0, atol=1e-6)


def _potential(arm, q):
    data = mujoco.MjData(arm.model)
    data.qpos[:] = q
    mujoco.mj_kinematics(arm.model, data)
    return -float(np.sum(arm.model.body_mass[:, None] * data.xipos * arm.model.opt.gravity))


def test_dynamics_survive_the_end_of_the_model_they_were_asked_of(panda):
    """Reading through a freed MjData once gave another arm's numbers, or a crash."""
    q, qd = panda.home, np.full(panda.n, 0.3)
    first, pose = panda.dynamics(q, qd), panda.tool_pose(q)
    for _ in range(200):
        panda.dynamics(panda.q_min, qd)
        assert panda.dynamics(q, qd) == first
        assert_allclose(panda.tool_pose(q).position, pose.position, rtol=0, atol=0)


def test_mass_regressor_is_the_slope_of_gravity_torque_over_each_links_mass(states):
    """Columns: links 1 to n, and last all that the last link carries as bodies of its own."""
    for arm, q, _ in states[::5]:
        nominal, out = arm.nominal(), np.zeros((arm.n, arm.n + 1))
        update_dynamics(nominal.handle, q, np.zeros(arm.n), np.zeros(1, dtype=dynamics_dtype(arm.n))[0])
        mass_regressor(nominal.handle, out)
        first = int(arm.model.jnt_bodyid[0])
        for column in range(arm.n + 1):
            bodies = slice(first + column, first + column + 1 if column < arm.n else arm.model.nbody)
            g = []
            for sign in (1.0, -1.0):
                model = copy.deepcopy(arm.model)
                model.body_mass[bodies] *= 1.0 + sign * 1e-3
                data = mujoco.MjData(model)
                data.qpos[:] = q
                mujoco.mj_forward(model, data)
                g.append(data.qfrc_bias.copy())
            assert_allclose(out[:, column], (g[0] - g[1]) / 2e-3, rtol=0, atol=1e-9)
