"""Pictures of a printed target as a D455 would take them: perspective, lens, blur, noise; and poses to plant."""

import functools
import tempfile
from pathlib import Path

import cv2
import numpy as np

from contactsafe.vision.charuco import CharucoTarget
from contactsafe.vision.lens import Lens
from contactsafe.vision.rigid import inverse, pose_of
from contactsafe.vision.sheet import write_sheet

D455 = Lens(1280, 720, 639.0, 638.0, 642.0, 362.0, (-0.056, 0.065, 0.0004, -0.0003, 0.0))
TARGET = CharucoTarget()
PAPER_M = (0.297, 0.210)


@functools.cache
def page():
    """Paint the A4 page as it is printed, two pixels a millimetre: finer would alias."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.png"
        write_sheet(TARGET, path)
        fine = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    return cv2.resize(fine, None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA)


def looking(position, at=(0.0, 0.0, 0.0), roll=0.0):
    """Return the pose of a camera at a position that looks at a point; turned about its axis by roll, rad."""
    forward = np.subtract(at, position) / np.linalg.norm(np.subtract(at, position))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.column_stack([right, np.cross(forward, right), forward])
    return pose_of(axes @ turn([0.0, 0.0, roll]), position)


def turn(vector):
    return cv2.Rodrigues(np.asarray(vector, dtype=float))[0]


@functools.cache
def rays_of(lens, fine):
    """Return the direction of each of a pixel's samples, camera's axes, (n, 3)."""
    u, v = np.meshgrid(*((np.arange(n * fine) + 0.5) / fine - 0.5 for n in (lens.width, lens.height)))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)[:, None]
    straight = cv2.undistortPoints(pixels, lens.matrix, np.array(lens.distortion))[:, 0]
    return np.column_stack([straight, np.ones(len(straight))]).astype(np.float32)


def picture(pose_target_camera, seed=0, lens=D455, noise=3.0):
    """Take a picture, uint8 (720, 1280, 3), of the page on a grey table."""
    fine = 2  # samples along an edge of a pixel
    rays = rays_of(lens, fine) @ pose_target_camera[:3, :3].T.astype(np.float32)
    far = np.where(rays[:, 2] < -1e-6, -pose_target_camera[2, 3] / np.minimum(rays[:, 2], -1e-6), 1e3)
    x, y = (pose_target_camera[:2, 3] + rays[:, :2] * far[:, None]).T
    places = [2e3 * (x + PAPER_M[0] / 2) - 0.5, 2e3 * (PAPER_M[1] / 2 - y) - 0.5]
    shape = (lens.height * fine, lens.width * fine)
    maps = [np.clip(place, -1e4, 3e4).reshape(shape).astype(np.float32) for place in places]
    grey = cv2.remap(page(), *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=110)
    grey = cv2.resize(grey, (lens.width, lens.height), interpolation=cv2.INTER_AREA).astype(np.float32)
    grey = cv2.GaussianBlur(30.0 + 0.75 * grey, (0, 0), 0.7)
    grain = np.random.default_rng(seed).standard_normal((*grey.shape, 3), dtype=np.float32)
    return np.clip(grey[..., None] + noise * grain, 0, 255).astype(np.uint8)


def apart(found, planted):
    """Return how far two poses are apart, mm and degrees."""
    between = inverse(planted) @ found
    turned = np.degrees(np.linalg.norm(cv2.Rodrigues(between[:3, :3])[0]))
    return 1000 * np.linalg.norm(between[:3, 3]), turned
