"""Draw the learning curves of runs of `contactsafe train` into one picture, and say when each had learned its task.

    python benchmarks/learning_curves.py runs/seed0 runs/seed1 runs/seed2 --out docs/learning.png

Runs whose folders differ in a number at the end alone, as here, are seeds of one setting and have one colour. Success
and force are means over the last hundred episodes of training: with exploration, on worlds that differ. Before every
environment has had the time of a whole episode only those that succeeded can have ended: that is left out.
"""

import argparse
import json
import re
from pathlib import Path

from matplotlib.figure import Figure
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

_WIDTH = 150
"""Characters that a line of the legend has room for."""

SUCCESS = 0.9
"""Of the last hundred episodes: the task counts as learned."""

Curve = dict[str, list[float]]


def curve(run: Path) -> Curve:
    """Read a run's log: steps, minutes, fraction of episodes that succeeded, largest force of an episode, N."""
    log = EventAccumulator(str(run))
    log.Reload()
    minutes, success, force, length = (
        {event.step: event.value for event in log.Scalars(name)}
        for name in ("time/minutes", "episode/success", "episode/force_peak_n", "episode/steps")
    )
    config = json.loads((run / "config.json").read_text(encoding="utf-8"))
    first = config["num_envs"] * max(length.values()) / config["action_repeat"]
    steps = sorted(step for step in success if step > first)
    return {
        "steps": steps,
        "minutes": [minutes[step] for step in steps],
        "success": [success[step] for step in steps],
        "force": [force[step] for step in steps],
    }


def setting(run: Path) -> str:
    """Return what a run shares its colour and its name in the picture by: its folder's name, but for the number."""
    return re.sub(r"[-_]?\d+$", "", run.name)


def row(name: str, curves: dict[Path, Curve]) -> str:
    """Write a line of Markdown's table for the seeds of a setting."""
    each = [_learned(run, c) for run, c in curves.items()]
    return f"| {name} | {' | '.join(', '.join(column) for column in zip(*each, strict=True))} |"


def _learned(run: Path, c: Curve) -> tuple[str, str, str]:
    """Say when a run had learned its task, how long it took, and what its policy does on held-out episodes."""
    reached = next((k for k, success in enumerate(c["success"]) if success >= SUCCESS), None)
    at = "never" if reached is None else f"{c['steps'][reached] / 1e3:.0f}k ({c['minutes'][reached]:.1f} min)"
    manifest = run / "bundle" / "bundle.json"
    results = json.loads(manifest.read_text(encoding="utf-8"))["results"] if manifest.exists() else {}
    return at, f"{c['minutes'][-1]:.1f} min", f"{100 * results['success']:.1f}" if results else "-"


def draw(curves: dict[Path, Curve], out: Path) -> None:
    """Draw success over minutes and over steps, and the largest force over steps."""
    figure = Figure(figsize=(10.5, 3.4), layout="constrained")
    by_minutes, by_steps, force = figure.subplots(1, 3)
    settings = list(dict.fromkeys(map(setting, curves)))
    for run, c in curves.items():
        look = {"color": f"C{settings.index(setting(run))}", "linewidth": 1.2}
        thousands = [steps / 1e3 for steps in c["steps"]]
        success = [100 * fraction for fraction in c["success"]]
        by_minutes.plot(c["minutes"], success, **look)
        by_steps.plot(thousands, success, **look)
        force.plot(thousands, c["force"], **look)
    for axes, unit in ((by_minutes, "minutes trained"), (by_steps, "thousand steps")):
        axes.axhline(100 * SUCCESS, color="0.6", linewidth=0.8, linestyle="--")
        axes.set(title="episodes that succeed, %", xlabel=unit, ylim=(0, 102))
    force.set(title="largest force of an episode, N", xlabel="thousand steps", ylim=(0, None))
    for axes in (by_minutes, by_steps, force):
        axes.grid(alpha=0.3)
        axes.set_xlim(0, None)
        axes.spines[["top", "right"]].set_visible(False)
    if len(settings) > 1:
        lines = [by_minutes.plot([], [], color=f"C{k}")[0] for k in range(len(settings))]
        columns = max(_WIDTH // max(map(len, settings)), 1)
        figure.legend(lines, settings, loc="outside lower center", ncols=columns, frameon=False)
    figure.savefig(out, dpi=100)


def main() -> None:
    """Draw and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("runs", nargs="+", type=Path, help="folders of runs, as --out of contactsafe train named them")
    parser.add_argument("--out", type=Path, default=Path("learning.png"), help="picture to write")
    arguments = parser.parse_args()
    names = [run.name for run in arguments.runs]
    if len(set(names)) < len(names):
        parser.error(f"two runs are called alike ({', '.join(names)}); name their folders apart")
    missing = [run for run in arguments.runs if not (run / "config.json").exists()]
    if missing:
        parser.error(f"{missing[0]} holds no run (config.json); give folders that `contactsafe train` wrote")
    curves = {run: curve(run) for run in arguments.runs}
    print(f"| runs | {SUCCESS:.0%} in training after, steps | whole run | held-out episodes, % |\n|---|---|---|---|")
    for name in dict.fromkeys(map(setting, curves)):
        print(row(name, {run: c for run, c in curves.items() if setting(run) == name}))
    draw(curves, arguments.out)


if __name__ == "__main__":
    main()
