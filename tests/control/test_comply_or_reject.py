"""Comply with obstacles, reject pushes, and never press with more than the bound in force."""

import numpy as np
import pytest
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold, reach, wrist_meets_sphere
from tests.control.targets import disturb

from contactsafe import presets
from contactsafe.control.codes import REJECT
from contactsafe.control.detection import GONE_S
from contactsafe.control.laws import torque_against_contact

SAFE = presets.safe().with_(friction_compensation=False)


def collision(panda, stiffness, seconds=2.0):
    """Send the tool sideways by 25 cm, at most 5 cm off, the wrist against a sphere; yield what happens each tick."""
    plant = wrist_meets_sphere(panda, 0.04, stiffness)
    controller = controller_at(panda, SAFE)
    start = plant.tool_position()[1]
    for k in range(round(seconds * 1000)):
        if k % 17 == 0:
            target = reach(panda, [0.0, min(0.25, 0.125 * k / 1000, plant.tool_position()[1] - start + 0.05), 0.0])
        out = plant.run(controller, target, 1, UNTOUCHED)
        yield out, controller, plant


def commanded_push(controller, out):
    """Give what the command pushes along the contact with, N m: torque less c, g and friction."""
    now, state = controller.record["dynamics"], controller.record["state"]
    net = out.torque - now["c"] - now["g"] - state["command"]["friction"]
    return torque_against_contact(state["isolation"]["direction"].copy(), now["M_inv"].copy(), net)


def spring_torque(plant):
    return np.linalg.norm(plant.data.qfrc_constraint[:7])


def spring_force(plant):
    return np.linalg.norm(plant.data.qfrc_constraint[7:10])


@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_arm_that_ran_into_a_spring_yields(panda, stiffness):
    """Never held against; it is left with 3.0 and 3.3 N of the 24 N with which the task alone presses."""
    contacts, forces = [], []
    for out, _, plant in collision(panda, stiffness, seconds=4.0):
        contacts.append(out.contact)
        forces.append(spring_force(plant))
    assert any(contact.in_contact for contact in contacts)
    assert not any(contact.kind == "push" for contact in contacts)
    assert np.mean(forces[-300:]) < 4.0


TURNED = pytest.mark.xfail(strict=True, reason="the angle between contact and direction: 1.6 N m, 1.3 are allowed")
OVER = pytest.mark.xfail(
    strict=True, reason="a lever arm that is guessed too long: 3.0 and 3.3 N where 2.5 are allowed"
)


@OVER
@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_arm_that_ran_into_a_spring_leaves_it_with_the_force_allowed(panda, stiffness):
    forces = [spring_force(plant) for _, _, plant in collision(panda, stiffness, seconds=4.0)]
    assert np.mean(forces[-300:]) == pytest.approx(SAFE.reaction.contact_force_limit_comply_n, rel=0.1)


@pytest.mark.parametrize(("stiffness", "off"), [(2000.0, 0.03), pytest.param(20000.0, 0.12, marks=TURNED)])
def test_steady_torque_of_an_obstacle_is_the_bound_in_force(panda, stiffness, off):
    """But for the angle between the contact's torque and the direction that was found for it."""
    *_, (_, controller, plant) = collision(panda, stiffness, seconds=4.0)
    assert spring_torque(plant) == pytest.approx(float(controller.record["output"]["contact_limit_nm"]), rel=off)


@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_command_never_pushes_an_obstacle_harder_than_the_bound(panda, stiffness):
    """Damping into the contact comes on top and only makes it less. It falls from the meeting's to the yielding one.

    Left out are ticks in which the torque rate was the limit: the bound is reached as fast as that allows.
    """
    pushes, limits = [], []
    for out, controller, _ in collision(panda, stiffness):
        if out.contact.in_contact and "rate" not in out.limited_by:
            pushes.append(commanded_push(controller, out))
            limits.append(float(controller.record["output"]["contact_limit_nm"]))
    assert len(pushes) > 300
    assert (np.array(pushes) <= np.array(limits) + 1e-9).all()
    assert max(pushes) > 0.99 * min(limits)
    assert max(limits) <= SAFE.reaction.contact_force_limit_initial_n * 0.7  # the lever arm is about half a metre
    assert 0.2 * SAFE.reaction.contact_force_limit_comply_n < min(limits) < SAFE.reaction.contact_torque_limit_comply_nm


def stopped(controller, q, qd):
    """Tell whether a joint stop is in force: a joint within the margin of its range, or too fast to stay out of it."""
    params = controller.record["params"]
    left = np.where(qd > 0, params["arm"]["q_max"] - q, q - params["arm"]["q_min"]) - params["limits"]["joint_margin"]
    near = np.minimum(params["arm"]["q_max"] - q, q - params["arm"]["q_min"]) < params["limits"]["joint_margin"]
    allowed = np.minimum(
        params["arm"]["qd_max"], np.sqrt(2 * params["limits"]["joint_deceleration"] * np.maximum(left, 0.0))
    )
    return near.any() or (np.abs(qd) > allowed).any()


@pytest.mark.parametrize("seed", range(3))
def test_bound_holds_whatever_is_asked_and_whatever_pushes(quick_panda, seed):
    """Fuzzed targets, pushes anywhere, motors without limits; where no joint stop is in force, and something presses.

    Where nothing has for a while, an arm that drifts off is braked, and a brake presses against where it came from.
    """
    rng, plant = np.random.default_rng(seed), Plant(quick_panda)
    controller, target, over = controller_at(quick_panda, presets.safe()), None, []
    quiet = controller.record["state"]["detection"]
    for k in range(3000):
        target = disturb(k, 170, quick_panda, plant, rng, target)
        q, qd = plant.q, plant.qd
        out = plant.run(controller, target, 1, UNTOUCHED)
        gone = quiet["quiet_ticks"] > 1000 * GONE_S
        if out.contact.in_contact and not gone and not stopped(controller, q, qd):
            over.append(commanded_push(controller, out) - float(controller.record["output"]["contact_limit_nm"]))
    assert len(over) > 500
    assert max(over) < 1e-9


@pytest.mark.parametrize("body", ["link4", "link5"])
@pytest.mark.parametrize("force", [(0.0, 25.0, 0.0), (0.0, -25.0, 0.0), (25.0, 0.0, 0.0)])
def test_lasting_push_is_held_against(panda, body, force):
    """The tool leaves its place by 2.8 mm at the most."""
    plant, controller, still, away = Plant(panda), controller_at(panda, SAFE), hold(panda), []
    plant.run(controller, still, 100, UNTOUCHED)
    before = plant.tool_position()
    plant.push(body, force)
    for _ in range(3000):
        out = plant.run(controller, still, 1, UNTOUCHED)
        away.append(np.linalg.norm(plant.tool_position() - before))
    assert out.contact.in_contact
    assert out.contact.kind == "push"
    assert max(away) < 0.010
    assert away[-1] < 0.004


def test_bound_in_mode_reject_falls_ever_more_slowly_and_the_tool_hardly_leaves_its_place(panda):
    """Tried again after `reject_decay_s`, then twice as long: the arm recedes a little, and the push goes on."""
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.push("link5", (0.0, 25.0, 0.0))
    still, state, times, away = hold(panda), controller.record["state"], [], []
    before = plant.tool_position()
    for _ in range(8000):
        plant.run(controller, still, 1, UNTOUCHED)
        if state["mode"] == REJECT and (not times or state["reaction"]["reject_decay_s"] > times[-1]):
            times.append(float(state["reaction"]["reject_decay_s"]))
        away.append(np.linalg.norm(plant.tool_position() - before))
    assert times[:2] == [SAFE.reaction.reject_decay_s, 2 * SAFE.reaction.reject_decay_s]
    assert max(away) < 0.010


@pytest.mark.parametrize("stiffness", [2000.0, 20000.0])
def test_there_is_no_second_impact_of_an_obstacle_that_stays(panda, stiffness):
    """It stays detected, and the arm leans on it gently: after a second with less than half of the first impact."""
    torques, commands, contacts = [], [], []
    for out, _, plant in collision(panda, stiffness, seconds=7.0):
        torques.append(spring_torque(plant))
        commands.append(out.torque)
        contacts.append(out.contact.in_contact)
    assert np.abs(np.diff(commands, axis=0)).max() <= 1.0
    found = contacts.index(True)
    assert all(contacts[found:])
    assert max(torques[found + 1000 :]) < 0.5 * max(torques)


def released(arm, body, force):
    """Push for 1.5 s, let go; give the torques, the joints' speeds and whether in contact, tick by tick from then."""
    plant, controller, still = Plant(arm), controller_at(arm, SAFE), hold(arm)
    plant.run(controller, still, 100, UNTOUCHED)
    plant.push(body, force)
    plant.run(controller, still, 1500, UNTOUCHED)
    plant.push(body, (0.0, 0.0, 0.0))
    torque, speed, contact, away = [], [], [], []
    before = arm.tool_pose(arm.home).position
    for _ in range(3000):
        out = plant.run(controller, still, 1, UNTOUCHED)
        torque.append(out.torque)
        speed.append(np.abs(plant.qd).max())
        contact.append(out.contact.in_contact)
        away.append(np.linalg.norm(plant.tool_position() - before))
    end = contact.index(False)
    assert end > 900
    assert not any(contact[end:])
    return np.array(torque), np.array(speed), end, max(away)


PUSHES = [("link5", (0.0, 40.0, 0.0)), ("link4", (0.0, -40.0, 0.0))]


@pytest.mark.parametrize(("body", "force"), PUSHES)
def test_tool_stays_where_it_is_when_the_push_ends(panda, body, force):
    torque, *_, away = released(panda, body, force)
    assert away < 0.005
    assert np.abs(np.diff(torque, axis=0)).max() <= 1.0


@pytest.mark.parametrize(("body", "force"), PUSHES)
def test_command_does_not_jump_when_contact_ends(quick_panda, body, force):
    """Motors that take any torque at once show what the law asks."""
    torque, _, end, _ = released(quick_panda, body, force)
    assert np.abs(torque[end] - torque[end - 1]).max() < 1.0


@pytest.mark.parametrize(
    ("body", "force"),
    [
        PUSHES[0],
        pytest.param(
            *PUSHES[1],
            marks=pytest.mark.xfail(strict=True, reason="after 40 N on link 4 the arm swings back at 0.35 rad/s"),
        ),
    ],
)
def test_arm_does_not_swing_back_when_contact_ends(panda, body, force):
    _, speed, end, _ = released(panda, body, force)
    assert speed[end:].max() < 0.25


def sweep(panda, config, body, force):
    """Sweep the tool by 30 cm in 1.2 s; from 0.4 s on a link is pushed, N. Return where the tool was, (ticks, 3), m."""
    plant, controller, path = Plant(panda), controller_at(panda, config), []
    for k in range(1500):
        plant.push(body, np.array(force) * min(max((k - 400) / 100, 0.0), 1.0))
        plant.run(controller, reach(panda, [0.0, 0.3 * min(k / 1200, 1.0), 0.0]), 1, UNTOUCHED)
        path.append(plant.tool_position())
    return np.array(path)


@pytest.mark.parametrize(("body", "force"), [("link4", [15.0, 0.0, 0.0]), ("link6", [0.0, 15.0, 0.0])])
def test_a_tool_that_moves_while_the_arm_is_pushed_was_late(panda, body, force):
    """By 40 to 80 mm: what damps the joints in contact braked the task. Now by less than a third of `vices`."""
    moved = {}
    for name, config in (("vices", presets.vices().with_(friction_compensation=False)), ("safe", SAFE)):
        calm, pushed = sweep(panda, config, body, [0.0, 0.0, 0.0]), sweep(panda, config, body, force)
        moved[name] = np.linalg.norm(calm - pushed, axis=1).max()
    assert moved["safe"] < moved["vices"] / 3.0
