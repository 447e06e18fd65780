"""Yield to what the arm ran into, hold against what pushes it; and never push an obstacle harder than the bound."""

from dataclasses import replace

import numpy as np
import pytest
from tests.control.plant import Plant, controller_at, hold, reach, wrist_meets_sphere

from contactsafe import presets
from contactsafe.control.laws import push_along

SAFE = replace(presets.safe(), friction_compensation=False)


def collision(panda, stiffness):
    """Send the tool sideways by 25 cm, 5 cm ahead at most, the wrist against a sphere; yield what happens each tick."""
    plant = wrist_meets_sphere(panda, 0.04, stiffness)
    controller = controller_at(panda, SAFE)
    start = plant.tool_position()[1]
    for k in range(120):
        ahead = min(0.25, 0.125 * k / 60, plant.tool_position()[1] - start + 0.05)
        target = reach(panda, [0.0, ahead, 0.0])
        for _ in range(17):
            out = plant.run(controller, target, 1)
            yield out, controller, plant


@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_arm_that_ran_into_a_spring_yields(panda, stiffness):
    outs = [out.contact for out, _, _ in collision(panda, stiffness)]
    assert any(contact.in_contact for contact in outs)
    assert not any(contact.holding for contact in outs)


@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_command_never_pushes_an_obstacle_harder_than_the_bound(panda, stiffness):
    """Torque less c and g, along the contact; damping into the contact comes on top and only makes it less.

    Left out are ticks in which the torque rate was the limit: the bound is reached as fast as that allows.
    """
    pushes = []
    for out, controller, _ in collision(panda, stiffness):
        if out.contact.in_contact and not out.contact.holding and not out.limited:
            now, state = controller.record["dynamics"], controller.record["state"]
            net = out.torque - now["c"] - now["g"]
            pushes.append(push_along(state["direction"].copy(), now["M_inv"].copy(), net))
    assert len(pushes) > 300
    assert max(pushes) <= SAFE.push_yield_nm + 1e-9
    assert max(pushes) > 0.99 * SAFE.push_yield_nm


@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_steady_torque_of_an_obstacle_is_the_bound(panda, stiffness):
    """Slowly giving way, the arm feels from the obstacle what it pushes it with: 3 N m, however stiff it is."""
    *_, (_, _, plant) = collision(panda, stiffness)
    truth = np.linalg.norm(plant.data.qfrc_constraint[:7])
    assert truth == pytest.approx(SAFE.push_yield_nm, rel=0.02)


@pytest.mark.parametrize("body", ["link4", "link5"])
@pytest.mark.parametrize("force", [(0.0, 25.0, 0.0), (0.0, -25.0, 0.0), (25.0, 0.0, 0.0)])
def test_lasting_push_is_held_against(panda, body, force):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 100)
    before = plant.tool_position()
    plant.push(body, force)
    out = plant.run(controller, hold(panda), 1500)
    assert out.contact.in_contact
    assert out.contact.holding
    assert np.abs(plant.tool_position() - before).max() < 0.010
