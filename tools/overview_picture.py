"""Draw docs/overview.png, the picture at the head of README and documentation, from two of the experiments.

Above, the shipped policy wipes a board; below, the forearm meets a bottle under three controllers.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "examples"))

from drawing import BAND, COLOUR, INK, OBSTACLE, SOFT, draw_arm, panels  # noqa: E402

from contactsafe.experiments.config import ExperimentConfig  # noqa: E402
from contactsafe.experiments.joint_safety import joint_safety  # noqa: E402
from contactsafe.experiments.task_safety import task_safety  # noqa: E402
from contactsafe.policy.bundle import Bundle, shipped_bundle  # noqa: E402
from contactsafe.report.scene import View, fit  # noqa: E402
from contactsafe.results.recording import Recording, Stage  # noqa: E402
from contactsafe.tasks import task_by_name  # noqa: E402

COLUMNS = 4
STEADY = slice(-2000, None)  # ticks


def scene(axis: Axes, stage: Stage, view: View, recording: Recording, tick: int, colour: str) -> None:
    """Draw one moment: surface with what lies on it, obstacle, arm."""

    def project(points: np.ndarray) -> np.ndarray:
        return ((np.asarray(points) - view.target) @ view.axes().T)[..., :2]

    corners = np.array(stage.corners)
    axis.add_patch(Polygon(project(corners), facecolor="white", edgecolor=SOFT, linewidth=0.8))
    lying = recording.picture(tick)
    if lying is not None:
        rows, columns = np.nonzero(lying)
        x, y = ((found + 0.5) / lying.shape[k] for k, found in enumerate((rows, columns)))
        ink = corners[0] + x[:, None] * (corners[1] - corners[0]) + y[:, None] * (corners[3] - corners[0])
        axis.scatter(*project(ink).T, s=1.2, color="#183068", marker="s", linewidth=0)
    if recording.obstacle is not None:
        place, (radius, half) = recording.trace["obstacle_position"][tick, 0], recording.obstacle
        side = project(place + np.array([(0, 0, -half), (0, 0, half)]))
        outline = [side[0] - [radius, 0], side[1] - [radius, 0], side[1] + [radius, 0], side[0] + [radius, 0]]
        axis.add_patch(Polygon(outline, facecolor=OBSTACLE, edgecolor=INK, linewidth=0.8))
    draw_arm(axis, stage.arm, stage.tool, recording.trace["q"][tick], view, edge=colour)


def main() -> None:
    """Draw the picture."""
    task = task_by_name("wiping").scenes()
    bundle = Bundle.load(shipped_bundle("wiping"))
    wiping = task_safety(ExperimentConfig(("safe",), trials=4, task=task, bundle=bundle))
    meeting = joint_safety(ExperimentConfig(trials=4, task=task, bundle=bundle))
    (wiped,) = wiping.recordings
    collisions = [recording for recording in meeting.recordings if recording.scenario == "bottle"]
    figure, axes = panels(2, COLUMNS, (10.0, 5.4), width_ratios=(1, 1, 1, 1.3))

    view = fit(task.stage, [wiped])
    for axis, tick in zip(axes[0], (0, len(wiped.trace) // 2, len(wiped.trace) - 1), strict=False):
        scene(axis, task.stage, view, wiped, tick, SOFT)
        axis.set_title(f"{tick / 1000:.1f} s: {100 * wiped.curves['ink_left'][tick]:.0f} % left")
    axes[0, -1].plot(wiped.trace["time"], 100 * wiped.curves["ink_left"], color=INK)
    axes[0, -1].set(title="ink left (%)", xlabel="time (s)", xlim=(0, None), ylim=(0, 102))

    view = fit(task.stage, collisions)
    for axis, run in zip(axes[1], collisions, strict=False):
        scene(axis, task.stage, view, run, len(run.trace) - 1, COLOUR[run.controller])
        steady = float(run.trace["obstacle_force"][STEADY].mean())
        axis.set_title(f"{run.controller}: {steady:.3g} N", color=COLOUR[run.controller], fontweight="bold")
        axes[1, -1].plot(run.trace["time"], run.trace["obstacle_force"], color=COLOUR[run.controller], linewidth=0.9)
    axes[1, -1].axvspan(run.trace["time"][-1] - 2.0, run.trace["time"][-1], color=BAND)
    axes[1, -1].set(title="force on the bottle (N)", xlabel="time (s)", xlim=(0, None), ylim=(0, None))
    figure.savefig(ROOT / "docs" / "overview.png", metadata={"Software": None})


if __name__ == "__main__":
    main()
