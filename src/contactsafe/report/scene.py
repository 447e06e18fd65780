"""The simulated scene as a picture: a camera at infinity, so that capsules stay capsules and a surface stays affine."""

import base64
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.results.recording import Colour, Recording, Stage
from contactsafe.robot.shape import arm_capsules, tip_corners

_AZIMUTH, _ELEVATION = math.radians(22.0), math.radians(22.0)


@dataclass(frozen=True)
class View:
    """Where it is seen from.

    Attributes:
        target: world point in the middle of the picture, m.
        span: width and height that the picture must show, m.
        azimuth: of the camera about z, rad; 0 looks at the robot from the front.
        elevation: of the camera above the table, rad.
    """

    target: tuple[float, float, float]
    span: tuple[float, float]
    azimuth: float = _AZIMUTH
    elevation: float = _ELEVATION

    def axes(self) -> np.ndarray:
        """Return the rows right, up, towards the camera; world, (3, 3)."""
        ca, sa, ce, se = (f(x) for x in (self.azimuth, self.elevation) for f in (math.cos, math.sin))
        return np.array([(-sa, ca, 0.0), (-se * ca, -se * sa, ce), (ce * ca, ce * sa, se)])

    def scale(self, width: float, height: float) -> float:
        """Return pixels a metre in a picture of that size."""
        return min(width / self.span[0], height / self.span[1])

    def project(self, points: Sequence | np.ndarray, width: float, height: float) -> np.ndarray:
        """Return pixel x, pixel y (down) and nearness, m, of world points (…, 3)."""
        relative = (np.asarray(points) - self.target) @ self.axes().T
        scale = self.scale(width, height)
        relative[..., 0] = width / 2 + scale * relative[..., 0]
        relative[..., 1] = height / 2 - scale * relative[..., 1]
        return relative


def fit(stage: Stage, recordings: list[Recording]) -> View:
    """Choose the view in which the arm of all recordings, the surface and the obstacle are seen."""
    spheres = [(np.array(stage.corners), 0.0)]  # everything seen lies within these: centres (…, 3), m, and radius, m
    for recording in recordings:
        q = recording.trace["q"][:: max(1, len(recording.trace) // 60)]
        starts, ends, radii, _ = arm_capsules(stage.arm, stage.tool, q)
        for k, radius in enumerate(radii):
            spheres += [(starts[:, k], radius), (ends[:, k], radius)]
        if recording.obstacle is not None:
            spheres.append((recording.trace["obstacle_position"][:, 0], max(recording.obstacle)))
    axes = View((0.0, 0.0, 0.0), (1.0, 1.0)).axes()
    low = np.min([(centres @ axes.T).min(axis=0) - radius for centres, radius in spheres], axis=0)
    high = np.max([(centres @ axes.T).max(axis=0) + radius for centres, radius in spheres], axis=0)
    target = axes.T @ ((low + high) / 2)
    width, height = 1.04 * (high - low)[:2]
    return View((float(target[0]), float(target[1]), float(target[2])), (float(width), float(height)))


def picture(stage: Stage, view: View, recording: Recording, tick: int, width: int, height: int) -> str:
    """Return one moment as SVG without its outer element; colours come from the page's style.

    Args:
        stage: arm, tool and surface.
        view: of `fit`.
        recording: what happened.
        tick: index into its trace.
        width, height: of the picture, px.
    """
    scale = view.scale(width, height)
    corners = view.project(stage.corners, width, height)
    parts = [f'<polygon class="surface" points="{_points(corners)}"/>']
    lying = recording.picture(tick)
    if lying is not None:
        parts.append(_image(lying, stage.colours, corners))
    q = recording.trace["q"][tick : tick + 1]
    starts, ends, radii, _ = arm_capsules(stage.arm, stage.tool, q)
    floor = np.full(len(radii), stage.corners[0][2])
    flat = [np.stack([x[0, :, 0], x[0, :, 1], floor], axis=1) for x in (starts, ends)]
    shadow = [view.project(x, width, height) for x in flat]
    parts.append(
        '<g class="shadow">'
        + "".join(_line(a, b, 2 * scale * r) for a, b, r in zip(*shadow, radii, strict=True))
        + "</g>"
    )
    projected = [view.project(x[0], width, height) for x in (starts, ends)]
    things = [((a[2] + b[2]) / 2, _capsule(a, b, scale * r)) for a, b, r in zip(*projected, radii, strict=True)]
    if stage.tool.tip is not None:
        tip = view.project(tip_corners(stage.arm, stage.tool, q)[0], width, height)
        things.append((tip[..., 2].mean(), _tip(tip)))
    if recording.obstacle is not None:
        places = recording.trace["obstacle_position"][:, 0]
        rest, now = view.project(places[0], width, height), view.project(places[tick], width, height)
        things.append((rest[2] - 1e-3, _obstacle(rest, recording.obstacle, scale, view, "rest")))
        things.append((now[2], _obstacle(now, recording.obstacle, scale, view, "obstacle")))
    parts += [svg for _, svg in sorted(things, key=lambda thing: thing[0])]
    return "".join(parts)


def _image(cells: np.ndarray, colours: Mapping[int, Colour], corners: np.ndarray) -> str:
    """Return what lies on the surface as an image, mapped onto it: columns along y, rows along x."""
    from matplotlib.image import imsave  # the heavy part of this room, wanted only where something is drawn

    rgba = np.zeros((*cells.shape, 4), dtype=np.uint8)
    for value, rgb in colours.items():
        rgba[cells == value] = (*rgb, 255)
    buffer = io.BytesIO()
    imsave(buffer, rgba, format="png")
    rows, columns = cells.shape
    right, down = (corners[3] - corners[0])[:2] / columns, (corners[1] - corners[0])[:2] / rows
    matrix = " ".join(f"{x:.5g}" for x in (*right, *down, *corners[0, :2]))
    data = base64.b64encode(buffer.getvalue()).decode()
    return (
        f'<image width="{columns}" height="{rows}" preserveAspectRatio="none" transform="matrix({matrix})" '
        f'href="data:image/png;base64,{data}"/>'
    )


def _points(points: np.ndarray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points[:, :2])


def _line(a: np.ndarray, b: np.ndarray, width: float, extra: str = "") -> str:
    # A line of no length has no round ends in some viewers.
    ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0] + 0.01:.2f}" y2="{b[1]:.1f}"'
    return f'<line {ends} stroke-width="{width:.1f}"{extra}/>'


def _capsule(a: np.ndarray, b: np.ndarray, radius: float) -> str:
    up = np.array([0.0, -0.28 * radius, 0.0])
    return (
        _line(a, b, 2 * radius + 1.2, ' class="edge"')
        + _line(a, b, 2 * radius, ' class="arm"')
        + _line(a + up, b + up, radius, ' class="shine"')
    )


def visible_faces(tip: np.ndarray) -> list[np.ndarray]:
    """Return the faces of a tool's tip that are seen; where it is round all its sides together are one.

    Args:
        tip: corners as `contactsafe.robot.tip_corners` orders them, in a picture: x right, y up, (2, K, 2 or more).

    Returns:
        Outlines, (P, 2) each.
    """
    front, back = tip[0, :, :2], tip[1, :, :2]
    after = np.roll(np.arange(len(front)), -1)
    sides = [np.array([back[k], back[j], front[j], front[k]]) for k, j in enumerate(after)]
    ends = [face for face in (front, back[::-1]) if _area(face) > 0.0]
    seen = np.array([_area(side) > 0.0 for side in sides])
    if len(front) == 4 or seen.all() or not seen.any():
        return [*(side for side, is_seen in zip(sides, seen, strict=True) if is_seen), *ends]
    first = int(np.flatnonzero(seen & ~np.roll(seen, 1))[0])
    run = (first + np.arange(seen.sum() + 1)) % len(front)
    return [np.concatenate([back[run], front[run[::-1]]]), *ends]


def _area(outline: np.ndarray) -> float:
    """Return twice the area within an outline, positive where it runs counter-clockwise."""
    x, y = outline.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _tip(tip: np.ndarray) -> str:
    upwards = np.array([1.0, -1.0])
    faces = visible_faces(tip[..., :2] * upwards)
    return "".join(f'<polygon class="block" points="{_points(face * upwards)}"/>' for face in faces)


def _obstacle(centre: np.ndarray, shape: tuple[float, float], scale: float, view: View, name: str) -> str:
    """Return a sphere, or a standing cylinder of exact outline: between two ellipses."""
    r, half = scale * shape[0], scale * shape[1] * math.cos(view.elevation)
    x, y = centre[:2]
    if half == 0:
        return f'<circle class="{name}" cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}"/>'
    flat = r * math.sin(view.elevation)
    side = (
        f"M{x - r:.1f} {y - half:.1f}V{y + half:.1f}A{r:.1f} {flat:.1f} 0 0 0 {x + r:.1f} {y + half:.1f}V{y - half:.1f}"
    )
    lid = f'<ellipse class="{name}" cx="{x:.1f}" cy="{y - half:.1f}" rx="{r:.1f}" ry="{flat:.1f}"/>'
    return f'<path class="{name}" d="{side}"/>{lid}'
