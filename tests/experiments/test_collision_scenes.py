"""Random scenes: their seeds' alone, within the ranges the documentation names, and met where and when they say."""

import math

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.experiments.collision_motions import (
    AFTER_S,
    SURFACE_CENTRE,
    TARGET_OFFSET_MAX_M,
    sample_motion,
    sample_plant,
    scene_rng,
)
from contactsafe.experiments.collision_scenes import met_links, sample_meetings, sample_obstacle
from contactsafe.experiments.motions import Playback, record
from contactsafe.experiments.surfaces import clearance
from contactsafe.robot import robots
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.worlds import MAX_TICKS, Worlds

ARM = robots.panda()
MOTIONS = [sample_motion(ARM, seed) for seed in range(40)]


def kinds(motions):
    return {(motion.holds, motion.slides) for motion in motions}


def test_every_kind_of_motion_comes_up():
    assert kinds(MOTIONS) == {(False, False), (False, True), (True, False), (True, True)}


@pytest.mark.parametrize("seed", [0, 3, 17])
def test_a_motion_is_its_seeds_alone(seed):
    again = sample_motion(ARM, seed)
    assert again.start.position.tobytes() == MOTIONS[seed].start.position.tobytes()
    assert again.q_start.tobytes() == MOTIONS[seed].q_start.tobytes()
    assert again.plant == MOTIONS[seed].plant


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: str(motion.seed))
def test_motions_are_within_the_ranges_of_the_documentation(motion):
    assert 0.1 <= motion.speed_m_s <= (0.3 if motion.slides else 0.5)
    assert 75.0 <= motion.stiffness[0] <= 250.0
    assert 300.0 <= motion.stiffness[3] <= 700.0
    assert (motion.q_start > ARM.q_min).all()
    assert (motion.q_start < ARM.q_max).all()
    if motion.holds:
        assert motion.length_m == 0.0
    else:
        assert 0.2 <= motion.length_m <= 0.45
        assert 0.25 <= motion.meets_at <= 0.6
    if motion.slides:
        assert motion.start.position[2] < SURFACE_CENTRE[2]
        assert motion.path[2] == 0.0


@pytest.mark.parametrize("motion", MOTIONS[:12], ids=lambda motion: str(motion.seed))
def test_targets_go_from_start_to_end_no_faster_than_their_speed(motion):
    times = np.arange(0.0, motion.duration_s, 0.001)
    places = np.array([motion.target(time) for time in times])
    np.testing.assert_array_equal(places[0], motion.start.position)
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1).max() / 0.001
    assert speed <= motion.speed_m_s * (not motion.holds) + 1e-9
    assert motion.duration_s == motion.meets_s + AFTER_S
    if not motion.holds:
        np.testing.assert_allclose(motion.target(1e6), motion.start.position + motion.path)
        reached = np.linalg.norm(motion.target(motion.meets_s) - motion.start.position)
        assert reached == pytest.approx(motion.meets_at * motion.length_m)


def test_the_real_plant_differs_and_the_clean_one_does_not():
    motion = MOTIONS[0]
    assert motion.world((), REAL_SENSORS).plant == motion.plant
    assert motion.world((), None).plant.payload_kg == 0.0
    for seed in range(20):
        plant = sample_plant(scene_rng(seed, 0), ARM.n)
        assert all(0.8 <= scale <= 1.2 for scale in plant.friction_scale)
        assert all(0.9 <= scale <= 1.1 for scale in plant.inertia_scale)
        assert abs(plant.payload_kg) <= 0.2
        assert plant.torque_delay_ticks == 1


def test_obstacles_are_within_their_ranges_and_one_in_eight_is_fixed():
    rng = np.random.default_rng(0)
    things = [sample_obstacle(rng, 0.03, may_be_fixed=True) for _ in range(800)]
    moving = [thing for thing in things if not thing.fixed]
    assert 0.08 < 1 - len(moving) / len(things) < 0.17
    assert all(1e3 <= thing.stiffness <= 75e3 for thing in moving)
    assert all(0.5 <= thing.mass <= 5.0 for thing in things)
    assert not any(sample_obstacle(rng, 0.03, may_be_fixed=False).fixed for _ in range(100))


@pytest.fixture(scope="module")
def played():
    motions = MOTIONS[:8]
    worlds = Worlds(
        ARM, [motion.world((), REAL_SENSORS) for motion in motions], presets.vices(), len(motions), list(range(8))
    )
    traces = record(worlds, motions)
    worlds.close()
    return motions, traces


def test_a_recorded_motion_is_as_long_as_it_says_and_follows_its_target(played):
    for motion, trace in zip(*played, strict=True):
        assert len(trace) == round(1000 * motion.duration_s)
        np.testing.assert_allclose(np.diff(trace["time"]), 0.001, atol=1e-9)
        assert np.linalg.norm(trace["position"][-1] - motion.target(motion.duration_s)) < 0.06


def test_a_limited_target_stays_as_near_the_tool_as_a_policys(played):
    for motion, trace in zip(*played, strict=True):
        offset = np.linalg.norm(trace["error"][:, :3], axis=1).max()
        assert not motion.limited or offset < TARGET_OFFSET_MAX_M + 0.5 * motion.speed_m_s * MAX_TICKS / 1000


def test_obstacles_touch_the_arm_where_and_when_they_say(played):
    for motion, trace in zip(*played, strict=True):
        meetings = sample_meetings(ARM, motion, trace["q"])
        assert len({meeting.link for meeting in meetings}) == len(meetings) in (1, 2)
        for meeting in meetings:
            thing, at = meeting.obstacle, np.array(meeting.obstacle.position)
            assert meeting.link in met_links(ARM)
            assert clearance(ARM, trace["q"][:1], at) > thing.radius
            if motion.holds:
                assert math.isfinite(thing.stiffness)
                arrived = at + np.array(thing.travel)
                assert clearance(ARM, trace["q"][-1:], arrived) < thing.radius
            else:
                when = round(1000 * motion.meets_s)
                assert clearance(ARM, trace["q"][[when]], at) < thing.radius + 0.003


def test_a_playback_runs_a_single_tick_of_what_is_over():
    short, long = sorted(MOTIONS[:8], key=lambda motion: motion.duration_s)[::7]
    worlds = Worlds(ARM, [short.world((), None), long.world((), None)], presets.vices(), 2, [0, 1])
    play = Playback(worlds, [short, long])
    ticks = []
    while play.running.any():
        before = play.running.copy()
        ticks.append(play.step())
        assert (worlds.metrics["ticks"] == np.where(before, ticks[-1], 1)).all()
    worlds.close()
    assert play.ticks == sum(ticks) >= play.lengths.max()
    assert sum(ticks[:60]) == 1000
