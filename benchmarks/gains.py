"""Is variable impedance worth its twelve dimensions, and a bound in the controller worth anything to learning?

    python benchmarks/gains.py --task insertion --out runs/gains [--seeds 3] [--episodes 200] [options of train ppo]

Trains the same task with the gains set by the policy, and kept low, in the middle and high; and with the gains set by
the policy over `safe` and over `vices`, with and without a reward that asks for gentle contacts. Each with the same
steps and seeds, one training after the other; those that are done already are not done again, and one that was stopped
goes on. Then each policy, and each scripted one, meets the same held-out episodes, and a table is printed. How fast
each learns is what `benchmarks/learning_curves.py` says of the same folders.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from contactsafe.tasks import TASKS, task_by_name

VARIANTS = {
    "learned gains": (),
    "constant gains, low": ("--gains", "low"),
    "constant gains, middle": ("--gains", "middle"),
    "constant gains, high": ("--gains", "high"),
    "learned gains over vices": ("--controller", "vices"),
    "learned gains, no reward for gentleness": ("--gentleness", "0"),
    "learned gains over vices, no reward for gentleness": ("--controller", "vices", "--gentleness", "0"),
}
"""Each with the options of `contactsafe train ppo` that make it; the controller is `safe` where none is named."""


def contactsafe(*words: str) -> str:
    """Run a command; return what it printed."""
    done = subprocess.run([sys.executable, "-m", "contactsafe", *words], stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def train(task: str, out: Path, words: tuple[str, ...], seed: int, more: list[str]) -> None:
    """Train one policy, or go on with it; one that is done has no steps left and is written again as it was."""
    resume = ("--resume",) if (out / "checkpoint.pt").exists() else ()
    common = ("--task", task, "--seed", str(seed), "--out", str(out), "--evaluate-episodes", "0")
    contactsafe("train", "ppo", *common, *words, *more, *resume)


def evaluate(task: str, bundle: Path, episodes: int) -> dict:
    """Evaluate a policy, once: what was found is kept beside it, under the digest of its bundle."""
    digest = hashlib.sha256((bundle / "bundle.json").read_bytes()).hexdigest()[:12]
    kept = bundle.parent / f"evaluation-{episodes}-{digest}.json"
    if not kept.exists():
        printed = contactsafe("evaluate", str(bundle), "--task", task, "--episodes", str(episodes), "--json")
        kept.write_text(printed, encoding="utf-8")
    return json.loads(kept.read_text(encoding="utf-8"))


def row(name: str, found: list[dict]) -> str:
    """Write a line of the table: the median of the seeds, and the least and largest of them."""

    def spread(key: str, scale: float = 1.0) -> str:
        values = [np.nan if one[key] is None else scale * one[key] for one in found]
        middle = f"{np.median(values):.3g}"
        return middle if len(values) == 1 else f"{middle} ({min(values):.3g} to {max(values):.3g})"

    figures = [spread("success", 100.0), spread("time_to_success_median_s"), spread("contact_force_median_n")]
    figures += [spread("peak_force_median_n"), f"{max(one['peak_force_max_n'] for one in found):.0f}"]
    return f"| {name} | {' | '.join(figures)} |"


def main() -> None:
    """Train, evaluate and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--task", choices=tuple(TASKS), default="insertion")
    parser.add_argument("--out", type=Path, default=Path("runs/gains"))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--only", nargs="*", choices=tuple(VARIANTS), default=tuple(VARIANTS))
    options, more = parser.parse_known_args()
    runs = {
        (name, seed): options.out / options.task / f"{name.replace(', ', '-').replace(' ', '-')}-{seed}"
        for name in options.only
        for seed in range(options.seeds)
    }
    for (name, seed), out in runs.items():
        train(options.task, out, VARIANTS[name], seed, more)
    head = "success, % | time to it, s | force in contact, N | largest force, median, N | largest of all, N"
    print(f"| {options.task} | {head} |\n|---|---|---|---|---|---|")
    for name in options.only:
        outs = [runs[name, seed] for seed in range(options.seeds)]
        found = [evaluate(options.task, out / "bundle", options.episodes) for out in outs]
        print(row(name, found))
    for name in task_by_name(options.task).scripted:
        words = ("--task", options.task, "--scripted", name, "--episodes", str(options.episodes), "--json")
        print(row(f"script: {name}", [json.loads(contactsafe("evaluate", *words))]))


if __name__ == "__main__":
    main()
