"""No inertia is so light that the controller's dampers drive it."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from benchmarks.random_arms import SPEED_LIMIT, random_arm, run
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe import Controller, Measurement, Target, robots
from contactsafe.control.config import damping_rate
from contactsafe.control.damping import (
    GAIN_MARGIN,
    braking_limit,
    joint_damping_limits,
    largest_damping,
    loosen_limits,
    scale_damping_into,
    task_damping_into,
)
from contactsafe.control.presets import PRESETS, safe

DT = 0.001


def still_moves(M_inv, D, delay, ticks=4000):
    """Let dampers brake random speeds, so many ticks late; give what is left of them."""
    rng = np.random.default_rng(0)
    n = len(D)
    past = [rng.normal(size=n)] * (delay + 1)
    for _ in range(ticks):
        past = [past[0] - DT * M_inv @ (D * past[delay]), *past[:delay]]
        if not np.abs(past[0]).max() < 1e6:
            return math.inf
    return np.abs(past[0]).max()


def random_inverse_inertia(rng, n):
    """Draw an inverse inertia over six decades, coupled as a chain's or as chance has it."""
    B = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-2.0, 2.0, n)
    return B @ B.T + np.diag(10.0 ** rng.uniform(-3.0, 1.0, n))


@pytest.mark.parametrize("delay", range(6))
def test_a_damper_is_stable_just_below_the_limit_and_not_above(delay):
    m = 0.03
    limit = largest_damping(delay) * m / DT
    assert still_moves(np.array([[1.0 / m]]), np.array([0.98 * limit]), delay) < 1e-3
    assert still_moves(np.array([[1.0 / m]]), np.array([1.02 * limit]), delay) > 1e3


@given(st.integers(0, 5), st.floats(0.0, 1.0))
def test_the_characteristic_equation_has_no_root_outside_below_the_limit(delay, fraction):
    polynomial = np.zeros(delay + 2)
    polynomial[:2] = 1.0, -1.0
    polynomial[-1] += 0.999 * fraction * largest_damping(delay)
    assert np.abs(np.roots(polynomial)).max() <= 1.0 + 1e-9


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_joints_coupled_in_any_way_stay_within_the_rate(seed, n):
    M_inv, limits = random_inverse_inertia(np.random.default_rng(seed), n), np.empty(n)
    joint_damping_limits(M_inv, 300.0, limits)
    for _ in range(2):
        root = np.sqrt(limits)
        fastest = np.linalg.eigvalsh(root[:, None] * M_inv * root)[-1]
        assert fastest <= 300.0 * (1.0 + 1e-9)
        loosen_limits(M_inv, 300.0, limits)
    assert fastest >= 300.0 * n**-0.125 * (1.0 - 1e-6)


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_joints_that_are_not_coupled_may_have_all_of_it(seed, n):
    m, limits = 10.0 ** np.random.default_rng(seed).uniform(-6.0, 1.0, n), np.empty(n)
    joint_damping_limits(np.diag(1.0 / m), 300.0, limits)
    assert_allclose(limits, 300.0 * m, rtol=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2, 4])
def test_the_limit_is_within_a_factor_of_two_of_what_is_unstable(panda, six_joint_arm, delay):
    """All joints damped at once, on arms as they are; twice the bound is unstable."""
    rng = np.random.default_rng(1)
    drawn = [robots.from_mjcf(random_arm(rng, n).compile(), site="tip") for n in (6, 7) for _ in range(10)]
    for arm in (panda, six_joint_arm, *drawn):
        q = rng.uniform(arm.q_min, arm.q_max)
        M_inv, limits = arm.dynamics(q, np.zeros(arm.n))["M_inv"], np.empty(arm.n)
        joint_damping_limits(M_inv, largest_damping(delay) / DT, limits)
        loosen_limits(M_inv, largest_damping(delay) / DT, limits)
        assert still_moves(M_inv, 0.98 * limits, delay) < 10.0  # what is braked slowly still moves
        assert still_moves(M_inv, 2.0 * limits, delay) > 1e3


@given(st.integers(0, 2**32 - 1), st.integers(1, 10), st.floats(0.0, 0.95))
def test_braking_along_one_direction_takes_what_the_joints_dampers_leave(seed, n, fraction):
    rng = np.random.default_rng(seed)
    M_inv, limits = random_inverse_inertia(rng, n), np.empty(n)
    M, direction = np.linalg.inv(M_inv), rng.normal(size=n)
    direction /= np.linalg.norm(direction)
    joint_damping_limits(M_inv, 300.0, limits)
    d = braking_limit(direction, M, fraction * limits, 300.0)
    total = np.diag(fraction * limits) + d * np.outer(direction, direction)
    L = np.linalg.cholesky(M)
    fastest = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, total).T))[-1]
    assert_allclose(fastest, 300.0, rtol=1e-4)


@given(st.lists(st.floats(0.0, 1e3), min_size=3, max_size=3), st.lists(st.floats(1e-6, 1e3), min_size=3, max_size=3))
def test_a_share_of_damping_never_passes_its_limit(damping, limits):
    fraction = np.empty(3)
    scale_damping_into(np.array(damping), np.array(limits), fraction)
    assert (fraction <= 1.0).all()
    assert (fraction * damping <= np.array(limits) * (1.0 + 1e-12)).all()
    assert_allclose(fraction[np.array(damping) <= limits], 1.0)


@given(st.floats(10.0, 1500.0), st.floats(2.0, 120.0))
def test_stiffness_that_acts_late_is_damped_at_least_twice_as_much_as_it_drives(K, D):
    """A spring late by τ is one with a damping of −K τ: what is left of D is half of it at least."""
    found = task_damping_into(np.full(6, K), np.full(6, D), 0.002, np.empty(6))
    assert (found >= D).all()
    assert (found - 0.002 * K >= 0.5 * found - 1e-12).all()


def test_the_dampers_of_a_panda_are_as_configured(panda):
    """Its joints are heavy enough for all of `safe()`, wherever it stands."""
    config, rng, limits = safe(), np.random.default_rng(2), np.empty(7)
    rate = damping_rate(config, GAIN_MARGIN) - 2.0 * math.sqrt(450.0)
    wanted = np.maximum(config.impedance.D_posture, config.reaction.null_damping) + config.reaction.contact_damping
    for _ in range(300):
        joint_damping_limits(panda.dynamics(rng.uniform(panda.q_min, panda.q_max), np.zeros(7))["M_inv"], rate, limits)
        assert (wanted <= 1.05 * limits).all()


SCENE = Path(__file__).parents[2] / "examples" / "own_scene.xml"


@pytest.mark.parametrize("rotors", [True, False], ids=["rotors", "no rotors"])
def test_light_joints_were_flung_on_contact(rotors):
    """The how-to's arm without rotors: a joint reached 282 rad/s, the tool missed by 196 mm, and no fault was told."""
    text = SCENE.read_text(encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(text if rotors else text.replace(' armature="0.1"', ""))
    arm, data = robots.from_mjcf(model, site="tip"), mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    at, controller = arm.bind(model), Controller(arm, safe())
    controller.reset(data.qpos[at.qpos])
    start = Target(arm.tool_pose(arm.home), np.array([150.0] * 3 + [450.0] * 3), posture=arm.home)
    error, speed, force, met = 0.0, 0.0, [], False
    for tick in range(2500):
        left = np.array([0.0, 0.25, 0.0]) * min(tick / 1500, 1.0)
        target = start._replace(pose=start.pose._replace(position=start.pose.position + left))
        out = controller.step(Measurement(data.qpos[at.qpos], data.qvel[at.dof]), target)
        data.ctrl[at.ctrl] = out.torque / at.gear
        mujoco.mj_step(model, data, at.steps)
        error, speed = max(error, np.linalg.norm(out.error[:3])), max(speed, np.abs(data.qvel[at.dof]).max())
        force.append(data.sensor("box").data[0])
        met = met or out.contact.in_contact
    assert met
    assert speed < 3.0
    assert error < 0.1
    assert np.mean(force[-300:]) < 10.0
    assert out.fault == "none"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_arms_ran_away_at_thousands_of_rad_s(seed):
    """Held, pushed, released, swept into something and driven to their limits, under every preset."""
    model = random_arm(np.random.default_rng(seed), 6 + seed % 2).compile()
    for preset in PRESETS.values():
        seen = run(model, preset(), seed, sensor=seed % 4 < 2)
        assert seen.finite
        assert not seen.runaway
        assert seen.speed < 4.0 * SPEED_LIMIT


def turned(arm, speeds):
    """Give the outputs of a controller whose arm's joint 1 turns at these speeds, rad/s, one a tick."""
    controller = Controller(arm, safe())
    controller.reset(arm.home)
    hold = Target(arm.tool_pose(arm.home), np.full(6, 150.0), posture=arm.home)
    q, qd, outputs = arm.home.copy(), np.zeros(7), []
    for speed in speeds:
        qd[0] = speed
        q[0] += 0.001 * speed
        outputs.append(controller.step(Measurement(q, qd, np.zeros(6)), hold))
    return outputs


def test_a_joint_that_runs_away_is_a_fault_and_is_braked(panda):
    """Something drives joint 1 beyond its speed limit for good: it is damped from then on, and the fault says why."""
    top = 1.5 * panda.qd_max[0]
    outputs = turned(panda, [*np.linspace(0.0, top, 200), *[top] * 400])
    assert outputs[150].fault == "none"
    assert "runs away" in outputs[-1].fault
    assert outputs[-1].torque[0] < -20.0


def test_a_joint_that_is_fast_for_a_moment_is_no_runaway(panda):
    top = 1.2 * panda.qd_max[0]
    pulse = [*np.linspace(0.0, top, 60), *[top] * 40, *np.linspace(top, 0.0, 60)]
    assert all(output.fault == "none" for output in turned(panda, [*pulse, *-np.array(pulse)]))
