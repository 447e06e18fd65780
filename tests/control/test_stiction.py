"""Friction that a file declares is overcome in the direction of the command, by no more than it is, and no contact."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from tests.control.plant import Plant, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.control.impedance import OVERCOME_FRACTION, overcome_friction
from contactsafe.core.compiled import compiled

SAFE = presets.safe()
DRY_NM = 0.8


@compiled
def _overcome(elastic, qd, c):
    overcome_friction(elastic, qd, c.state.impedance.K_task, c.params.arm)


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
    """Move the tool of an arm that 3 N m of friction hold, without a sensor, pushed or not; return the force felt, N."""
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


@pytest.mark.parametrize("asked", [-5.0, -0.3, 0.2, 3.0])
def test_what_is_added_has_the_commands_direction_and_is_no_more_than_the_friction(panda, asked):
    controller = controller_at(declared(panda, DRY_NM), SAFE)
    elastic = np.full(panda.n, asked)
    _overcome(elastic, np.zeros(panda.n), controller.record)
    added = elastic - asked
    assert (added * asked > 0.0).all()
    assert (np.abs(added) <= OVERCOME_FRACTION * DRY_NM + 1e-12).all()


def test_nothing_is_added_in_fast_motion_or_where_nothing_is_declared(panda):
    fast = np.full(panda.n, 10.0)
    for arm, qd in ((declared(panda, DRY_NM), fast), (panda, np.zeros(panda.n))):
        elastic = np.full(panda.n, 2.0)
        _overcome(elastic, qd, controller_at(arm, SAFE).record)
        np.testing.assert_allclose(elastic, 2.0, atol=1e-6)


def test_arm_that_holds_still_and_has_the_friction_stays(panda):
    arm = declared(panda, DRY_NM)
    plant, controller = Plant(arm, model=copy.deepcopy(arm.model)), controller_at(arm, SAFE)
    plant.model.dof_frictionloss[:] = DRY_NM
    before = plant.tool_position()
    for _ in range(500):
        plant.step(controller.step(Measurement(plant.q, plant.qd), hold(arm)).torque)
    assert np.linalg.norm(plant.tool_position() - before) < 0.001
