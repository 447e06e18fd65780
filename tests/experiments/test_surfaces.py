"""Points on the surface of an arm: on it, outwards, and as far from it as they claim."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.collision_scenes import met_links
from contactsafe.experiments.surfaces import clearance, sample_surface_point
from contactsafe.robot import robots
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import arm_capsules, link_frames

ARM = robots.panda()
DESCRIPTION, TOOL = description_and_tool(ARM)
seeds = st.integers(0, 10_000)
links = st.sampled_from(met_links(ARM))


def posture(seed):
    return np.random.default_rng(seed).uniform(ARM.q_min + 0.1, ARM.q_max - 0.1)


def in_world(q, link, point, normal):
    origins, rotations = link_frames(DESCRIPTION, q[None])
    return origins[0, link] + rotations[0, link] @ point, rotations[0, link] @ normal


def distance_to_link(q, link, place):
    """From a point to the nearest capsule of one link, m."""
    starts, ends, radii, owners = arm_capsules(DESCRIPTION, TOOL, q[None])
    gaps = []
    for k in np.flatnonzero(owners == link):
        along = ends[0, k] - starts[0, k]
        s = np.clip((place - starts[0, k]) @ along / (along @ along), 0, 1)
        gaps.append(np.linalg.norm(place - starts[0, k] - s * along) - radii[k])
    return min(gaps)


@given(seeds, links)
def test_a_sampled_point_lies_on_a_capsule_of_its_link(seed, link):
    point, normal = sample_surface_point(ARM, link, np.random.default_rng(seed))
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    q = posture(seed)
    place, _ = in_world(q, link, point, normal)
    assert distance_to_link(q, link, place) < 1e-9
    assert clearance(ARM, q[None], place) < 1e-9


@given(seeds, links, st.floats(0.001, 0.05))
def test_inwards_of_it_is_inside_the_arm(seed, link, depth):
    point, normal = sample_surface_point(ARM, link, np.random.default_rng(seed))
    q = posture(seed)
    place, outwards = in_world(q, link, point, normal)
    assert clearance(ARM, q[None], place - depth * outwards) < 0.0 or depth > 0.02


@given(seeds, st.floats(0.0, 0.3))
def test_clearance_changes_no_faster_than_the_point_moves(seed, step):
    rng = np.random.default_rng(seed)
    q, place = posture(seed)[None], rng.uniform(-0.6, 0.8, 3)
    direction = rng.standard_normal(3)
    moved = place + step * direction / np.linalg.norm(direction)
    assert abs(clearance(ARM, q, moved) - clearance(ARM, q, place)) <= step + 1e-9


@given(seeds)
def test_clearance_over_postures_is_the_least_of_each(seed):
    rng = np.random.default_rng(seed)
    q, place = np.array([posture(seed + k) for k in range(3)]), rng.uniform(-0.6, 0.8, 3)
    each = [clearance(ARM, one[None], place) for one in q]
    assert clearance(ARM, q, place) == pytest.approx(min(each))


def test_far_away_it_is_the_distance_to_the_arm():
    place = np.array([0.0, 0.0, 10.0])
    assert 8.0 < clearance(ARM, ARM.home[None], place) < 10.0


def test_an_arm_without_description_is_refused():
    with pytest.raises(InvalidInputError, match=r"has no description of its links and tool; give contactsafe\.robots"):
        description_and_tool(replace(ARM, description=None))
