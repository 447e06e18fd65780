"""Points laid on points, a target that was touched, a target that the hand shows: planted poses come out."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError

pytest.importorskip("cv2")

from tests.vision.rendered import TARGET, apart, looking, turn

from contactsafe.vision.hand_eye import solve_hand_eye
from contactsafe.vision.rigid import angles, fit_rigid, inverse, moved, pose_of
from contactsafe.vision.touched import place_target

LYING = pose_of(turn([0.004, -0.006, 1.7]), [0.52, -0.03, 0.013])
CAMERA = looking((0.9, -0.5, 0.7), at=(0.4, 0.1, 0.3))
HELD = pose_of(turn([0.3, 0.2, -0.5]), [0.02, -0.01, 0.14])


def poses(count, seed=0, axes=3):
    """Sample random poses that turn about some of the axes alone."""
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-0.8, 0.8, (count, 3)) * (np.arange(3) < axes)
    return np.array([pose_of(turn(each), rng.uniform(-0.3, 0.3, 3)) for each in turns])


@pytest.mark.parametrize("seed", range(5))
def test_any_rigid_motion_comes_out_exactly_and_is_never_a_reflection(seed):
    rng, (pose,) = np.random.default_rng(seed), poses(1, seed)
    flat = rng.uniform(-1.0, 1.0, (4, 3)) * [1.0, 1.0, 0.0]
    fit = fit_rigid(flat, moved(pose, flat))
    np.testing.assert_allclose(fit.pose, pose, atol=1e-12)
    assert fit.residual_m < 1e-12
    assert np.linalg.det(fit_rigid(flat, rng.uniform(size=(4, 3))).pose[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(inverse(pose) @ pose, np.eye(4), atol=1e-12)
    assert angles(pose[:3, :3]) == pytest.approx(np.radians(apart(pose, np.eye(4))[1]))


@pytest.mark.parametrize(("a", "told"), [
    (np.zeros((2, 3)), "give three or more"),
    (np.zeros((4, 2)), "give three or more"),
    (np.outer([0.0, 1.0, 2.0], [0.1, 0.2, 0.3]), "along one line, .* span a triangle"),
])  # fmt: skip
def test_points_that_tell_no_pose_are_refused(a, told):
    with pytest.raises(InvalidInputError, match=told):
        fit_rigid(a, a)


def touch(letters, noise_m=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return {letter: moved(LYING, TARGET.named[letter]) + rng.normal(0.0, noise_m, 3) for letter in letters}


@pytest.mark.parametrize("letters", ["ABC", "DCA", "ABCD"])
def test_a_target_is_where_its_touched_corners_say(letters):
    """Half a millimetre of noise on each corner; the residual of four shows it."""
    found = [place_target(TARGET, touch(letters, 0.0005, seed)) for seed in range(20)]
    away = np.array([apart(fit.pose, LYING) for fit in found])
    assert away[:, 0].mean() < 1.0
    assert away[:, 1].mean() < 0.4
    assert max(fit.residual_m for fit in found) < 0.002
    assert place_target(TARGET, touch(letters)).residual_m < 1e-9


def test_touched_corners_that_cannot_be_the_targets_are_refused_in_one_line():
    good = touch("ABC")
    far = good | {"B": moved(LYING, TARGET.named["B"] + [0.006, 0.0, 0.0])}
    mirrored = {"A": good["B"], "B": good["A"], "C": moved(LYING, TARGET.named["D"])}
    for touched, told in [
        ({letter: good[letter] for letter in "AB"}, "corners A, B were touched; give three or more of A, B, C, D"),
        (good | {"E": good["A"]}, "corners A, B, C, E were touched"),
        (good | {"A": np.array([0.1, np.nan, 0.0])}, "not three finite numbers"),
        (far, r"corners A and B were touched 258\.0 mm apart, on the target they are 252\.0 mm, allowed 3 mm"),
        (good | {"A": good["B"], "B": good["A"]}, "corners A and C were touched"),
        (mirrored, "printed side is turned .* touch each corner at its letter"),
    ]:
        with pytest.raises(InvalidInputError, match=told) as caught:
            place_target(TARGET, touched)
        assert "\n" not in str(caught.value)


def shown_by_hand(hands, noise_m=0.0, noise_rad=0.0, seed=0):
    rng = np.random.default_rng(seed)
    seen = inverse(CAMERA) @ hands @ HELD
    jolts = [pose_of(turn(rng.normal(0.0, noise_rad, 3)), rng.normal(0.0, noise_m, 3)) for _ in hands]
    return seen @ np.array(jolts)


@pytest.mark.parametrize("count", [3, 4, 12])
def test_the_planted_camera_comes_out_exactly_from_any_poses_of_the_hand(count):
    hands = poses(count, count)
    found = solve_hand_eye(hands, shown_by_hand(hands))
    np.testing.assert_allclose(found.pose_base_camera, CAMERA, atol=1e-9)
    np.testing.assert_allclose(found.pose_hand_target, HELD, atol=1e-9)
    assert found.residual_m < 1e-9


def test_noise_of_a_camera_leaves_millimetres():
    hands = poses(15, 3)
    found = solve_hand_eye(hands, shown_by_hand(hands, 0.001, np.radians(0.15)))
    millimetres, degrees = apart(found.pose_base_camera, CAMERA)
    assert millimetres < 4.0
    assert degrees < 0.3
    assert 0.0005 < found.residual_m < 0.004
    assert found.residual_rad < np.radians(0.4)


def test_hands_that_tell_no_camera_are_refused_in_one_line():
    same, good = poses(8, axes=1), poses(8)
    slipped = shown_by_hand(good)
    slipped[3] = slipped[3] @ pose_of(np.eye(3), [0.05, 0.0, 0.0])
    for hands, seen, told in [
        (good[:2], good[:2], "2 poses of the hand, 2 of the target; give three or more"),
        (good, good[:5], "8 poses of the hand, 5 of the target"),
        (same, shown_by_hand(same), r"about one axis and 0\.0° about a second one .* at least 10°"),
        (good, slipped, r"hand and camera disagree .* allowed 5 mm and 1°; did the target slip"),
    ]:
        with pytest.raises(InvalidInputError, match=told) as caught:
            solve_hand_eye(hands, seen)
        assert "\n" not in str(caught.value)
