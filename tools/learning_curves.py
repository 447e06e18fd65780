"""Draw the learning curves of runs of `contactsafe train` into one picture, and say when each cleared its boards.

    python tools/learning_curves.py runs/seed0 runs/seed1 runs/seed2 --out docs/learning.png

Share of boards and ink are means over the last hundred episodes of training: with exploration, on worlds that differ.
Before every world has had the time of a whole episode only those that were cleared can have ended: that is left out.
"""

import argparse
import json
from pathlib import Path

from matplotlib.figure import Figure
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

EPISODE_STEPS = 1200
SHARE = 0.9


def curve(run: Path) -> dict[str, list[float]]:
    """Read a run's log: minutes, steps, fraction of boards cleared, fraction of ink left."""
    first = EPISODE_STEPS * json.loads((run / "config.json").read_text(encoding="utf-8"))["num_envs"]
    log = EventAccumulator(str(run))
    log.Reload()
    minutes = {event.step: event.value for event in log.Scalars("time/minutes")}
    cleared = {event.step: event.value for event in log.Scalars("episode/success")}
    left = {event.step: 1.0 - event.value for event in log.Scalars("episode/ink_removed")}
    steps = sorted(step for step in cleared if step > first)
    return {
        "steps": steps,
        "minutes": [minutes[step] for step in steps],
        "cleared": [cleared[step] for step in steps],
        "left": [left[step] for step in steps],
    }


def row(run: Path, c: dict[str, list[float]]) -> str:
    """Write a run as a line of Markdown's table."""
    reached = next((k for k, share in enumerate(c["cleared"]) if share >= SHARE), None)
    at = "never" if reached is None else f"{c['minutes'][reached]:.1f} min, {c['steps'][reached]:,} steps"
    manifest = run / "bundle" / "bundle.json"
    results = json.loads(manifest.read_text(encoding="utf-8"))["results"] if manifest.exists() else {}
    boards = f"{results['cleared_99']:.0%} of {results['episodes']}" if results else "-"
    return f"| {run.name} | {at} | {c['minutes'][-1]:.1f} min, {c['steps'][-1]:,} steps | {boards} |"


def draw(curves: dict[str, dict[str, list[float]]], out: Path) -> None:
    """Draw the share of boards cleared over minutes and over steps, and the ink left over steps."""
    figure = Figure(figsize=(10.5, 3.4), layout="constrained")
    by_minutes, by_steps, ink = figure.subplots(1, 3)
    for name, c in curves.items():
        millions = [steps / 1e6 for steps in c["steps"]]
        cleared = [100 * share for share in c["cleared"]]
        by_minutes.plot(c["minutes"], cleared, label=name)
        by_steps.plot(millions, cleared)
        ink.plot(millions, [100 * share for share in c["left"]])
    for axes, unit in ((by_minutes, "minutes trained"), (by_steps, "million steps")):
        axes.axhline(100 * SHARE, color="0.6", linewidth=0.8, linestyle="--")
        axes.set(title="boards cleared, %", xlabel=unit, ylim=(0, 102), xlim=(0, None))
    ink.set(title="ink left, % (logarithmic)", xlabel="million steps", yscale="log", xlim=(0, None))
    by_minutes.legend(loc="lower right", frameon=False)
    for axes in (by_minutes, by_steps, ink):
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(out, dpi=100)


def main() -> None:
    """Draw and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path, help="folders of runs, as --out of contactsafe train named them")
    parser.add_argument("--out", type=Path, default=Path("learning.png"), help="picture to write")
    arguments = parser.parse_args()
    names = [run.name for run in arguments.runs]
    if len(set(names)) < len(names):
        parser.error(f"two runs are called alike ({', '.join(names)}); name their folders apart")
    missing = [run for run in arguments.runs if not (run / "config.json").exists()]
    if missing:
        parser.error(f"{missing[0]} holds no run (config.json); give folders that `contactsafe train` wrote")
    curves = {run.name: curve(run) for run in arguments.runs}
    print(f"| run | {SHARE:.0%} of the last hundred training boards | whole run | held-out boards, 99 % of ink gone |")
    print("|---|---|---|---|")
    for run, c in zip(arguments.runs, curves.values(), strict=True):
        print(row(run, c))
    draw(curves, arguments.out)


if __name__ == "__main__":
    main()
