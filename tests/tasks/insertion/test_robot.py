"""Insertion without a wrist sensor: what the joints' torques say of the peg, and the block that moves."""

import mujoco
import numpy as np
import pytest

from contactsafe.hardware.messages import seen_dtype
from contactsafe.robot import robots
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.robot import InsertionRobot, InsertionWork, MovedBlock
from contactsafe.tasks.insertion.scene import PEG
from contactsafe.tasks.insertion.step import BIAS_STEPS


@pytest.fixture(scope="module")
def arm():
    return robots.fr3(PEG)


def seen_at(arm, wrench):
    """Give what the control process tells with a wrench at the tool, (6,)."""
    seen = np.zeros(1, seen_dtype(7))[0]
    dynamics = arm.dynamics(arm.home, np.zeros(7))
    seen["q"], seen["position"] = arm.home, arm.tool_pose(arm.home).position
    seen["residual"] = dynamics["J"].T @ wrench
    return seen


@pytest.mark.parametrize("seed", range(5))
def test_a_wrench_at_the_peg_is_what_the_torques_say(arm, seed):
    wrench = np.random.default_rng(seed).normal(0.0, [5, 5, 10, 0.5, 0.5, 0.5])
    work = InsertionWork(InsertionConfig())
    work.prepare(arm, False)
    np.testing.assert_allclose(work._tool_wrench(seen_at(arm, wrench)), wrench, atol=1e-9)


def test_the_policy_observes_the_wrench_less_what_it_was_in_the_air(arm):
    work, bias = InsertionWork(InsertionConfig()), np.array([0.3, -0.2, 1.0, 0.0, 0.05, 0.0])
    work.prepare(arm, False)
    pose = np.zeros(6)
    for step in range(BIAS_STEPS + 1):
        observed = work.look(seen_at(arm, bias), pose, step)
    np.testing.assert_allclose(observed["wrench"], 0.0, atol=1e-9)
    press = np.array([0.0, 0.0, 10.0, 0.0, 0.0, 0.0])
    for step in range(BIAS_STEPS + 1, BIAS_STEPS + 12):
        observed = work.look(seen_at(arm, bias + press), pose, step)
    np.testing.assert_allclose(observed["wrench"], press, atol=0.05)
    assert observed["elapsed"][0] == pytest.approx((BIAS_STEPS + 11) / 60.0)


def test_a_peg_at_depth_is_done_and_the_next_one_waits(arm):
    config = InsertionConfig()
    work = InsertionWork(config)
    work.prepare(arm, False)
    seen = seen_at(arm, np.zeros(6))
    seen["position"] = np.add(config.mouth, [0.0, 0.0, -config.depth_m - 1e-4])
    work.look(seen, np.zeros(6), 50)
    assert work.is_done()
    assert not work.is_ready()
    seen["position"] = work.start.position
    for _ in range(40):
        work.look(seen, np.zeros(6), -1)
    assert work.is_ready()
    assert not work.is_done()


def test_a_peg_that_searched_for_long_is_lifted_and_tried_anew(arm):
    work, slow = InsertionWork(InsertionConfig()), InsertionWork(InsertionConfig())
    work.prepare(arm, False)
    slow.prepare(arm, False, 0.2)
    seen = seen_at(arm, np.zeros(6))

    def are_stalled(steps):
        for one in (work, slow):
            one.look(seen, np.zeros(6), steps)
        return work.is_stalled(), slow.is_stalled()

    assert are_stalled(1000) == (False, False)
    assert are_stalled(1300) == (True, False)
    assert are_stalled(6100) == (True, True)
    assert are_stalled(-1) == (False, False)


def test_the_block_moves_once_a_peg_was_in_and_is_out_again():
    config, rounds = InsertionConfig(), 2
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body name='block'/></worldbody></mujoco>")
    block = MovedBlock(config, 3, rounds)
    block.begin(model)
    places = [model.body("block").pos.copy()]
    for _ in range(rounds + 1):
        for depth in (-0.01, config.depth_m, 0.01, -0.01):
            position = np.add(config.mouth, [0.0, 0.0, -depth])
            block.after_step(0, np.zeros(7), position, np.eye(3), 0.0)
        places.append(model.body("block").pos.copy())
    assert not np.allclose(places[0], places[1])
    assert np.allclose(places[2], places[3])  # after the last round it stays
    away = np.array(places) - np.array(config.mouth)
    assert np.abs(away).max() <= config.error_m


def test_what_went_in_is_counted_from_what_really_happened(arm, tmp_path):
    simulated = InsertionRobot().simulated(arm, tmp_path / "shared", 0, 3, met=True)
    config, heights = InsertionConfig(), [0.02, -0.03, 0.02, -0.03, -0.01, 0.02]
    truth = np.zeros(len(heights), [("position", float, (3,))])
    truth["position"][:, 2] = np.array(heights) + config.mouth[2]
    assert simulated.figures(truth) == {"done, pegs that went in": pytest.approx(2 / 3)}
    simulated.close()
