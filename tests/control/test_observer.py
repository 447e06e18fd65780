"""The residual is the torque that the environment exerts on the arm, in size and in sign."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.control.plant import Plant, controller_at, hold, reach, wrist_meets_sphere

from contactsafe import Measurement, presets
from contactsafe.control.laws import filter_gain, observer_step
from contactsafe.control.presets import PRESETS

VICES = presets.vices().with_(compensation_gain=50.0, residual_cutoff_hz=1e6, friction_compensation=False)


@given(st.floats(0.5, 300.0), st.floats(-20.0, 20.0))
def test_step_is_taken_up_exponentially_exactly_at_the_ticks(gain, tau):
    residual, fraction = np.zeros(1), filter_gain(gain, 0.001)
    for k in range(1, 301):
        observer_step(residual, fraction, np.array([tau]))
        assert_allclose(residual[0], tau * (1.0 - math.exp(-gain * 0.001 * k)), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("preset", PRESETS.values())
def test_controller_takes_a_step_up_as_its_gain_says(panda, preset):
    """An arm that stands still although g − τ is commanded is held by τ."""
    config = preset().with_(residual_cutoff_hz=math.inf, residual_noise_nm=math.inf)
    controller, still = controller_at(panda, config), Measurement(panda.home, np.zeros(7))
    controller.step(still, hold(panda))
    tau = np.array([1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0])
    for k in range(1, 200):
        controller.record["state"]["command"]["tau"] = controller.record["dynamics"]["g"] - tau
        out = controller.step(still, hold(panda))
        assert_allclose(
            out.residual, tau * (1 - math.exp(-config.observer.compensation_gain * 0.001 * k)), rtol=1e-9, atol=1e-9
        )
        trigger = tau * (1 - math.exp(-config.observer.detection_gain * 0.001 * k))
        assert_allclose(out.contact.torque, trigger, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("body", ["link4", "link5", "link6"])
@pytest.mark.parametrize("force", [(0.0, 25.0, 0.0), (-15.0, 0.0, 15.0)])
def test_push_on_a_link_shows_with_its_own_sign_and_size(panda, body, force):
    """Not minus it, as the paper's (2) as printed would have it. Joints beyond the link feel nothing."""
    plant, controller = Plant(panda), controller_at(panda, VICES)
    plant.push(body, force)
    out = plant.run(controller, hold(panda), 2500)
    truth = plant.push_torque()
    assert np.linalg.norm(truth) > 3.0
    assert_allclose(out.residual, truth, rtol=0, atol=0.01 * np.linalg.norm(truth))


def test_contact_with_a_sprung_obstacle_shows_as_what_the_spring_exerts(panda):
    """The wrist meets a sphere on 2 kN/m as the tool is sent sideways; force = stiffness × displacement."""
    plant, controller = wrist_meets_sphere(panda, 0.04, 2000.0), controller_at(panda, VICES)
    target = reach(panda, [0.0, 0.25, 0.0])
    out = plant.run(controller, target, 2500)
    truth = plant.data.qfrc_constraint[:7].copy()
    assert np.linalg.norm(truth) > 3.0
    assert_allclose(out.residual, truth, rtol=0, atol=0.01 * np.linalg.norm(truth))
    pushed = plant.data.qpos[7:]
    force = 2000.0 * pushed
    assert_allclose(plant.data.qfrc_constraint[7:], force, rtol=0, atol=0.02 * np.linalg.norm(force))


@pytest.mark.parametrize(("steps_per_tick", "allowed_nm"), [(1, 0.05), (10, 0.005)])
def test_free_motion_shows_nothing(panda, steps_per_tick, allowed_nm):
    """Exact model, up to the speed limit: what is left is the plant's integration error, and it falls with the step."""
    model = copy.deepcopy(panda.model)
    model.opt.timestep = 0.001 / steps_per_tick
    plant, controller = Plant(panda, model=model), controller_at(panda, VICES)
    seen, speed = [], 0.0
    for offset in ([0.07, 0.05, 0.05], [-0.02, -0.1, 0.0], [0.0, 0.0, 0.0]):
        target = reach(panda, offset)
        for _ in range(500):
            out = controller.step(Measurement(plant.q, plant.qd), target)
            for _ in range(steps_per_tick):
                plant.step(out.torque)
            seen.append(np.abs(out.residual).max())
            speed = max(speed, np.abs(plant.qd).max())
    assert 1.0 < speed < 2.175
    assert max(seen) < allowed_nm


@pytest.mark.parametrize("known", [True, False])
def test_wrench_at_the_tool_is_cancelled_where_it_is_measured(panda, known):
    F = np.array([5.0, -8.0, 12.0, 0.3, -0.2, 0.1])
    plant, controller = Plant(panda), controller_at(panda, VICES)
    still = hold(panda)
    for _ in range(1500):
        out = controller.step(Measurement(plant.q, plant.qd, F if known else None), still)
        tool_torque = panda.dynamics(plant.q, plant.qd)["J"].T @ F
        plant.step(out.torque + tool_torque)
    assert np.linalg.norm(tool_torque) > 5.0
    assert_allclose(out.residual, 0.0 if known else tool_torque, rtol=0, atol=0.01 * np.linalg.norm(tool_torque))


def test_wrench_is_kept_in_the_residual_where_asked(panda):
    F = np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    plant, controller = Plant(panda), controller_at(panda, VICES.with_(cancel_tool_wrench=False))
    still = hold(panda)
    for _ in range(1500):
        out = controller.step(Measurement(plant.q, plant.qd, F), still)
        tool_torque = panda.dynamics(plant.q, plant.qd)["J"].T @ F
        plant.step(out.torque + tool_torque)
    assert_allclose(out.residual, tool_torque, rtol=0, atol=0.01 * np.linalg.norm(tool_torque))
