"""Photographs of the board as a camera would take them: uneven light, shadows, glare, faded ink, noise, the arm.

The camera is the mask's at the resolution it is cropped from (see `Camera`). Everything of an episode follows from one
seed and everything of a picture from that and its number, so there is no state to keep.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.robot.mjcf import ARM_CONTYPE
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.camera import camera_axes, plane_homography
from contactsafe.tasks.wiping.whiteboard import INK
from contactsafe.vision.opencv import cv2
from contactsafe.vision.silhouette import Solids, cast, fill, on_plane, project, rims, silhouette

PHOTO_PX = 455
"""Pixels along an edge of a photograph: the square that `Camera` says the mask is scaled from."""

INKS = {
    "black": (0.07, 0.07, 0.09), "blue": (0.10, 0.18, 0.55), "red": (0.75, 0.10, 0.12), "green": (0.08, 0.45, 0.22),
}  # fmt: skip
"""Reflectance of whiteboard pens in red, green and blue."""

_BOARD, _TABLE, _OBJECT = (0.90, 0.91, 0.90), (0.55, 0.47, 0.38), 0.12  # reflectances
_ROUNDNESS = ((1.0, 0.6), (0.7, 0.8))  # fraction of a capsule's radius, and its brightness within
_TO_MIDDLES = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])  # OpenCV counts from the middle of a pixel
_NOISE_SIGMA, _SPARE = 25.0, 64  # of the grain as stored about 128; pixels by which it is larger than a picture


def enlarged(camera: Camera) -> Camera:
    """Return the camera of the photograph from which a mask's is scaled."""
    return replace(camera, size=PHOTO_PX, focal_px=camera.focal_px * PHOTO_PX / camera.size)


def corners_of(board: BoardConfig) -> np.ndarray:
    """Return a board's corners in turn around it, (4, 2), world, m."""
    halves = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)]) * np.array(board.size) / 2
    return np.array(board.centre[:2]) + halves


@dataclass(frozen=True)
class Conditions:
    """Light, pen and camera of an episode.

    Attributes:
        ink: name of the pen.
        opacity: of the most faded ink, fraction; elsewhere up to 1.
        exposure: brightness of the board in full light, fraction of the sensor's range.
        tint: of the light in red, green and blue.
        gradient: change of brightness across the picture to the right and down, fraction.
        vignette: brightness lost in the corners, fraction.
        edge_depth: fraction of the light that is missing beyond a shadow's edge.
        edge_angle: of that edge, rad.
        edge_offset: of that edge from the picture's middle, fraction of its width.
        edge_soft: width of its fall, fraction of the picture's width.
        lamp: place of the lamp that casts the arm's shadow, world, m.
        arm_depth: fraction of the light that is missing in the arm's shadow.
        arm_soft: blur of that shadow, pixels.
        glare: brightness added in the middle of a reflection, fraction of the sensor's range.
        glare_place: column and row of it, fractions of the picture's width.
        glare_size: radius of it, fraction of the picture's width.
        smudge: how much darker the dirtiest place of the board is, fraction.
        blur: of the lens, standard deviation, pixels.
        noise: of a grey level in full light, standard deviation, levels of 255.
        shift: of the picture against the calibration, columns and rows, pixels.
    """

    ink: str
    opacity: float
    exposure: float
    tint: tuple[float, float, float]
    gradient: tuple[float, float]
    vignette: float
    edge_depth: float
    edge_angle: float
    edge_offset: float
    edge_soft: float
    lamp: tuple[float, float, float]
    arm_depth: float
    arm_soft: float
    glare: float
    glare_place: tuple[float, float]
    glare_size: float
    smudge: float
    blur: float
    noise: float
    shift: tuple[float, float]


def sample_conditions(rng: np.random.Generator, severity: float | None = None) -> Conditions:
    """Sample the conditions of an episode.

    Args:
        rng: samples them.
        severity: from 0, an evenly lit board, to 1, a lamp on one side and sharp shadows; sampled where None.
    """
    s = rng.uniform() if severity is None else severity
    return Conditions(
        ink=list(INKS)[rng.integers(len(INKS))],
        opacity=1.0 - 0.4 * s * rng.uniform(),
        exposure=rng.uniform(0.85 - 0.25 * s, 0.9),
        tint=tuple(1.0 + 0.06 * s * rng.uniform(-1, 1, 3)),
        gradient=tuple(0.5 * s * rng.uniform(-1, 1, 2)),
        vignette=0.3 * s * rng.uniform(),
        edge_depth=0.5 * s * rng.uniform(),
        edge_angle=rng.uniform(-np.pi, np.pi),
        edge_offset=rng.uniform(-0.4, 0.4),
        edge_soft=rng.uniform(0.02, 0.15),
        lamp=(rng.uniform(-0.6, 1.4), rng.uniform(-1.2, 1.2), rng.uniform(1.6, 2.6)),
        arm_depth=0.45 * s * rng.uniform(0.3, 1),
        arm_soft=rng.uniform(4.0, 12.0),
        glare=0.35 * s * rng.uniform() if rng.uniform() < 0.5 else 0.0,
        glare_place=tuple(rng.uniform(0.1, 0.9, 2)),
        glare_size=rng.uniform(0.03, 0.12),
        smudge=0.08 * s * rng.uniform(),
        blur=rng.uniform(0.5, 0.6 + 0.6 * s),
        noise=1.0 + 4.0 * s * rng.uniform(),
        shift=tuple(1.5 * s * rng.uniform(-1, 1, 2)),
    )


@dataclass
class _Scene:
    """What stays the same from picture to picture, uint8; a fraction of 1 is 255."""

    seed: int
    conditions: Conditions
    homography: np.ndarray  # as it is, not as it was calibrated
    blank: np.ndarray  # the lit board and table without ink, (n, n, 3)
    opacity: np.ndarray  # of the ink, (n, n), fraction
    glare: np.ndarray  # levels added, (n, n, 3)


class Photographer(Independent):
    """A camera over a board, with the arm in its view.

    Args:
        camera: the mask's.
        board: the board.
        model: plant model; its geoms with contype 2 are the arm's.

    Attributes:
        homography: board plane to the photograph's pixels as calibrated, (3, 3).
        corners: of the board, (4, 2), m.
    """

    _bound = ("_posed",)

    def __init__(self, camera: Camera, board: BoardConfig, model: mujoco.MjModel):
        fine = enlarged(camera)
        x, y, z = board.centre
        half_x, half_y = np.array(board.size) / 2
        self.homography = plane_homography(fine, z)
        self.corners = corners_of(board)
        self._board = board
        self._eye = np.array(camera.position)
        R = camera_axes(camera).T
        middle = PHOTO_PX / 2
        K = np.array([[fine.focal_px, 0.0, middle], [0.0, fine.focal_px, middle], [0.0, 0.0, 1.0]])
        self._projection = K @ np.column_stack([R, -R @ self._eye])
        self._model = model
        self._arm = np.flatnonzero(model.geom_contype == ARM_CONTYPE)
        self._is_box = model.geom_type[self._arm] == mujoco.mjtGeom.mjGEOM_BOX
        self._sizes = model.geom_size[self._arm].copy()
        self._colours = model.geom_rgba[self._arm, :3].copy()
        corner_x, corner_y = x - half_x, y - half_y
        cell = board.cell
        self._cells_to_board = np.array([[0, cell, corner_x + cell / 2], [cell, 0, corner_y + cell / 2], [0, 0, 1.0]])
        grain = np.random.default_rng(0).normal(128.0, _NOISE_SIGMA, (PHOTO_PX + _SPARE, PHOTO_PX + _SPARE, 3))
        self._noise = np.clip(grain, 0, 255).astype(np.uint8)
        self._scene: _Scene | None = None
        self._bind()

    def _bind(self) -> None:
        self._posed = mujoco.MjData(self._model)

    def solids(self, data: mujoco.MjData) -> Solids:
        """Return the arm's shapes where they are."""
        return Solids(self._is_box, self._sizes, data.geom_xpos[self._arm], data.geom_xmat[self._arm].reshape(-1, 3, 3))

    def solids_at(self, q: np.ndarray) -> Solids:
        """Return the arm's shapes where joint positions q (n,), rad, say that they are."""
        self._posed.qpos[: len(q)] = q
        mujoco.mj_kinematics(self._model, self._posed)
        return self.solids(self._posed)

    def hidden(self, solids: Solids) -> np.ndarray:
        """Return what kinematics know of the picture: 255 where the arm stands, uint8 (n, n)."""
        return silhouette(solids, self._eye, self._projection, PHOTO_PX)

    def take(self, cells: np.ndarray, solids: Solids, seed: int, number: int) -> np.ndarray:
        """Take a photograph.

        Args:
            cells: the board's, uint8, (rows, columns).
            solids: the arm's.
            seed: of light, pen and camera.
            number: of the picture under them; it chooses the noise.

        Returns:
            uint8, (455, 455, 3), red, green and blue.
        """
        if self._scene is None or self._scene.seed != seed:
            self._scene = self._compose(seed, sample_conditions(np.random.default_rng(seed)))
        return self._expose(self._scene, cells, solids, number)

    def take_under(
        self, conditions: Conditions, cells: np.ndarray, solids: Solids, seed: int = 0, number: int = 0
    ) -> np.ndarray:
        """Take a photograph under conditions of one's own; see `take`."""
        return self._expose(self._compose(seed, conditions), cells, solids, number)

    def _compose(self, seed: int, c: Conditions) -> _Scene:
        """Light the empty board and the table."""
        rng = np.random.default_rng([seed, 1])
        n = PHOTO_PX
        row, column = np.meshgrid(*2 * [(np.arange(n, dtype=np.float32) + 0.5) / n - 0.5], indexing="ij")
        light = 1 + c.gradient[0] * column + c.gradient[1] * row - c.vignette * 2 * (column**2 + row**2)
        across = np.cos(c.edge_angle) * column + np.sin(c.edge_angle) * row - c.edge_offset
        light *= 1 - c.edge_depth / (1 + np.exp(-np.clip(across / (c.edge_soft / 4), -30, 30)))
        homography = np.array([[1, 0, c.shift[0]], [0, 1, c.shift[1]], [0, 0, 1]]) @ self.homography
        on_board = np.zeros((n, n), np.uint8)
        fill(on_board, on_plane(self.corners, homography), 1)
        dirt = 1 - c.smudge * np.clip(_smooth_noise(rng, 7), 0, 2) / 2
        grain = 1 + 0.06 * _smooth_noise(rng, 40) + 0.04 * _smooth_noise(rng, 150)
        white = 255 * c.exposure / max(_BOARD)
        blank = [
            cv2.convertScaleAbs(tint * white * light * np.where(on_board > 0, board * dirt, table * grain))
            for tint, board, table in zip(c.tint, _BOARD, _TABLE, strict=True)
        ]
        away = (column + 0.5 - c.glare_place[0]) ** 2 + (row + 0.5 - c.glare_place[1]) ** 2
        return _Scene(
            seed, c, homography,
            blank=cv2.merge(blank),
            opacity=cv2.convertScaleAbs(255 - 255 * (1 - c.opacity) * np.clip(0.5 + 0.5 * _smooth_noise(rng, 9), 0, 1)),
            glare=_of_three(cv2.convertScaleAbs(255 * c.glare * np.exp(-away / (2 * c.glare_size**2)))),
        )  # fmt: skip

    def _expose(self, scene: _Scene, cells: np.ndarray, solids: Solids, number: int) -> np.ndarray:
        c = scene.conditions
        ink = cv2.multiply(self._cover(scene, cells == INK), scene.opacity, scale=1 / 255)
        picture = _darkened(scene.blank, ink, INKS[c.ink])
        if (cells > INK).any():
            picture = _darkened(picture, self._cover(scene, cells > INK), (_OBJECT,) * 3)
        picture = cv2.multiply(picture, _of_three(255 - self._shadow(scene, solids)), scale=1 / 255)
        picture = cv2.add(picture, scene.glare)
        self._stand_before(picture, c, solids)
        picture = cv2.GaussianBlur(picture, (5, 5), c.blur)
        i, j = np.random.default_rng([scene.seed, 2, number]).integers(_SPARE, size=2)
        grain = self._noise[i : i + PHOTO_PX, j : j + PHOTO_PX]
        strength = c.noise / _NOISE_SIGMA
        return cv2.addWeighted(picture, 1.0, grain, strength, -128 * strength)

    def _cover(self, scene: _Scene, where: np.ndarray) -> np.ndarray:
        """Fraction of each pixel that something on the board covers, (n, n) uint8."""
        H = _TO_MIDDLES @ scene.homography @ self._cells_to_board
        covered = np.where(where, np.uint8(255), np.uint8(0))
        return cv2.warpPerspective(covered, H, (PHOTO_PX, PHOTO_PX), flags=cv2.INTER_LINEAR)

    def _shadow(self, scene: _Scene, solids: Solids) -> np.ndarray:
        """Fraction of the light that the arm takes away, (n, n) uint8; drawn coarsely, for it is soft."""
        c = scene.conditions
        coarse = 5
        dark = np.zeros((PHOTO_PX // coarse,) * 2, np.uint8)
        lamp = np.array(c.lamp)
        fallen = cast(rims(solids, lamp), lamp, self._board.centre[2])
        for outline in on_plane(fallen, scene.homography) / coarse:
            fill(dark, outline, 255 * c.arm_depth)
        soft = cv2.GaussianBlur(dark, (0, 0), c.arm_soft / coarse)
        return cv2.resize(soft, (PHOTO_PX, PHOTO_PX), interpolation=cv2.INTER_LINEAR)

    def _stand_before(self, picture: np.ndarray, c: Conditions, solids: Solids) -> None:
        """Draw the arm, the furthest shape first, each lighter along its middle."""
        light = 255 * c.exposure * np.array(c.tint)
        round_ones = ~solids.is_box[:, None]
        layers = []
        for width, tone in _ROUNDNESS:
            slim = solids._replace(sizes=np.where(round_ones, [width, 1.0, 1.0], 1.0) * solids.sizes)
            layers.append((project(rims(slim, self._eye), self._projection) + c.shift, tone))
        for k in np.argsort(-np.linalg.norm(solids.centres - self._eye, axis=1)):
            for outlines, tone in layers[: 1 if solids.is_box[k] else None]:
                fill(picture, outlines[k], tuple(np.minimum(tone * light * self._colours[k], 255.0)))


def _darkened(picture: np.ndarray, cover: np.ndarray, reflectance) -> np.ndarray:
    """Cover a picture, (n, n, 3), with something that reflects these fractions of red, green and blue."""
    levels = np.arange(256)
    passed = [cv2.LUT(cover, np.round(255 - levels * (1 - fraction)).astype(np.uint8)) for fraction in reflectance]
    return cv2.multiply(picture, cv2.merge(passed), scale=1 / 255)


def _of_three(plane: np.ndarray) -> np.ndarray:
    return cv2.merge([plane, plane, plane])


def _smooth_noise(rng: np.random.Generator, waves: int) -> np.ndarray:
    """A random field of unit spread with this many bumps along an edge, (n, n) float32."""
    field = rng.standard_normal((waves, waves), dtype=np.float32)
    return cv2.resize(field, (PHOTO_PX, PHOTO_PX), interpolation=cv2.INTER_CUBIC)
