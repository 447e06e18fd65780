"""Arms that are not the Panda, in loops that are not this package's: MuJoCo's public API and `Arm.bind` alone."""

import re
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.control.plant import UNTOUCHED
from tests.robot.worlds import OWN_SCENE, cell

from contactsafe import Arm, Controller, Measurement, Pose, Target, presets, robots
from contactsafe.control.laws import contact_nullspace, task_inertia, task_nullspace

STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)


class Scene(NamedTuple):
    model: mujoco.MjModel
    arm: Arm
    forearm: str


def six():
    model = mujoco.MjModel.from_xml_string(OWN_SCENE)
    return Scene(model, robots.from_mjcf(model, site="tip"), "forearm")


def six_without_geoms():
    """Nothing is known of its surface: where it is touched must be guessed from the joints alone."""
    known = six().arm
    arm = robots.from_mjcf(known.model, site="tip", home=known.home)
    assert len(known.surface) == 480
    assert len(arm.surface) == 0
    return Scene(arm.model, arm, "link3")


def fr3():
    return Scene(robots.fr3().model, robots.fr3(), "link5")


def panda_in_a_cell():
    model = cell()
    return Scene(model, robots.from_mjcf(model, site="left/tcp"), "left/link5")


@pytest.fixture(scope="module", params=[six, fr3, panda_in_a_cell], ids=lambda make: make.__name__)
def scene(request):
    return request.param()


class Run(NamedTuple):
    """What was seen at every tick: tool error, m; torque, N m; link in contact; and the last output."""

    error: np.ndarray
    torque: np.ndarray
    link: np.ndarray
    out: object


def run(scene, ticks, *, q=None, offset=(0.0, 0.0, 0.0), push=None, until=None, wrench=UNTOUCHED):
    """Hold the pose at q moved by an offset, m; a force, N, pushes the forearm from tick 300 until a tick."""
    model, arm, forearm = scene
    q = arm.home if q is None else q
    data, at, controller = mujoco.MjData(model), arm.bind(model), Controller(arm, presets.safe())
    data.qpos[at.qpos] = q
    controller.reset(q)
    pose = arm.tool_pose(q)
    target = Target(Pose(pose.position + offset, pose.quat), STIFFNESS, posture=q)
    error, torque, link = np.zeros(ticks), np.zeros((ticks, arm.n)), np.zeros(ticks, dtype=int)
    for k in range(ticks):
        if push is not None:
            data.xfrc_applied[model.body(forearm).id, :3] = push if 300 <= k < until else 0.0
        out = controller.step(Measurement(data.qpos[at.qpos], data.qvel[at.dof], wrench), target)
        data.ctrl[at.ctrl] = out.torque / at.gear
        mujoco.mj_step(model, data, at.steps)
        error[k], torque[k], link[k] = np.linalg.norm(out.error[:3]), out.torque, out.contact.link
    return Run(error, torque, link, out)


@pytest.mark.parametrize("wrench", [UNTOUCHED, None], ids=["sensor", "no sensor"])
def test_holds_a_pose(scene, wrench):
    """The tool stays where it is, loose fingers or not, and nothing is taken for a contact."""
    seen = run(scene, 1000, wrench=wrench)
    assert seen.error.max() < 5e-4
    assert not seen.link.any()
    assert seen.out.fault == "none"


def test_goes_where_it_is_told(scene):
    seen = run(scene, 1500, offset=(-0.03, 0.04, 0.05))
    assert seen.error[0] > 0.07
    assert seen.error[-1] < 1e-3
    assert seen.out.fault == "none"


@pytest.mark.parametrize(
    ("make", "push"),
    [
        (fr3, (0.0, 25.0, 0.0)),
        (fr3, (0.0, 0.0, -25.0)),
        (panda_in_a_cell, (0.0, 25.0, 0.0)),
        (panda_in_a_cell, (0.0, 0.0, -25.0)),
        (six, (0.0, 25.0, 0.0)),
        (six, (0.0, -25.0, 0.0)),
        (six, (-25.0, 0.0, 0.0)),
        (six, (0.0, 0.0, -25.0)),
        (six_without_geoms, (0.0, 25.0, 0.0)),
        (six_without_geoms, (0.0, 0.0, -25.0)),
    ],
)
def test_holds_the_tool_under_a_push_on_its_forearm(make, push):
    scene = make()
    seen = run(scene, 2500, push=np.array(push), until=1300)
    assert np.isfinite(seen.torque).all()
    assert np.all(np.abs(seen.torque) <= scene.arm.tau_max)
    assert not seen.link[:300].any()
    assert seen.link[400:1300].all()
    assert seen.error.max() < 0.01
    assert seen.error[-1] < 0.003
    assert not seen.out.contact.in_contact
    assert seen.out.fault == "none"


def test_six_joints_have_no_null_space_for_the_contact_law_to_use():
    """N_t = 0, so (21) must neither divide by zero nor make something of nothing."""
    arm, rng = six().arm, np.random.default_rng(8)
    for _ in range(50):
        now = arm.dynamics(arm.home + rng.uniform(-0.4, 0.4, 6), rng.uniform(-1.0, 1.0, 6))
        J, M_inv = now["J"].copy(), now["M_inv"].copy()
        Lambda, J_M_inv = task_inertia(J, M_inv, 1e-2, 0.05)
        N_t = task_nullspace(J, J_M_inv.T @ Lambda)
        assert_allclose(N_t, 0.0, rtol=0, atol=1e-10)
        assert_allclose(contact_nullspace(N_t, M_inv, rng.normal(size=6)), 0.0, rtol=0, atol=1e-10)


@pytest.mark.parametrize("push", [None, (25.0, 10.0, 0.0)], ids=["left alone", "pushed"])
def test_six_joints_stretched_out_stay_finite(push):
    """Straight up, elbow and wrist singular: Λ is damped, and the arm stands."""
    force = None if push is None else np.array(push)
    seen = run(six(), 1500, q=np.zeros(6), push=force, until=600)
    assert np.isfinite(seen.torque).all()
    assert np.all(np.abs(seen.torque) <= six().arm.tau_max)
    assert seen.error.max() < (1e-5 if push is None else 0.1)


def test_joints_that_turn_without_end_are_controlled_like_others():
    """Several turns away from zero, where a range would long have ended."""
    model = mujoco.MjModel.from_xml_string(re.sub(r' range="[^"]*"', "", OWN_SCENE))
    arm = robots.from_mjcf(model, site="tip")
    assert np.isinf(arm.q_max).all()
    seen = run(Scene(model, arm, "forearm"), 300, q=arm.home + 2 * np.pi * np.array([3, 0, -1, 0, 2, 0]))
    assert seen.error.max() < 1e-5
