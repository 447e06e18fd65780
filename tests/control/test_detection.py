"""When contact mode begins and ends, and what is said of the contact.

An arm that stands still although g − τ is commanded is held by τ; with observers that follow at once detection
sees exactly that τ at every tick.
"""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.control.plant import UNTOUCHED, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.robot.friction import joint_friction

INSTANT = {"compensation_gain": 1e6, "detection_gain": 1e6, "residual_cutoff_hz": math.inf}


class Felt:
    """A controller whose arm stands still under whatever torque is felt, with nothing at its tool."""

    def __init__(self, arm, config, target=None):
        self.controller = controller_at(arm, config.with_(**INSTANT))
        self.still = Measurement(arm.home, np.zeros(arm.n), UNTOUCHED)
        self.target = hold(arm) if target is None else target
        self.controller.step(self.still, self.target)

    def feel(self, torque, ticks=1):
        """Give whether the controller was in contact mode at each of some ticks."""
        modes = []
        for _ in range(ticks):
            record = self.controller.record
            record["state"]["command"]["tau"] = record["dynamics"]["g"] - torque
            self.out = self.controller.step(self.still, self.target)
            modes.append(self.out.contact.in_contact)
        return modes


def joint(number, torque):
    return np.eye(7)[number - 1] * torque


@pytest.mark.parametrize("sign", [1, -1])
def test_contact_begins_above_the_threshold(panda, sign):
    felt = Felt(panda, presets.paper())
    assert felt.feel(joint(3, sign * 1.499), 100) == [False] * 100
    assert felt.feel(joint(3, sign * 1.501)) == [True]


def test_contact_lasts_for_the_dwell(panda):
    """t_c = 50 ms: one tick above δ, then 49 more, whatever is felt."""
    felt = Felt(panda, presets.paper())
    modes = felt.feel(joint(3, 2.0)) + felt.feel(joint(3, 0.0), 100)
    assert modes == [True] * 50 + [False] * 51


def test_contact_lasts_until_it_is_well_below_the_threshold(panda):
    """So that a contact kept gentle is not lost from sight."""
    felt = Felt(panda, presets.paper().with_(release_fraction=0.5))
    modes = felt.feel(joint(3, 2.0)) + felt.feel(joint(3, 0.76), 200) + felt.feel(joint(3, 0.74), 1)
    assert modes == [True] * 201 + [False]


def test_viscous_and_dry_friction_raise_the_threshold_and_a_constant_does_not(panda):
    """What was identified of an arm is as uncertain as what is published; its zeros change no bit."""
    config = presets.safe().with_(friction_compensation=False, friction_uncertainty=0.3)
    qd = np.linspace(-0.4, 0.3, panda.n)

    def uncertainty(drag):
        controller = controller_at(replace(panda, drag=np.tile(drag, (panda.n, 1))), config)
        controller.step(Measurement(panda.home, qd, UNTOUCHED), hold(panda))
        return controller.record["state"]["detection"]["model_uncertainty"].copy()

    friction = joint_friction(panda.friction, qd)
    more = 0.3 * (np.abs(friction + 2.0 * qd + 0.5 * np.tanh(20.0 * qd)) - np.abs(friction))
    assert_allclose(uncertainty((2.0, 0.0, 0.5)) - uncertainty((0.0, 0.0, 0.0)), more, atol=1e-9)
    assert_allclose(uncertainty((2.0, 3.0, 0.5)), uncertainty((2.0, 0.0, 0.5)), atol=1e-9)


def test_a_command_on_the_rise_raises_the_threshold(panda):
    """By what comes late: at 1 N m a tick and a delay of 1.5 ticks, 1.5 N m."""
    controller = controller_at(panda, presets.paper().with_(delay_uncertainty_ticks=1.5, **INSTANT))
    still = Measurement(panda.home, np.zeros(panda.n), UNTOUCHED)
    controller.step(still, hold(panda))
    state = controller.record["state"]
    for _k in range(3):
        state["command"]["tau"] = state["observer"]["tau_before"] + np.eye(7)[2]
        controller.step(still, hold(panda))
    assert_allclose(state["detection"]["threshold"], 1.5 + 1.5 * np.abs(state["observer"]["torque_ramp"]), rtol=1e-12)
    assert state["observer"]["torque_ramp"][2] == pytest.approx(1.0)


def test_contact_lasts_while_it_is_felt(panda):
    """After the dwell the first tick below δ ends it: release_s is 0 in the paper."""
    felt = Felt(panda, presets.paper())
    assert felt.feel(joint(3, 2.0), 80) + felt.feel(joint(3, 1.4), 2) == [True] * 80 + [False] * 2


def test_contact_is_released_only_after_quiet(panda):
    """With release_s = 0.2 a blip starts the 200 ticks anew."""
    felt = Felt(panda, presets.paper().with_(release_s=0.2))
    assert all(felt.feel(joint(3, 2.0)) + felt.feel(joint(3, 0.0), 150) + felt.feel(joint(3, 2.0)))
    assert felt.feel(joint(3, 0.0), 205) == [True] * 200 + [False] * 5


@pytest.mark.parametrize(
    ("torque", "link"),
    [
        ([0, 0, 0, 0, 0, 0, 0], 0),
        ([9, 0, 0, 0, 0, 0, 0], 1),
        ([9, 8, -1.6, 1.4, 1.4, 1.4, 1.4], 3),
        ([0, 0, 0, 0, 0, 0, -1.6], 7),
        ([1.4] * 7, 0),
    ],
)
def test_link_of_an_arm_without_surface_samples_is_the_furthest_joint_above_the_threshold(panda, torque, link):
    felt = Felt(replace(panda, surface=panda.surface[:0]), presets.paper())
    felt.feel(np.array(torque, dtype=float))
    assert felt.out.contact.link == link
    assert felt.out.contact.in_contact == (link > 0)


@pytest.mark.parametrize("index", [215, 275, 335, 380, 430])
def test_link_of_an_arm_with_surface_samples_is_the_one_whose_surface_explains_the_torque(panda, index):
    """The torque of 20 N on one point of the surface, not only the furthest joint that shows it."""
    row = panda.surface[index]
    bent = replace(panda, home=panda.home + np.array([0.2, 0.3, -0.4, 0.3, 0.5, 0.3, -0.2]))
    data = mujoco.MjData(panda.model)
    data.qpos[:] = bent.home
    mujoco.mj_kinematics(panda.model, data)
    mujoco.mj_comPos(panda.model, data)
    body, J = panda.model.body(f"link{int(row[0])}").id, np.zeros((3, 7))
    R = data.xmat[body].reshape(3, 3)
    mujoco.mj_jac(panda.model, data, J, None, data.xpos[body] + R @ row[1:4], body)
    felt = Felt(bent, presets.paper())
    felt.feel(-20.0 * J.T @ R @ row[4:])
    assert felt.out.contact.link == int(row[0])


def test_baseline_never_enters(panda):
    felt = Felt(panda, presets.vices())
    assert felt.feel(joint(4, 40.0), 300) == [False] * 300
    assert felt.out.contact.torque == pytest.approx(joint(4, 40.0))


def test_baseline_reports_the_link(panda):
    felt = Felt(panda, presets.vices())
    felt.feel(joint(4, 40.0), 300)
    assert felt.out.contact.link == 4


def test_direction_is_that_of_the_torque_last_felt(panda):
    felt = Felt(panda, presets.paper())
    felt.feel(np.array([0, 3.0, 0, -4.0, 0, 0, 0]))
    assert felt.controller.record["state"]["isolation"]["direction"] == pytest.approx([0, 0.6, 0, -0.8, 0, 0, 0])
    felt.feel(np.zeros(7))
    assert felt.controller.record["state"]["isolation"]["direction"] == pytest.approx([0, 0.6, 0, -0.8, 0, 0, 0])


def pressing(panda, offset=0.05):
    """A target beyond an obstacle, its bound 2 N m; and the torque of an obstacle that stands before it."""
    config = presets.paper().with_(recover_s=0.2, contact_torque_limit_comply_nm=2.0, contact_force_limit_initial_n=0.0)
    obstacle = panda.dynamics(panda.home, np.zeros(7))["J"][1] * -20.0
    return Felt(panda, config, reach(panda, [0.0, offset, 0.0])), obstacle


def test_task_yields_at_once_and_comes_back_slowly(panda):
    """Scaled as a whole until contact ends, then 1 − (1 − scale) exp(−t/recover_s) of it."""
    felt, obstacle = pressing(panda)
    state = felt.controller.record["state"]
    assert state["reaction"]["task_scale"] == 1.0
    felt.feel(obstacle)
    scale = float(state["reaction"]["task_scale"])
    assert scale < 0.9
    modes = felt.feel(obstacle, 100) + felt.feel(np.zeros(7), 250)
    assert modes == [True] * 100 + [False] * 250
    assert_allclose(state["reaction"]["task_scale"], 1 - (1 - scale) * math.exp(-250 * 0.001 / 0.2), rtol=1e-9)


def test_task_is_whole_again_at_once_where_nothing_delays_it(panda):
    felt, obstacle = pressing(panda)
    felt.controller.record["params"]["one_tick"]["recover_gain"] = 1.0
    felt.feel(obstacle, 100)
    felt.feel(np.zeros(7))
    assert felt.controller.record["state"]["reaction"]["task_scale"] == 1.0


def test_paper_takes_nothing_off_the_task(panda):
    felt = Felt(panda, presets.paper(), reach(panda, [0.0, 0.05, 0.0]))
    felt.feel(pressing(panda)[1], 10)
    assert felt.out.contact.in_contact
    assert felt.controller.record["state"]["reaction"]["task_scale"] == 1.0
