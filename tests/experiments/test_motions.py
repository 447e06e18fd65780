"""Motions that are sampled with something given, and played in parts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from contactsafe import presets
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.motions import Playback, record, record_rest
from contactsafe.experiments.surfaces import clearance, is_uncovered, sample_surface_point
from contactsafe.robot import robots
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.worlds import Worlds

ARM = robots.panda()


@pytest.mark.parametrize("seed", range(6))
def test_what_is_asked_of_a_motion_is_so(seed):
    held, swept = (sample_motion(ARM, seed, slides=False, holds=holds) for holds in (True, False))
    assert (held.holds, swept.holds) == (True, False)
    assert (held.slides, swept.slides) == (False, False)
    assert_array_equal(held.stiffness, swept.stiffness)


@pytest.mark.parametrize("seed", range(6))
def test_asking_for_what_would_be_sampled_anyway_changes_nothing(seed):
    motion = sample_motion(ARM, seed)
    assert repr(sample_motion(ARM, seed, motion.slides, motion.holds)) == repr(motion)


def test_the_rest_of_a_motion_is_the_end_of_all_of_it():
    motion = sample_motion(ARM, 0)
    traces = []
    for begun_steps in (0, 7):
        worlds = Worlds(ARM, motion.world((), REAL_SENSORS), presets.vices(), 1, [0])
        play = Playback(worlds, [motion])
        for _ in range(begun_steps):
            play.step()
        begun = play.ticks
        traces.append(record_rest(play)[0])
        assert len(traces[-1]) == round(1000 * motion.duration_s) - begun
        worlds.seed([0])
        assert len(record(worlds, [motion])[0]) == round(1000 * motion.duration_s)
        worlds.close()
    whole, rest = traces
    assert_array_equal(rest["q"], whole["q"][-len(rest) :])


@given(st.integers(0, 5000))
def test_a_point_inside_another_link_or_right_before_one_is_covered(seed):
    rng = np.random.default_rng(seed)
    q = rng.uniform(ARM.q_min + 0.1, ARM.q_max - 0.1)
    link = int(rng.integers(2, ARM.n + 1))
    point, normal = sample_surface_point(ARM, link, rng)
    origins, rotations = link_frames(description_and_tool(ARM)[0], q[None])
    place, inwards = origins[0, link] + rotations[0, link] @ point, -rotations[0, link] @ normal
    before = clearance(ARM, q[None], place - 1e-3 * inwards)
    assert is_uncovered(ARM, q, place, inwards) == (clearance(ARM, q[None], place) >= -1e-6 and before >= 0.5e-3)
    assert not is_uncovered(ARM, q, place + 5e-3 * inwards, inwards)
