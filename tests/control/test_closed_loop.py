"""The laws on an arm that is exactly as modelled: what the equations promise is what it does."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.control.plant import STIFFNESS, UNTOUCHED, Plant, controller_at, hold, reach

from contactsafe import Pose, Target, presets
from contactsafe.control.laws import task_error
from contactsafe.core.rotation import quat_multiply, rotvec_to_quat

FREE = presets.vices().with_(friction_compensation=False)


def test_arm_at_rest_stays(panda):
    """Gravity is carried whole, its null-space fraction included."""
    for preset in (presets.vices(), presets.paper(), presets.safe()):
        plant, controller = Plant(panda), controller_at(panda, preset)
        plant.run(controller, hold(panda), 1000)
        assert_allclose(plant.q, panda.home, rtol=0, atol=1e-9)


def test_null_space_gravity_is_carried_without_any_posture_task(panda):
    config = FREE.with_(K_posture=(0.0,), D_posture=(0.0,))
    plant, controller = Plant(panda), controller_at(panda, config)
    plant.run(controller, hold(panda), 1000)
    assert_allclose(plant.q, panda.home, rtol=0, atol=1e-6)


@pytest.mark.parametrize("axis", range(3))
def test_step_in_position_is_a_critically_damped_second_order_response(quick_panda, axis):
    """x(t) = x_d − e₀ (1 + ω t) exp(−ω t), ω = √K, for every axis and whatever the inertia; the others do not move."""
    plant, controller = Plant(quick_panda), controller_at(quick_panda, FREE)
    offset, start, omega = 0.02 * np.eye(3)[axis], plant.tool_position(), np.sqrt(150.0)
    target = reach(quick_panda, offset)
    for k in range(1, 501):
        plant.run(controller, target, 1)
        if k % 50 == 0:
            t = 0.001 * k
            expected = offset * (1.0 - (1.0 + omega * t) * np.exp(-omega * t))
            moved = plant.tool_position() - start
            assert_allclose(moved, expected, rtol=0, atol=0.02 * 0.02)


def test_tool_accelerates_as_its_own_law_says(quick_panda):
    """ẍ = K e − D ẋ for each of six axes with its own gains, while the whole arm is moving."""
    plant = Plant(quick_panda)
    controller = controller_at(quick_panda, FREE)
    K, D = np.array([100.0, 200.0, 300.0, 150.0, 250.0, 350.0]), np.array([10.0, 20.0, 30.0, 15.0, 25.0, 35.0])
    position, quat = reach(quick_panda, [0.03, -0.05, 0.04]).pose
    quat = quat_multiply(rotvec_to_quat(np.array([0.1, -0.2, 0.15])), quat)
    target = Target(Pose(position, quat), K, D, posture=quick_panda.home + 0.2)
    for k in range(400):
        now = quick_panda.dynamics(plant.q, plant.qd)
        e = task_error(position, quat, now["position"].copy(), now["rotation"].copy())
        plant.run(controller, target, 1)
        acceleration = now["J"] @ plant.data.qacc + now["Jdot_qd"]
        assert_allclose(acceleration, K * e - D * now["velocity"], rtol=0, atol=1e-8, err_msg=f"tick {k}")


def test_posture_task_moves_the_joints_and_not_the_tool(quick_panda):
    plant, controller = Plant(quick_panda), controller_at(quick_panda, FREE)
    start = plant.tool_position()
    swung = hold(quick_panda)._replace(posture=quick_panda.home + np.array([0.8, 0, 0, 0, 0, 0, 0]))
    plant.run(controller, swung, 2000)
    assert np.abs(plant.q - quick_panda.home).max() > 0.15
    assert np.abs(plant.qd).max() < 0.02
    assert_allclose(plant.tool_position(), start, rtol=0, atol=1e-4)


def test_contact_law_cancels_what_the_residual_shows_and_nothing_else(quick_panda):
    """(18): a push on a link accelerates the tool by J M⁻¹ (τ_ext − residual) beyond K e − D ẋ, at every tick."""
    config = presets.paper().with_(friction_compensation=False, compensation_gain=50.0, detection_gain=50.0)
    plant, controller = Plant(quick_panda), controller_at(quick_panda, config)
    plant.push("link4", (0.0, 20.0, 0.0))
    still, K, D, in_contact = hold(quick_panda), 150.0, 2 * np.sqrt(150.0), 0
    for _ in range(200):  # later the null space, which nothing damps here, is near its speed limit
        now, truth = quick_panda.dynamics(plant.q, plant.qd), plant.push_torque()
        out = plant.run(controller, still, 1, UNTOUCHED)
        if out.contact.in_contact:
            in_contact += 1
            acceleration = now["J"] @ plant.data.qacc + now["Jdot_qd"]
            left = now["J"] @ now["M_inv"] @ (truth - out.residual)
            assert_allclose(acceleration, K * out.error - D * now["velocity"] + left, rtol=0, atol=1e-7)
    assert in_contact > 150


def test_joint_driven_outwards_stops_inside_its_range(panda):
    """The tool is asked to turn about its own axis, 0.3 rad from where it is, until joint 7 has no more to give."""
    plant, controller = Plant(panda), controller_at(panda, FREE)
    home, highest = panda.tool_pose(panda.home), 0.0
    for k in range(400):
        offset = min(0.01 * k, plant.q[6] - panda.home[6] + 0.3)
        quat = quat_multiply(home.quat, rotvec_to_quat(np.array([0.0, 0.0, offset])))
        plant.run(controller, Target(Pose(home.position, quat), STIFFNESS, posture=panda.home), 17)
        highest = max(highest, plant.q[6])
    assert panda.q_max[6] - 0.1 < highest < panda.q_max[6]
