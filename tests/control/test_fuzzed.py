"""Whatever is asked and whatever happens to the arm: finite, within torque, torque rate and the joints' range."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.control.plant import UNTOUCHED, Plant, controller_at
from tests.control.targets import corner_target, disturb, fuzzed_target

from contactsafe import Measurement, Target, presets
from contactsafe.control.controller import Controller
from contactsafe.control.tick import tick_at

SAFE = presets.safe()


def all_finite(record):
    return all(np.isfinite(record[name]).all() for name in ("torque", "residual", "residual_fast", "error"))


def test_thirty_thousand_ticks_of_random_targets_and_pushes(panda):
    """A target every 17 ticks that has nothing to do with where the arm is; pushes up to 50 N; sensor there or not."""
    rng, plant = np.random.default_rng(7), Plant(panda)
    controller, target = controller_at(panda, SAFE), None
    before, contacts, held = panda.dynamics(panda.home, np.zeros(7))["g"], 0, 0
    for k in range(30000):
        target = disturb(k, 17, panda, plant, rng, target)
        if k % 2000 == 0:
            wrench = None if rng.random() < 0.5 else UNTOUCHED
        out = controller.step(Measurement(plant.q, plant.qd, wrench), target)
        assert all_finite(controller.record["output"])
        assert (np.abs(out.torque) <= panda.tau_max).all()
        assert np.abs(out.torque - before).max() <= 1.0
        before = out.torque
        contacts += out.contact.in_contact
        held += out.contact.kind == "push"
        plant.step(out.torque)
    assert contacts > 1000
    assert held > 100
    assert np.isfinite(plant.q).all()
    assert out.fault == "none"


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_state_gives_a_finite_torque_within_its_limits(panda, seed):
    """Measurements that no plant would give: joints jump anywhere from tick to tick, at any speed, under any wrench.

    After a first one at rest.
    """
    rng = np.random.default_rng(seed)
    records = np.zeros(1, dtype=Controller(panda, SAFE).record.dtype)
    controller = controller_at(panda, SAFE, records=records)
    before = controller.step(Measurement(panda.home, np.zeros(7)), fuzzed_target(panda, rng)).torque
    for _ in range(60):
        controller.set_target(fuzzed_target(panda, rng))
        measured = records[0]["measurement"]
        measured["q"] = rng.uniform(panda.q_min, panda.q_max) * rng.choice([1.0, 1.5])
        measured["qd"] = rng.normal(size=7) * 10.0 ** rng.uniform(-3, 3)
        measured["wrench_ee"] = rng.normal(size=6) * 10.0 ** rng.uniform(-2, 4)
        measured["has_wrench"] = rng.integers(2)
        tick_at(records, 0)
        torque = records[0]["output"]["torque"].copy()
        assert all_finite(records[0]["output"])
        assert (np.abs(torque) <= panda.tau_max).all()
        assert np.abs(torque - before).max() <= 1.0
        state = records[0]["state"]
        assert 0.0 <= state["reaction"]["task_scale"] <= 1.0
        assert np.isfinite(state["link_masses"]["mass_error"]).all()
        assert np.isfinite(state["detection"]["threshold"]).all()
        before = torque


def test_first_measurement_at_speed_gives_a_torque_within_its_limits(panda):
    rng = np.random.default_rng(3)
    for _ in range(20):
        q, qd = rng.uniform(panda.q_min, panda.q_max), rng.uniform(-25.0, 25.0, 7)
        out = controller_at(panda, SAFE, q).step(Measurement(q, qd, UNTOUCHED), fuzzed_target(panda, rng))
        assert (np.abs(out.torque) <= panda.tau_max).all()


def beyond_range(arm, stiffness, damping, every, seed, ticks=4000):
    """Drive all joints into corners of their range; give by how much one went beyond, rad; negative: none did."""
    rng, plant, beyond = np.random.default_rng(seed), Plant(arm), -np.inf
    controller = controller_at(arm, SAFE.with_(friction_compensation=False))
    for k in range(ticks):
        if k % every == 0:
            target = corner_target(arm, rng, stiffness, damping)
        plant.run(controller, target, 1, UNTOUCHED)
        beyond = max(beyond, (arm.q_min - plant.q).max(), (plant.q - arm.q_max).max())
    return beyond


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("side", [-1, 1])
def test_one_joint_driven_at_its_limit_stays_inside(panda, joint, side):
    """Posture and pose at the end of its range, the other joints where they are; gains of the default."""
    q = panda.home.copy()
    q[joint] = (panda.q_min, panda.q_max)[(side + 1) // 2][joint]
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    target, least = Target(panda.tool_pose(q), np.full(6, 150.0), posture=q), np.inf
    for _ in range(4000):
        plant.run(controller, target, 1, UNTOUCHED)
        least = min(least, (plant.q - panda.q_min).min(), (panda.q_max - plant.q).min())
    assert least > 0.0


@pytest.mark.parametrize(("stiffness", "damping"), [(150.0, 24.5), (1500.0, 77.4), (1500.0, 2.0)])
@pytest.mark.parametrize("every", [300, 1000])
def test_joints_driven_into_corners_stay_inside(panda, stiffness, damping, every):
    """All seven at once, each at a limit, soft and stiff, damped and hardly damped."""
    assert max(beyond_range(panda, stiffness, damping, every, seed) for seed in range(2)) < 0.0
