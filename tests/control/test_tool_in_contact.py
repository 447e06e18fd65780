"""Without a force sensor: what meets the tool while somebody pushes the arm is no part of the push."""

import numpy as np
import pytest
from tests.control.plant import Plant, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.control.instance import controller_dtype
from contactsafe.control.tool_in_contact import follow_tool_in_contact, tool_in_contact_dtype
from contactsafe.core.compiled import compiled

SAFE, VICES = (preset().with_(friction_compensation=False) for preset in (presets.safe, presets.vices))

BOARD_N_M = 5000.0


def lands(arm, config, body, force, pushed=(200, 1700), at=600, ticks=3200):
    """Let the tool come down 3 cm to a board of 5 kN/m, and 1 cm on, while a body is pushed.

    Returns:
        Force of the board in every tick, N, and of the push as the tool strays from where it was, m.
    """
    plant, controller, forces, away = Plant(arm), controller_at(arm, config), [], []
    start = plant.tool_position()
    for k in range(ticks):
        plant.push(body, force if pushed[0] <= k < pushed[1] else np.zeros(3))
        down = min(max(0.0001 * (k - at), 0.0), 0.04)
        out = controller.step(Measurement(plant.q, plant.qd), reach(arm, [0.0, 0.0, -down]))
        J, tool = controller.record["dynamics"]["J"], plant.tool_position()
        deep = start[2] - 0.03 - tool[2]
        pressed = max(BOARD_N_M * deep - 50.0 * (J[2] @ plant.qd), 0.0) if deep > 0.0 else 0.0
        forces.append(pressed)
        away.append(np.linalg.norm((tool - start)[:2]))
        plant.step(out.torque + pressed * J[2])
    return np.array(forces), np.array(away), out


@pytest.mark.parametrize(
    ("body", "force"),
    [
        ("link4", (0.0, 25.0, 0.0)),
        ("link5", (0.0, 25.0, 0.0)),
        ("link5", (25.0, 0.0, 0.0)),
        ("link6", (0.0, -25.0, 0.0)),
    ],
)
def test_board_that_meets_the_tool_under_a_push_is_pressed_as_without_it(panda, body, force):
    """Taken for a part of the push it was pressed the more the more it answered, and on after the push had ended."""
    pressed, away, out = lands(panda, SAFE, body, np.array(force))
    alone, _, _ = lands(panda, SAFE, body, np.zeros(3))
    baseline, far, _ = lands(panda, VICES, body, np.array(force))
    assert alone.max() > 5.0
    assert pressed.max() < max(alone.max(), baseline.max()) + 5.0
    assert abs(pressed[-1] - alone[-1]) < 2.0
    assert away.max() < far.max() + 0.005
    assert not out.contact.in_contact


@compiled
def _follow(c, torque):
    follow_tool_in_contact(
        c.state.tool_wrench.in_contact, torque, c.state.observer.noise, c.dynamics.J, c.params.one_tick
    )


class Told:
    """What is told of a torque beside a contact of link 5, the arm at home, by a clean residual and by a noisy one."""

    def __init__(self, arm, noise_nm):
        plant, controller = Plant(arm), controller_at(arm, SAFE)
        plant.run(controller, hold(arm), 50)
        self.c, self.noise_nm = controller.record, noise_nm
        self.J, self.rng = self.c["dynamics"]["J"].copy(), np.random.default_rng(1)
        plant.push("link5", (10.0, 20.0, 5.0))
        self.push = plant.push_torque()

    def after(self, ticks, share, force):
        """Give the force told after so many ticks of a share of the push and a force on the tool."""
        for _ in range(ticks):
            noise = self.noise_nm * self.rng.standard_normal(len(self.push))
            _follow(self.c, share * self.push + self.J[:3].T @ np.asarray(force) + noise)
        return self.c["state"]["tool_wrench"]["in_contact"]["force"].copy()


@pytest.mark.parametrize("noise_nm", [0.0, 0.05])
@pytest.mark.parametrize("force", [(0.0, 0.0, 12.0), (-3.0, 1.0, 10.0), (0.0, 0.0, 40.0), (8.0, -8.0, 0.0)])
def test_force_on_the_tool_is_told_beside_a_push(panda, noise_nm, force):
    told = Told(panda, noise_nm)
    told.after(300, 1.0, np.zeros(3))
    found = told.after(5, 1.0, force)
    assert np.linalg.norm(found - force) < 0.2 * np.linalg.norm(force) + 1.0


@pytest.mark.parametrize("share", [0.0, 0.3, 3.0])
def test_push_that_grows_or_ends_is_no_force_on_the_tool(panda, share):
    told = Told(panda, 0.05)
    told.after(300, 1.0, np.zeros(3))
    assert np.linalg.norm(told.after(200, share, np.zeros(3))) < 3.0


def test_force_on_the_tool_stays_the_tools_when_the_push_ends(panda):
    told = Told(panda, 0.05)
    told.after(300, 1.0, np.zeros(3))
    told.after(300, 1.0, (0.0, 0.0, 12.0))
    assert told.after(300, 0.0, (0.0, 0.0, 12.0))[2] == pytest.approx(12.0, abs=2.0)


def test_nothing_is_remembered_of_an_arm_that_nothing_touches(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 100)
    plant.push("link5", (0.0, 25.0, 0.0))
    plant.run(controller, hold(panda), 500)
    assert controller.record["state"]["tool_wrench"]["in_contact"]["pattern"].any()
    plant.push("link5", (0.0, 0.0, 0.0))
    plant.run(controller, hold(panda), 2000)
    assert not controller.record["state"]["tool_wrench"]["in_contact"]["pattern"].any()
    assert controller_dtype(panda.n)["state"]["tool_wrench"]["in_contact"] == tool_in_contact_dtype(panda.n)
