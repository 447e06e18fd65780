"""What the pictures of the examples have in common: colours, type, arms as capsules, and where they are saved."""

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from contactsafe.report import COLOURS, View, visible_faces
from contactsafe.robot import ArmDescription, Tool, arm_capsules, tip_corners

COLOUR = {name: on_light for name, (on_light, _) in COLOURS.items()}
"""Of the controllers, as in the report."""

INK, SOFT, ARM, BLOCK, OBSTACLE, BAND = "#1c2126", "#5a646e", "#dfe4e9", "#3f5f8f", "#e3a13c", "#eef1f4"

_STYLE = {
    "font.size": 10, "axes.spines.top": False,
    "axes.spines.right": False, "axes.edgecolor": SOFT, "text.color": INK, "axes.labelcolor": INK, "axes.grid": True,
    "axes.axisbelow": True, "axes.grid.axis": "y", "grid.color": "#e3e7eb", "xtick.color": SOFT, "ytick.color": SOFT,
}  # fmt: skip


def panels(rows: int = 1, columns: int = 1, size: tuple[float, float] = (8.0, 3.6), **shared):
    """Return a figure and its axes: one, a row, or (rows, columns).

    Args:
        rows, columns: of panels.
        size: inches.
        shared: `sharex`, `sharey`, `width_ratios` ... as for `Figure.subplots`.
    """
    with rc_context(_STYLE):
        figure = Figure(size, layout="constrained", dpi=100)
        return figure, figure.subplots(rows, columns, **shared)


def save(figure: Figure, example: str, folder: Path | str) -> Path:
    """Save a figure as FOLDER/EXAMPLE.png and return its path.

    Args:
        figure: drawn.
        example: its `__file__`.
        folder: where to.
    """
    path = Path(folder) / f"{Path(example).stem}.png"
    figure.savefig(path, metadata={"Software": None})
    return path


def draw_arm(axis: Axes, arm: ArmDescription, tool: Tool, q: np.ndarray, view: View, edge=SOFT, opacity=1.0) -> None:
    """Draw an arm's capsules and its tip, the farthest first.

    Args:
        axis: in metres, of `view`.
        arm, tool: what is drawn.
        q: joint positions, (n,), rad.
        view: where from.
        edge: colour of the outlines.
        opacity: 0 to 1.
    """
    starts, ends, radii, _ = arm_capsules(arm, tool, q[None])
    starts, ends = ((x[0] - view.target) @ view.axes().T for x in (starts, ends))
    middles = (starts[:, 2] + ends[:, 2]) / 2
    parts = [(middles[k], _stadium(starts[k, :2], ends[k, :2], radii[k]), ARM) for k in range(len(radii))]
    if tool.tip is not None:
        tip = (tip_corners(arm, tool, q[None])[0] - view.target) @ view.axes().T
        parts += [(tip[..., 2].mean() + 1e-6 * k, face, BLOCK) for k, face in enumerate(visible_faces(tip))]
    for _, outline, colour in sorted(parts, key=lambda part: part[0]):
        axis.add_patch(Polygon(outline, facecolor=colour, edgecolor=edge, linewidth=0.9, alpha=opacity))
    width, height = view.span
    axis.set(aspect="equal", xlim=(-width / 2, width / 2), ylim=(-height / 2, height / 2))
    axis.set_axis_off()


def _stadium(start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Return the outline of a capsule seen from the side, (40, 2)."""
    along = np.arctan2(*(end - start)[::-1])
    half = np.linspace(np.pi / 2, 3 * np.pi / 2, 20) + along
    round_start = start + radius * np.stack([np.cos(half), np.sin(half)], axis=1)
    round_end = end - radius * np.stack([np.cos(half), np.sin(half)], axis=1)
    return np.concatenate([round_start, round_end])
