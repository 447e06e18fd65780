"""The wiping task as experiments see it: the same boards for all controllers, a lure, strokes on the board."""

from dataclasses import replace

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import ActionConfig
from contactsafe.robot import robots
from contactsafe.sim.config import NO_NOISE, PlantConfig, WorldConfig
from contactsafe.sim.obstacles import bottle
from contactsafe.tasks.wiping.board import BoardConfig
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.scenes import LURE_AT, LURE_SIZE, OBSTACLE_AT, Wiping, held_out, strokes
from contactsafe.tasks.wiping.whiteboard import INK, OBJECT

TASK = Wiping()
STIFFNESS = (75.0, 75.0, 75.0, 450.0, 450.0, 450.0)


def far_away(arm, q):
    return bottle((0.3, -0.6, 0.5))


def test_a_seeds_board_is_the_same_under_all_controllers_and_among_others():
    both = TASK.episodes("vices", [4, 5])
    alone = TASK.episodes("safe", [5])
    np.testing.assert_array_equal(both.pictures()[1], alone.pictures()[0])
    assert not np.array_equal(both.pictures()[0], both.pictures()[1])
    np.testing.assert_array_equal(both.curves()["ink_left"], 1.0)


def test_episodes_begun_again_are_as_they_were():
    episodes = TASK.episodes("safe", [4])
    before = episodes.pictures(), episodes.observation()["pose"]
    for _ in range(5):
        episodes.step(np.ones((1, 18)))
    assert not np.array_equal(episodes.observation()["pose"], before[1])
    episodes.begin()
    np.testing.assert_array_equal(episodes.pictures(), before[0])
    np.testing.assert_array_equal(episodes.observation()["pose"], before[1])


def test_the_lure_lies_on_the_right_and_the_tool_starts_on_the_left():
    seen = []

    def obstacle_at(arm, q):
        seen.append(arm.tool_pose(q).position)
        return far_away(arm, q)

    episodes = TASK.towards_obstacle("safe", range(3), obstacle_at)
    for pictures, pose, met in zip(episodes.pictures(), episodes.observation()["pose"], seen, strict=True):
        cells = np.argwhere(pictures == OBJECT)
        board = BoardConfig()
        low = np.array(board.centre[:2]) - np.array(board.size) / 2
        centre = low + (cells.mean(axis=0) + 0.5) * board.cell
        np.testing.assert_allclose(centre, np.add(board.centre[:2], LURE_AT), atol=board.cell)
        assert len(cells) == pytest.approx(np.prod(LURE_SIZE) / board.cell**2, rel=0.05)
        assert (pictures == INK).any()
        assert pose[1] > -0.01
        assert OBSTACLE_AT[0] - 1e-3 <= met[1] <= OBSTACLE_AT[1] + 1e-3
    assert episodes.worlds.configs[0].obstacles[0] == far_away(None, None)


@pytest.mark.parametrize(("size", "ink"), [((0.5, 0.5), 0.3), ((0.08, 0.6), 0.05)])
def test_a_board_too_small_for_the_lure_is_refused_where_it_was_cut_in_silence(size, ink):
    task = Wiping(WipingConfig(board=BoardConfig(size=size, ink_size=ink)))
    with pytest.raises(InvalidInputError, match=r"has no room for an object .* from its centre; give .* m or more"):
        task.towards_obstacle("safe", [0], far_away)


def test_scenes_of_another_arm_were_those_of_the_panda():
    arm, board = robots.fr3(), BoardConfig(centre=(0.45, 0.02, 0.01))
    task = Wiping(WipingConfig(board=board), arm)
    assert (task.stage.arm, task.stage.tool) == (arm.description, arm.tool)
    np.testing.assert_allclose(np.mean(task.stage.corners, axis=0), board.centre)
    seen = []
    scenes = [
        task.episodes("safe", [0]),
        task.towards_obstacle("safe", [0], lambda arm, q: seen.append(arm) or far_away(arm, q)),
        task.scripted("safe", [0], [WorldConfig()], STIFFNESS, works=True)[0],
    ]
    for episodes in scenes:
        assert episodes.arm is arm
        episodes.worlds.close()
    assert seen == [arm]


def test_scenes_of_another_board_and_plant_were_in_the_places_and_the_world_of_the_default_ones():
    config = WipingConfig(
        board=BoardConfig(centre=(0.47, 0.03, 0.02)),
        world=WorldConfig(PlantConfig(payload_kg=0.2), obstacles=(far_away(None, None),)),
        action=ActionConfig(translation=(0.006, 0.006, 0.002), gains="low"),
        clean_fraction=0.01,
    )
    task, board, seen = Wiping(config), config.board, []

    def obstacle_at(arm, q):
        seen.append(arm.tool_pose(q).position)
        return bottle((0.3, -0.6, 0.7))

    episodes = task.towards_obstacle("vices", range(3), obstacle_at)
    assert episodes.tasks.config == replace(config, controller="vices")
    for pictures, pose, met in zip(episodes.pictures(), episodes.observation()["pose"], seen, strict=True):
        low = np.array(board.centre[:2]) - np.array(board.size) / 2
        lure = low + (np.argwhere(pictures == OBJECT).mean(axis=0) + 0.5) * board.cell
        np.testing.assert_allclose(lure, np.add(board.centre[:2], LURE_AT), atol=board.cell)
        assert OBSTACLE_AT[0] - 1e-3 <= met[1] - board.centre[1] <= OBSTACLE_AT[1] + 1e-3
        np.testing.assert_allclose([met[0], met[2]], [board.centre[0], board.centre[2]], atol=1e-3)
        assert -0.01 < pose[1] - board.centre[1] < 0.11
    for world in episodes.worlds.configs:
        assert world.plant == config.world.plant
        assert world.obstacles == (bottle((0.3, -0.6, 0.7)), far_away(None, None))
    episodes.worlds.close()

    sensed = WorldConfig(PlantConfig(payload_kg=0.1), NO_NOISE)
    episodes, _ = task.scripted("vices", [0], [sensed], STIFFNESS, works=True)
    action = replace(
        config.action, gains="learned", stiffness_start=STIFFNESS, press=episodes.tasks.config.action.press
    )
    assert episodes.tasks.config == replace(config, controller="vices", action=action)
    world = episodes.worlds.configs[0]
    assert (world.plant, world.sensors) == (sensed.plant, sensed.sensors)
    assert world.obstacles == config.world.obstacles
    np.testing.assert_allclose(episodes.observation()["pose"][0, :2], board.centre[:2], atol=1e-3)
    np.testing.assert_allclose(episodes.observation()["target"][0, 6:12], STIFFNESS)
    episodes.worlds.close()


@pytest.mark.parametrize("works", [False, True])
def test_a_script_holds_above_the_board_or_strokes_on_it(works):
    episodes, act = TASK.scripted("safe", [0], [WorldConfig()], STIFFNESS, works)
    before = episodes.observation()["pose"][0]
    for _ in range(60):
        episodes.step(act(episodes.observation()))
    after = episodes.observation()
    np.testing.assert_allclose(after["target"][0, 6:12], STIFFNESS)
    moved = after["pose"][0] - before
    assert (abs(moved[1]) > 0.04) == works
    assert (np.abs(after["force"][0, 2]) > 1.0) == works
    assert abs(moved[0]) < 0.01


def test_strokes_add_up_to_their_half_length_within_actions():
    action = ActionConfig()
    act = strokes(action)
    steps = np.array([act({"target": np.zeros((1, 18))})[0] for _ in range(75)])  # a quarter of a period
    assert np.abs(steps).max() <= 1.0
    assert steps[:, 1].sum() * action.translation[1] == pytest.approx(0.08)
    assert steps[:, 2].sum() * action.translation[2] == pytest.approx(-0.005)


def test_outcome_counts_ink_and_time():
    trace = TASK.episodes("safe", [0]).worlds.no_trace[0].copy()
    trace = np.zeros(500, dtype=trace.dtype)
    trace["time"] = np.arange(500) / 1000
    left = np.linspace(1.0, 0.25, 500)
    assert TASK.outcome(trace, {"ink_left": left}, True) == {"ink_removed": 0.75, "clean": 1.0, "time_s": 0.499}
    assert np.isnan(TASK.outcome(trace, {"ink_left": left}, False)["time_s"])


def test_held_out_generators_are_not_those_of_training():
    assert held_out(0).integers(2**62) != np.random.default_rng(0).integers(2**62)
    assert held_out(3).integers(2**62) == held_out(3).integers(2**62)


def test_the_mask_is_timed_by_itself():
    ((name, (run, times)),) = TASK.episodes("safe", [0]).timed().items()
    assert name == "mask, 128 × 128"
    assert times == 50
    run()


def test_the_stage_is_the_board_that_is_simulated():
    board = BoardConfig()
    corners = np.array(TASK.stage.corners)
    np.testing.assert_allclose(corners.mean(axis=0), board.centre)
    np.testing.assert_allclose(corners.max(axis=0)[:2] - corners.min(axis=0)[:2], board.size)
    assert set(TASK.stage.colours) == {INK, OBJECT}
