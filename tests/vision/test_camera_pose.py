"""A camera before a printed target: the pose that was planted comes out, and what cannot be told is refused."""

import dataclasses

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError

pytest.importorskip("cv2")

from tests.vision.rendered import D455, TARGET, apart, looking, picture

from contactsafe.vision.camera_pose import MOST_PX, find_camera
from contactsafe.vision.charuco import CharucoTarget, Corners
from contactsafe.vision.rigid import inverse

STANDS = [
    looking((0.55, 0.0, 0.64)),
    looking((-0.3, 0.5, 0.7), at=(0.1, -0.05, 0.0), roll=0.3),
    looking((0.15, -0.6, 0.5), at=(-0.05, 0.1, 0.0), roll=-1.2),
]


def shown(pose, noise_px=0.0, lens=D455, seed=0):
    """Project all corners for a camera, without a picture."""
    import cv2

    ids, camera = np.arange(24), inverse(pose)
    points = TARGET.points(ids)
    pixels = cv2.projectPoints(
        points, cv2.Rodrigues(camera[:3, :3])[0], camera[:3, 3], lens.matrix, np.array(lens.distortion)
    )[0].reshape(-1, 2)
    return Corners(ids, pixels + np.random.default_rng(seed).normal(0.0, noise_px, pixels.shape))


@pytest.mark.parametrize("planted", STANDS)
def test_the_planted_pose_comes_out_of_noisy_pictures_through_the_lens(planted):
    found = find_camera(TARGET, D455, [TARGET.find(picture(planted, seed)) for seed in range(5)])
    millimetres, degrees = apart(found.pose_target_camera, planted)
    assert millimetres < 2.0
    assert degrees < 0.3
    assert found.error_px < 0.3
    assert found.error_px < found.largest_px < 1.5
    assert found.spread_m < 0.003
    assert found.pictures == 5
    assert found.corners > 5 * 15


def test_a_lens_that_is_not_the_cameras_is_refused():
    seen = shown(looking((0.25, 0.1, 0.4), at=(0.25, 0.3, 0.0)), 0.05)
    straight = dataclasses.replace(D455, distortion=(0.0,) * 5)
    assert find_camera(TARGET, D455, [seen]).error_px < 0.1
    with pytest.raises(InvalidInputError, match="is the lens this camera's"):
        find_camera(TARGET, straight, [seen])


def test_pictures_with_too_few_corners_do_not_count_and_alone_are_refused():
    whole = shown(STANDS[0], 0.1)
    few, row = (Corners(whole.ids[:n], whole.pixels[:n]) for n in (5, 6))
    none = TARGET.find(np.full((720, 1280, 3), 200, np.uint8))
    assert len(none.ids) == 0
    assert find_camera(TARGET, D455, [few, whole, none]).pictures == 1
    for seen in ([few], [row], [none], []):
        with pytest.raises(InvalidInputError, match=r"no picture shows enough of the target: .* at least 8") as caught:
            find_camera(TARGET, D455, seen)
        assert "\n" not in str(caught.value)


def test_a_camera_that_moved_between_the_pictures_is_told():
    seen = [shown(STANDS[0], 0.1), shown(looking((0.55, 0.05, 0.64), at=(0.0, 0.05, 0.0)), 0.1)]
    with pytest.raises(InvalidInputError, match="moved between the pictures"):
        find_camera(TARGET, D455, seen)


def test_corners_that_do_not_fit_together_are_refused():
    with pytest.raises(InvalidInputError, match=f"pixels from where they should be, allowed {MOST_PX:g}"):
        find_camera(TARGET, D455, [shown(STANDS[0], 1.5)])


def test_a_small_target_far_away_is_ambiguous():
    """Without perspective a plane and its mirror image look alike."""
    import cv2

    small = CharucoTarget(7, 5, 0.006)
    camera = inverse(looking((0.4, 0.0, 2.5)))
    pixels = cv2.projectPoints(
        small.points(np.arange(24)), cv2.Rodrigues(camera[:3, :3])[0], camera[:3, 3], D455.matrix, np.zeros(5)
    )[0].reshape(-1, 2)
    seen = Corners(np.arange(24), pixels + np.random.default_rng(1).normal(0.0, 0.15, pixels.shape))
    with pytest.raises(InvalidInputError, match=r"the pose is ambiguous: .*; come nearer, or use a larger target"):
        find_camera(small, dataclasses.replace(D455, distortion=(0.0,) * 5), [seen])


@pytest.mark.parametrize("planted", STANDS)
def test_a_target_that_is_partly_covered_is_enough(planted):
    """A hand, a glare, the picture's edge: corners are known by number."""
    image = picture(planted, 3)
    seen = TARGET.find(image)
    middle = np.quantile(seen.pixels[:, 0], 0.75)
    image[:, int(middle) :] = 120
    rest = TARGET.find(image)
    assert 8 <= len(rest.ids) < len(seen.ids)
    assert set(rest.ids) <= set(seen.ids)
    millimetres, degrees = apart(find_camera(TARGET, D455, [rest]).pose_target_camera, planted)
    assert millimetres < 8.0
    assert degrees < 0.8


def test_grey_and_colour_give_the_same_corners():
    image = picture(STANDS[0], 0, noise=0.0)
    colour, grey = TARGET.find(image), TARGET.find(np.ascontiguousarray(image[..., 0]))
    np.testing.assert_array_equal(colour.ids, grey.ids)
    np.testing.assert_allclose(colour.pixels, grey.pixels, atol=0.05)


def test_more_pictures_bring_the_pose_nearer():
    planted, away = STANDS[0], []
    seen = [shown(planted, 0.3, seed=seed) for seed in range(40)]
    for several in (1, 10):
        found = [find_camera(TARGET, D455, seen[k : k + several]) for k in range(0, 40, several)]
        away.append(np.mean([apart(one.pose_target_camera, planted)[0] for one in found]))
    assert away[1] < 0.6 * away[0]


def test_a_target_of_another_size_is_seen_at_another_distance():
    """A square that was not measured shifts the camera by as much: the touched corners tell it."""
    seen = shown(STANDS[0])
    larger = find_camera(CharucoTarget(7, 5, 0.036 * 1.03), D455, [seen]).pose_target_camera
    assert np.linalg.norm(larger[:3, 3]) == pytest.approx(1.03 * np.linalg.norm(STANDS[0][:3, 3]), rel=1e-3)
