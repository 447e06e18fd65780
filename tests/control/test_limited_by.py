"""The output says what took something off the task."""

import numpy as np
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold, reach, wrist_meets_sphere

from contactsafe import Measurement, presets

SAFE = presets.safe().with_(friction_compensation=False)


def test_at_rest_nothing_is_limited(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    for _ in range(200):
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), hold(panda))
        plant.step(out.torque)
        assert out.limited_by == ()


def test_a_tool_that_presses_too_hard_says_so(panda):
    """25 N lie on the tool, and the task would press against them with more than 20 N."""
    controller, wrench = controller_at(panda, SAFE), np.array([0.0, 0.0, 25.0, 0.0, 0.0, 0.0])
    for _ in range(300):
        out = controller.step(Measurement(panda.home, np.zeros(7), wrench), reach(panda, [0.0, 0.0, -0.1]))
    assert "tool force" in out.limited_by


def test_an_arm_that_ran_into_something_says_so(panda):
    plant, controller = wrist_meets_sphere(panda, 0.02, 5000.0), controller_at(panda, SAFE)
    seen = set()
    for _ in range(1500):
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), reach(panda, [0.0, 0.15, 0.0]))
        plant.step(out.torque)
        seen |= set(out.limited_by)
    assert out.contact.in_contact
    assert "contact" in seen


def test_a_jump_of_the_target_is_limited_by_the_torque_rate(panda):
    controller = controller_at(panda, presets.vices().with_(friction_compensation=False))
    out = controller.step(Measurement(panda.home, np.zeros(7), UNTOUCHED), reach(panda, [0.2, 0.0, 0.0]))
    assert out.limited_by == ("rate",)


def test_a_joint_within_its_margin_is_limited_by_its_range(panda):
    q = panda.home.copy()
    q[3] = panda.q_max[3] - 0.05
    controller = controller_at(panda, SAFE, q)
    out = controller.step(Measurement(q, np.zeros(7), UNTOUCHED), hold(panda, q))
    assert "range" in out.limited_by


def test_an_empty_tank_limits_by_energy(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE.with_(tank_j=0.05, tank_power_w=0.1))
    seen = set()
    for _ in range(600):
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), reach(panda, [0.1, 0.1, 0.1]))
        plant.step(out.torque)
        seen |= set(out.limited_by)
    assert "energy" in seen
