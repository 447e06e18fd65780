"""The same scene with its ink as geometry, segmented by MuJoCo's own renderer.

A rendering samples sub-pixels at their middles, so the outermost samples lie half a sub-pixel inside a pixel's edge and
miss slivers of ink that reach less far into it. The ink's geometry is grown by that half, 0.3 mm, so that a pixel
counts as ink where ink reaches into it; without that, thin strokes score 0.93.
"""

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
from tests.sim.scenes import panda

from contactsafe.robot.mjcf import ARM_CONTYPE, numbers
from contactsafe.sim.scene import scene_mjcf
from contactsafe.tasks.wiping.whiteboard import INK

_TIMES = 8  # sub-pixels along a pixel's edge
_THICK = 1e-5  # m


class Renderings:
    """Masks of one board by MuJoCo, at eight times the resolution; use as a context."""

    def __init__(self, config, board, camera):
        self._model = mujoco.MjModel.from_xml_string(_with_ink(scene_mjcf(panda(), config), board, camera))
        self._data = mujoco.MjData(self._model)
        self._size = camera.size

    def __enter__(self):
        self._renderer = mujoco.Renderer(self._model, self._size * _TIMES, self._size * _TIMES)
        self._renderer.enable_segmentation_rendering()
        return self

    def __exit__(self, *error):
        self._renderer.close()

    def mask(self, q):
        """True where a pixel shows ink and its middle shows no arm, (size, size)."""
        model, data, size = self._model, self._data, self._size
        data.qpos[:7] = q
        mujoco.mj_forward(model, data)
        self._renderer.update_scene(data, "board_camera")
        ids, kinds = np.moveaxis(self._renderer.render(), -1, 0)
        geoms = np.where(kinds == mujoco.mjtObj.mjOBJ_GEOM, ids, -1)
        ink_geoms = [i for i in range(model.ngeom) if model.geom(i).name.startswith("ink")]
        arm_geoms = [i for i in range(model.ngeom) if model.geom_contype[i] == ARM_CONTYPE]
        blocks = geoms.reshape(size, _TIMES, size, _TIMES).transpose(0, 2, 1, 3)
        middles = blocks[:, :, _TIMES // 2, _TIMES // 2]
        return np.isin(blocks, ink_geoms).any(axis=(2, 3)) & ~np.isin(middles, arm_geoms)


def _half_sub_pixel(camera):
    """Compute its footprint on the board along x (foreshortened) and y, m; the camera looks along x."""
    away = np.subtract(camera.position, camera.target)
    half = np.linalg.norm(away) / camera.focal_px / (2 * _TIMES)
    return half * np.linalg.norm(away) / away[2], half


def _with_ink(xml, board, camera):
    root = ET.fromstring(xml)
    world = root.find("worldbody")
    _add_camera(world, camera)
    cell, z = board.config.cell, board.config.centre[2]
    grow_x, grow_y = _half_sub_pixel(camera)
    for k, (row, first, stop) in enumerate(_runs(board.cells == INK)):
        x, y = board.origin + np.array([row + 0.5, (first + stop) / 2]) * cell
        ET.SubElement(
            world, "geom", name=f"ink{k}", type="box", pos=numbers((x, y, z + _THICK)),
            size=numbers((cell / 2 + grow_x, (stop - first) * cell / 2 + grow_y, _THICK)), contype="0", conaffinity="0",
        )  # fmt: skip
    return ET.tostring(root, encoding="unicode")


def _add_camera(world, camera):
    ET.SubElement(world, "body", name="camera_target", pos=numbers(camera.target))
    fovy = math.degrees(2 * math.atan(camera.size / 2 / camera.focal_px))
    ET.SubElement(
        world, "camera", name="board_camera", mode="targetbody", target="camera_target",
        pos=numbers(camera.position), fovy=numbers([fovy]),
    )  # fmt: skip


def _runs(ink):
    """Row, first and stop column of each run of inked cells."""
    for row in range(ink.shape[0]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], ink[row].astype(int), [0]])))
        for first, stop in edges.reshape(-1, 2):
            yield row, int(first), int(stop)
