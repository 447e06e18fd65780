"""What an arm of a file is asked: to stay, to arrive, to stand a push; the same of every controller."""

from pathlib import Path

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.experiments.robot_trials import (
    MOVE_S,
    PUSH_S,
    PUSHED_S,
    hold_path,
    move_path,
    play,
    swept_sphere,
    trial,
)
from contactsafe.sim.model_arms import MOVES_M, load_model, pushed_at
from contactsafe.sim.model_scenes import SPHERE_M, build_scene

FILE = Path(__file__).parents[2] / "examples" / "servo_arm.xml"


@pytest.fixture(scope="module")
def of():
    return load_model(str(FILE))


def test_path_begins_at_home_and_ends_where_the_move_does(of):
    start, end = move_path(of)(0.0), move_path(of)(2.0 * MOVE_S)
    home = of.arm.tool_pose(of.arm.home).position
    np.testing.assert_allclose(start[0], home)
    np.testing.assert_allclose(end[0], home + of.move)
    np.testing.assert_allclose(end[1], of.q_end)
    assert np.linalg.norm(of.move) == pytest.approx(MOVES_M)


def test_path_is_smooth(of):
    positions = np.array([move_path(of)(0.001 * k)[0] for k in range(2500)])
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=1) / 0.001
    assert speed[0] == pytest.approx(0.0, abs=1e-4)
    assert speed[-1] == pytest.approx(0.0, abs=1e-9)
    assert speed.max() < 2.0 * MOVES_M / MOVE_S


def test_tool_at_the_end_of_the_move_is_where_the_joints_put_it(of):
    np.testing.assert_allclose(
        of.arm.tool_pose(of.q_end).position, of.arm.tool_pose(of.arm.home).position + of.move, atol=1e-3
    )


@pytest.mark.parametrize("with_wrench", [True, False])
def test_arm_that_nothing_touches_stays_and_reports_nothing(of, with_wrench):
    run = play(of, build_scene(of), presets.safe(), with_wrench, hold_path(of), 0.5)
    assert run.finite
    assert run.error.max() < 1e-4
    assert not run.in_contact.any()
    assert run.force.max() == 0.0


def test_push_lasts_as_long_as_it_says(of):
    body, force = pushed_at(of)
    run = play(of, build_scene(of), presets.safe(), True, hold_path(of), PUSHED_S + PUSH_S, (body, force))
    assert not run.in_contact[: round(1000 * PUSHED_S)].any()
    assert run.in_contact[-1]


def test_sphere_is_met_amid_the_move_and_not_before(of):
    centre = swept_sphere(of, presets.vices())
    run = play(of, build_scene(of, centre), presets.vices(), True, move_path(of), MOVE_S)
    met = np.flatnonzero(run.force > 0.0)
    assert len(met)
    assert met[0] > 200
    surface = np.linalg.norm(run.position - centre, axis=1)
    assert surface.min() > SPHERE_M  # by the arm, not by the tool point


def test_figures_of_a_trial_without_a_sphere_leave_it_out(of):
    figures = trial(of, presets.safe(), True, None)
    assert "fixed_peak_n" not in figures
    assert figures["not_finite"] == 0.0
    assert figures["false_contact"] == 0.0


def test_model_is_not_changed_by_what_is_put_into_its_scene(of):
    before = len(of.spec.bodies)
    build_scene(of, np.array([1.0, 1.0, 1.0]), 5000.0)
    assert len(of.spec.bodies) == before
