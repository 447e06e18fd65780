"""Without a force sensor: what a tool feels never shows in the null space, and its line passes near the tool."""

import numpy as np
import pytest
from tests.control.plant import Plant, controller_at, hold, reach, wrist_meets_sphere

from contactsafe import Measurement, presets

SAFE = presets.safe().with_(friction_compensation=False)


def wipe(arm, force, config=SAFE, ticks=2000):
    """Wipe in a figure of eight, a board's reaction at the tool, 0.3 of it against the motion; yield the outputs."""
    plant, controller = Plant(arm), controller_at(arm, config)
    for k in range(ticks):
        if k % 17 == 0:
            t = 2 * np.pi * k / 1000
            target = reach(arm, [0.05 * np.sin(t / 2), 0.08 * np.sin(t), 0.0])
        out = controller.step(Measurement(plant.q, plant.qd), target)
        J, wrench = controller.record["dynamics"]["J"], np.zeros(6)
        velocity = (J @ plant.qd)[:2]
        wrench[2] = force * min(1.0, k / 50)
        wrench[:2] = -0.3 * wrench[2] * velocity / max(np.linalg.norm(velocity), 0.01)
        plant.step(out.torque + J.T @ wrench)
        yield out, controller


@pytest.mark.parametrize("force", [8.0, 20.0, 40.0])
def test_board_under_the_tool_is_no_contact_of_the_arm(panda, force):
    """Torques of the tool of 4 N m and more; what is held against the threshold is 0.05 N m.

    Until the noise is known the detecting filters are slower, and it is 0.07 N m.
    """
    felt, held = 0.0, []
    for out, controller in wipe(panda, force):
        assert not out.contact.in_contact
        felt = max(felt, np.abs(out.contact.torque).max())
        held.append(np.abs(controller.record["state"]["detection"]["residual"]).max())
    assert felt > 0.2 * force
    assert max(held[200:]) < 0.05
    assert max(held) < 0.1


def test_board_under_the_tool_is_a_contact_to_the_paper(panda):
    """Its residual is not told apart where the sensor's wrench is not to be cancelled."""
    config = SAFE.with_(cancel_tool_wrench=False)
    assert any(out.contact.in_contact for out, _ in wipe(panda, 20.0, config, 500))


@pytest.mark.parametrize("force", [(0.0, 25.0, 0.0), (0.0, -25.0, 0.0)])
def test_contact_with_a_share_in_the_null_space_is_one_of_the_arm_and_held_against(panda, force):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 100)
    before = plant.tool_position()
    plant.push("link4", force)
    out = plant.run(controller, hold(panda), 1500)
    assert out.contact.in_contact
    assert out.contact.kind == "push"
    assert np.linalg.norm(plant.tool_position() - before) < 0.010


def test_contact_of_the_arm_is_found_while_the_tool_wipes(panda):
    """What the board exerts is remembered as the tool's and not taken for the arm's contact."""
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    still, wrench = hold(panda), np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    for k in range(1500):
        if k == 700:
            plant.push("link4", (0.0, 30.0, 0.0))
        out = controller.step(Measurement(plant.q, plant.qd), still)
        J = controller.record["dynamics"]["J"].copy()
        plant.step(out.torque + J.T @ wrench)
        assert k >= 700 or not out.contact.in_contact
        if k == 730:
            torque = controller.record["state"]["tool_wrench"]["arm_torque_fast"].copy()
            truth = plant.push_torque()
    assert out.contact.in_contact
    assert np.linalg.norm(torque - truth) < 0.35 * np.linalg.norm(truth)


LIKE_A_TOUCH = pytest.mark.xfail(
    strict=True,
    reason="a push whose line passes within 16 cm of the tool (8 cm and 2 N m at 25 N) counts as a touch of the tool, "
    "and nothing compensates those: 25 N downwards move the tool 25 mm (link 5) and 35 mm (link 6), as the impedance "
    "lets it; 2.6 and 5.0 mm with a sensor",
)


@pytest.mark.parametrize(
    ("body", "force"),
    [
        ("link4", (25.0, 0.0, 0.0)),
        ("link5", (0.0, 25.0, 0.0)),
        ("link5", (25.0, 0.0, 0.0)),
        ("link6", (0.0, 25.0, 0.0)),
        pytest.param("link5", (0.0, 0.0, -25.0), marks=LIKE_A_TOUCH),
        pytest.param("link6", (0.0, 0.0, -25.0), marks=LIKE_A_TOUCH),
    ],
)
def test_lasting_push_anywhere_on_the_arm_is_held_against(panda, body, force):
    """By little in the null space, but its line passes far from the tool: within 4.2 mm, as with a sensor."""
    plant, controller, still, away = Plant(panda), controller_at(panda, SAFE), hold(panda), []
    plant.run(controller, still, 200)  # the noise is measured first
    before = plant.tool_position()
    plant.push(body, force)
    for _ in range(3000):
        plant.run(controller, still, 1)
        away.append(np.linalg.norm(plant.tool_position() - before))
    assert max(away) < 0.010


@pytest.mark.parametrize("body", ["link5", "link6"])
def test_push_that_looks_like_a_touch_of_the_tool_does_not_carry_the_arm_away(panda, body):
    """Resisted with the 20 N that a tool may press with it was 71 and 149 mm away after 3 s, and went on."""
    away = {}
    for name, config in (("safe", SAFE), ("vices", presets.vices().with_(friction_compensation=False))):
        plant, controller, still = Plant(panda), controller_at(panda, config), hold(panda)
        plant.run(controller, still, 200)
        before = plant.tool_position()
        plant.push(body, (0.0, 0.0, -25.0))
        plant.run(controller, still, 2000)
        away[name] = np.linalg.norm(plant.tool_position() - before)
        later = plant.tool_position()
        plant.run(controller, still, 1000)
        assert np.linalg.norm(plant.tool_position() - later) < 0.001
    assert away["safe"] < 1.2 * away["vices"] + 0.002


def test_obstacle_before_the_wrist_is_pressed_no_harder_than_one_before_the_tool(panda):
    """12.8 N, where the task alone presses 24 N; 3.8 N with a sensor."""
    plant = wrist_meets_sphere(panda, 0.04, 2000.0)
    controller, start = controller_at(panda, SAFE), plant.tool_position()[1]
    for k in range(120):
        offset = min(0.25, 0.125 * k / 60, plant.tool_position()[1] - start + 0.05)
        plant.run(controller, reach(panda, [0.0, offset, 0.0]), 17)
    assert np.linalg.norm(plant.data.qfrc_constraint[7:10]) < SAFE.reaction.tool_force_limit_n
