"""Where something may touch an arm: points on its surface, evenly spread, and on its tool."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from tests.robot.worlds import TWO_JOINTS

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.description import Capsule
from contactsafe.robot.touchable import capsule_places, touchable


@pytest.fixture(scope="module")
def panda():
    return robots.panda("hand")


def distance(points, capsule):
    """Give the distance of points from a capsule's surface, negative within it, (P,), m."""
    start, end = np.array(capsule.start), np.array(capsule.end)
    along = end - start
    fraction = np.clip((points - start) @ along / max(along @ along, 1e-12), 0.0, 1.0)
    return np.linalg.norm(points - start - np.outer(fraction, along), axis=1) - capsule.radius


def test_every_point_is_on_its_link_and_within_none_of_its_capsules(panda):
    places = capsule_places(panda.description)
    assert set(places[:, 0]) == set(range(2, 8))
    for link, described in enumerate(panda.description.links, start=1):
        points = places[places[:, 0] == link, 1:4]
        if len(points):
            depths = np.array([distance(points, capsule) for capsule in described.capsules])
            assert np.abs(np.min(np.abs(depths), axis=0)).max() < 1e-9
            assert depths.min() > -1e-5


def test_normals_are_outward_and_of_unit_length(panda):
    places = capsule_places(panda.description)
    np.testing.assert_allclose(np.linalg.norm(places[:, 4:], axis=1), 1.0, atol=1e-9)
    for link, described in enumerate(panda.description.links, start=1):
        of_link = places[places[:, 0] == link]
        outside = of_link[:, 1:4] + 1e-4 * of_link[:, 4:]
        if len(of_link):
            nearest = np.min([distance(outside, capsule) for capsule in described.capsules], axis=0)
            np.testing.assert_allclose(nearest, 1e-4, atol=1e-5)


def test_any_place_of_the_surface_has_a_point_near(panda):
    """Round ends as well: a grid along the sides alone leaves them out."""
    rng, places = np.random.default_rng(0), capsule_places(panda.description)
    for link, described in enumerate(panda.description.links, start=1):
        if link == 1:
            continue
        points = places[places[:, 0] == link, 1:4]
        for capsule in described.capsules:
            start, end = np.array(capsule.start), np.array(capsule.end)
            axis = (end - start) / np.linalg.norm(end - start)
            tip = end + capsule.radius * axis
            if min(distance(tip[None], other)[0] for other in described.capsules) > -1e-9:
                assert np.linalg.norm(points - tip, axis=1).min() < 0.05
            across = np.cross(axis, rng.standard_normal(3))
            side = 0.5 * (start + end) + capsule.radius * across / np.linalg.norm(across)
            if min(distance(side[None], other)[0] for other in described.capsules) > -1e-9:
                assert np.linalg.norm(points - side, axis=1).min() < 0.05


def test_the_tool_comes_last_and_its_point_first_of_it(panda):
    places = panda.places
    of_tool = places[:, 0] == 0
    assert of_tool.sum() == 61
    assert of_tool[-61:].all()
    assert not places[-61, 1:4].any()
    bare = robots.panda(None)
    assert np.count_nonzero(bare.places[:, 0] == 0) == 1


def test_a_tip_has_its_corners(panda):
    wiper = robots.panda("wiper")
    points = wiper.places[wiper.places[:, 0] == 0, 1:4]
    half = np.array(wiper.tool.tip.half_size)
    for corner in ([1, 1], [1, -1], [-1, 1], [-1, -1]):
        lower = np.array([corner[0] * half[0], corner[1] * half[1], 0.0])
        assert np.linalg.norm(points - lower, axis=1).min() < 1e-9


def test_an_arm_without_surface_has_the_end_effector_point_alone():
    assert touchable(np.zeros((0, 7)), None).tolist() == [[0.0] * 6 + [1.0]]


def test_a_sphere_is_a_capsule_too(panda):
    links = list(panda.description.links)
    links[6] = replace(links[6], capsules=(Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.05),))
    places = capsule_places(replace(panda.description, links=tuple(links)))
    points = places[places[:, 0] == 7, 1:4]
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.05, atol=1e-9)


def test_a_users_arm_has_its_geoms_and_its_tool(panda):
    arm = robots.from_mjcf(mujoco.MjModel.from_xml_string(TWO_JOINTS), "tip")
    links = arm.places[arm.places[:, 0] > 0]
    np.testing.assert_array_equal(links, arm.surface)
    assert np.count_nonzero(arm.places[:, 0] == 0) >= 1


@pytest.mark.parametrize(
    ("places", "text"),
    [
        ([[9, 0, 0, 0, 0, 0, 1], [0] * 6 + [1]], "a link that is none of 0 to 7"),
        ([[1.5, 0, 0, 0, 0, 0, 1], [0] * 6 + [1]], "a link that is none of 0 to 7"),
        ([[0] * 6 + [1], [3, 0, 0, 0, 0, 0, 1]], r"the tool's \(link 0\) last"),
        ([[3, 0, 0, 0, 0, 0, 1]], r"the tool's \(link 0\) last"),
        ([[3, 0, 0, 0, 0, 0, 1]] * 704 + [[0] * 6 + [1]], "are 705; give at most 704"),
    ],
)
def test_places_that_no_arm_has_are_refused(panda, places, text):
    with pytest.raises(InvalidInputError, match=text):
        replace(panda, places=np.array(places, float))
