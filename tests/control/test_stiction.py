"""Friction that a file declares is overcome in the direction of the command, by no more than it is, and no contact."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.control.codes import COMPLY, FREE
from contactsafe.control.impedance import MOST_GAIN, friction_gain, overcome_friction
from contactsafe.core.compiled import compiled
from contactsafe.robot.friction import DRY_STEEP

SAFE = presets.safe()
DRY_NM = 0.8


@compiled
def _overcome(elastic, task, qd, gain, c):
    overcome_friction(elastic, task, qd, gain, c.params.arm)


@compiled
def _gain(K_task, D_task, delay_s):
    return friction_gain(K_task, D_task, delay_s)


def declared(arm, dry_nm):
    """Return an arm whose file declares so much dry friction on every joint."""
    return replace(arm, friction=np.zeros((arm.n, 3)), friction_unknown=np.tile([0.0, dry_nm], (arm.n, 1)))


def off_after_a_move(arm, config):
    """Move the tool of an arm with that friction by 2 cm; return how far off it ends, m."""
    plant = Plant(arm, model=copy.deepcopy(arm.model))
    plant.model.dof_frictionloss[:] = DRY_NM
    controller, target = controller_at(arm, config), reach(arm, [0.0, 0.02, 0.0])
    plant.run(controller, target, 2500)
    return np.linalg.norm(plant.tool_position() - target.pose.position)


def test_tool_ends_nearer_to_its_target(panda):
    arm = declared(panda, DRY_NM)
    stuck = off_after_a_move(arm, SAFE.with_(friction_compensation=False))
    assert stuck > 0.003
    assert off_after_a_move(arm, SAFE) < 0.25 * stuck


def test_stiction_that_holds_the_arm_still_is_no_contact(panda):
    arm = declared(panda, DRY_NM)
    plant = Plant(arm, model=copy.deepcopy(arm.model))
    plant.model.dof_frictionloss[:] = DRY_NM
    controller, target, seen = controller_at(arm, SAFE), reach(arm, [0.0, 0.02, 0.0]), []
    plant.run(controller, target, 1500, each=lambda out: seen.append(out.contact.in_contact))
    assert not any(seen)


def tool_force_after_a_move(panda, pushed_n):
    """Move the tool of an arm with 3 N m of friction, without a sensor, pushed or not; return the force felt, N."""
    arm, felt = declared(panda, 3.0), []
    plant = Plant(arm, model=copy.deepcopy(arm.model))
    plant.model.dof_frictionloss[:] = 3.0
    plant.push("link7", [0.0, 0.0, pushed_n])
    controller, force = controller_at(arm, SAFE), lambda: controller.record["state"]["tool_wrench"]["force"]
    plant.run(controller, reach(arm, [0.0, 0.02, 0.0]), 1000, each=lambda out: felt.append(np.linalg.norm(force())))
    return max(felt)


def test_stiction_is_no_force_on_the_tool(panda):
    """It once was, and the task was let go for it: tools ended centimetres off."""
    assert tool_force_after_a_move(panda, 0.0) < SAFE.classification.tool_contact_n
    assert tool_force_after_a_move(panda, 80.0) > SAFE.classification.tool_contact_n


@pytest.mark.parametrize("gain", [0.0, 2.0, 9.0])
def test_what_is_added_has_the_tasks_direction_and_with_compensation_is_no_more_than_the_friction(panda, gain):
    rng = np.random.default_rng(4)
    viscous, dry = rng.uniform(0.0, 5.0, 7), rng.uniform(0.0, 2.0, 7)
    drag = np.column_stack([np.zeros(7), np.zeros(7), rng.uniform(0.0, 0.8, 7) * dry])
    arm = replace(panda, friction=np.zeros((7, 3)), drag=drag, friction_unknown=np.column_stack([viscous, dry]))
    record = controller_at(arm, SAFE).record
    for _ in range(200):
        qd, task, posture = rng.normal(0.0, 0.3, 7), rng.normal(0.0, 0.3, 7), rng.normal(0.0, 1.0, 7)
        elastic = task + posture
        _overcome(elastic, task, qd, gain, record)
        added = elastic - task - posture
        compensated = drag[:, 2] * np.tanh(0.5 * DRY_STEEP * np.abs(qd))
        assert (added * task >= -1e-12).all()
        assert (np.abs(added) <= gain * np.abs(task) + 1e-12).all()
        assert (np.abs(added) + compensated <= viscous * np.abs(qd) + dry + 1e-12).all()


def test_nothing_is_added_in_fast_motion_or_where_nothing_is_declared(panda):
    fast = np.full(panda.n, 10.0)
    for arm, qd in ((declared(panda, DRY_NM), fast), (panda, np.zeros(panda.n))):
        elastic = np.full(panda.n, 2.0)
        _overcome(elastic, elastic.copy(), qd, MOST_GAIN, controller_at(arm, SAFE).record)
        np.testing.assert_allclose(elastic, 2.0, atol=1e-6)


@pytest.mark.parametrize(("stiffness", "damping"), [(150.0, 24.0), (450.0, 42.0), (1500.0, 10.0), (450.0, 2.0)])
def test_small_errors_are_met_with_no_more_than_the_loops_delay_allows(stiffness, damping):
    K, D, delay_s = np.full(6, stiffness), np.full(6, damping), 0.002
    gain = _gain(K, D, delay_s)
    assert 0.0 <= gain <= MOST_GAIN
    assert gain == 0.0 or damping >= 2.0 * delay_s * (1.0 + gain) * stiffness * (1.0 - 1e-9)
    K[0] = 0.0  # a direction that was let go
    assert _gain(K, D, delay_s) == gain


def commanded(arm, mode, offset):
    """Return the torque of the first tick in a mode that asks for the home pose moved by an offset, (n,), N m."""
    plant, controller = Plant(arm), controller_at(arm, SAFE)
    plant.run(controller, hold(arm), 5, UNTOUCHED)
    state = controller.record["state"]
    state["mode"], state["detection"]["quiet_ticks"], state["detection"]["contact_ticks"] = mode, 0, 0
    return controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), reach(arm, offset)).torque


def test_nothing_is_added_while_something_touches_the_arm(panda):
    """Friction acts against what is pushed then, not against the task: arms with friction were moved further."""
    offset = [0.0, 0.002, 0.0]
    sticks, smooth = declared(panda, 3.0), declared(panda, 0.0)
    added = {mode: commanded(sticks, mode, offset) - commanded(smooth, mode, offset) for mode in (FREE, COMPLY)}
    asked = commanded(smooth, COMPLY, offset) - commanded(smooth, COMPLY, [0.0, 0.0, 0.0])
    assert np.abs(added[FREE]).max() > 0.1
    assert np.abs(asked).max() > 0.1  # of which a multiple would be added
    assert np.abs(added[COMPLY]).max() < 1e-9


def test_arm_that_holds_still_and_has_the_friction_stays(panda):
    arm = declared(panda, DRY_NM)
    plant, controller = Plant(arm, model=copy.deepcopy(arm.model)), controller_at(arm, SAFE)
    plant.model.dof_frictionloss[:] = DRY_NM
    before = plant.tool_position()
    for _ in range(500):
        plant.step(controller.step(Measurement(plant.q, plant.qd), hold(arm)).torque)
    assert np.linalg.norm(plant.tool_position() - before) < 0.001
