"""Torque of a push on a link: Jᵀ f, by virtual work."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.experiments.onsets import CONTACT, FORCE_N, STEP, point_torque, pushed_links, sample_push
from contactsafe.experiments.surfaces import clearance
from contactsafe.robot import robots
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames

ARM = robots.panda()
DESCRIPTION, _ = description_and_tool(ARM)
STEP_RAD = 1e-6


def frames(q):
    origins, rotations = link_frames(DESCRIPTION, q[None])
    return origins[0], rotations[0]


@given(st.integers(0, 10_000), st.sampled_from(pushed_links(ARM)))
def test_torque_does_the_work_of_the_force(seed, link):
    rng = np.random.default_rng(seed)
    q, point, force = rng.uniform(ARM.q_min, ARM.q_max), rng.normal(0, 0.1, 3), rng.normal(0, 20, 3)
    origins, rotations = frames(q)
    torque = point_torque(origins, rotations, link, origins[link] + rotations[link] @ point, force)
    for j in range(ARM.n):
        places = []
        for sign in (-1, 1):
            moved = q.copy()
            moved[j] += sign * STEP_RAD
            o, R = frames(moved)
            places.append(o[link] + R[link] @ point)
        work = force @ (places[1] - places[0]) / (2 * STEP_RAD)
        assert torque[j] == pytest.approx(work, abs=1e-5)


@given(st.integers(0, 2000), st.sampled_from([STEP, CONTACT]))
def test_a_push_is_inwards_on_an_uncovered_point(seed, scenario):
    push = sample_push(ARM, ARM.home, np.random.default_rng(seed), scenario)
    origins, rotations = frames(ARM.home)
    place = origins[push.link] + rotations[push.link] @ push.point
    inwards = push.force / np.linalg.norm(push.force)
    assert clearance(ARM, ARM.home[None], place - 1e-3 * inwards) > 0.5e-3 - 1e-9
    assert abs(clearance(ARM, ARM.home[None], place)) < 1e-6
    assert np.linalg.norm(push.force) <= (100.0 if scenario == STEP else FORCE_N[1]) + 1e-9
