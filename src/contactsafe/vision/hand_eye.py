"""Where a camera beside a robot stands, from pictures of a target that the robot's hand holds."""

import itertools
from typing import NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.opencv import cv2
from contactsafe.vision.rigid import angles, inverse, nearest_rotation, pose_of

_TURNED_RAD = np.radians(10.0)
"""Least turn of the hand about a second axis, root mean square over all pairs of poses."""

_RESIDUAL_M, _RESIDUAL_RAD = 0.005, np.radians(1.0)


class HandEye(NamedTuple):
    """A camera beside a robot.

    Attributes:
        pose_base_camera: (4, 4).
        pose_hand_target: where the hand holds the target, (4, 4).
        residual_m, residual_rad: root mean square over the poses, of the target's place by hand against by camera.
    """

    pose_base_camera: np.ndarray
    pose_hand_target: np.ndarray
    residual_m: float
    residual_rad: float


def solve_hand_eye(poses_base_hand: np.ndarray, poses_camera_target: np.ndarray) -> HandEye:
    """Find the pose of a camera that stands still while the hand shows it a target.

    For every pair of poses A X = X B, with A the hand's motion in the base, B the target's in the camera's frame and X
    the camera's pose; rotation by the logarithms of A and B, translation by linear least squares: Park and Martin,
    Robot sensor calibration: solving AX = XB on the Euclidean group, IEEE Trans. Robotics and Automation 10(5), 1994.

    Args:
        poses_base_hand: of the hand in the robot's base, (n, 4, 4), n ≥ 3.
        poses_camera_target: of the target in the camera's frame, seen at the same time, (n, 4, 4).

    Raises:
        InvalidInputError: fewer than three poses, rotations that are too alike, or a residual over 5 mm or 1°.
    """
    hands, targets = np.asarray(poses_base_hand, dtype=float), np.asarray(poses_camera_target, dtype=float)
    if hands.shape != targets.shape or hands.ndim != 3 or len(hands) < 3:
        raise InvalidInputError(f"{len(hands)} poses of the hand, {len(targets)} of the target; give three or more")
    pairs = list(itertools.combinations(range(len(hands)), 2))
    A = np.array([hands[i] @ inverse(hands[j]) for i, j in pairs])
    B = np.array([targets[i] @ inverse(targets[j]) for i, j in pairs])
    alpha, beta = _logarithms(A), _logarithms(B)
    _refuse_alike(alpha)
    R = nearest_rotation(alpha.T @ beta)
    left = np.concatenate(A[:, :3, :3] - np.eye(3))
    right = np.concatenate(B[:, :3, 3] @ R.T - A[:, :3, 3])
    camera = pose_of(R, np.linalg.lstsq(left, right, rcond=None)[0])
    held = inverse(hands) @ camera @ targets
    middle = pose_of(nearest_rotation(held[:, :3, :3].mean(axis=0)), held[:, :3, 3].mean(axis=0))
    apart, turned = held[:, :3, 3] - middle[:3, 3], angles(middle[:3, :3].T @ held[:, :3, :3])
    residual_m, residual_rad = float(np.sqrt((apart**2).sum(axis=1).mean())), float(np.sqrt((turned**2).mean()))
    if residual_m > _RESIDUAL_M or residual_rad > _RESIDUAL_RAD:
        raise InvalidInputError(
            f"hand and camera disagree about the target by {1000 * residual_m:.1f} mm and "
            f"{np.degrees(residual_rad):.2f}°, allowed {1000 * _RESIDUAL_M:g} mm and {np.degrees(_RESIDUAL_RAD):g}°; "
            "did the target slip, or does a picture belong to other joint positions?"
        )
    return HandEye(camera, middle, residual_m, residual_rad)


def _logarithms(poses: np.ndarray) -> np.ndarray:
    """Return the rotation vectors of poses, (n, 4, 4): (n, 3), rad."""
    return np.array([np.ravel(cv2.Rodrigues(pose[:3, :3])[0]) for pose in poses])


def _refuse_alike(vectors: np.ndarray) -> None:
    """Refuse motions whose rotations, (n, 3), rad, do not span a plane: the camera's place would be anywhere."""
    turned = np.linalg.svd(vectors / np.sqrt(len(vectors)), compute_uv=False)
    if turned[1] < _TURNED_RAD:
        raise InvalidInputError(
            f"the hand turned by {np.degrees(turned[0]):.0f}° about one axis and {np.degrees(turned[1]):.1f}° about a "
            f"second one (root mean square), at least {np.degrees(_TURNED_RAD):g}° are needed about both; show the "
            "target tilted forwards, sideways and turned"
        )
