"""`contactsafe demo` and `contactsafe experiment`."""

import datetime
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from contactsafe.cli.common import BundleFolder, Controllers, described, load_bundle, progress
from contactsafe.core.parse import one_of, some_of
from contactsafe.experiments import registry
from contactsafe.experiments.config import PLANTS, ExperimentConfig
from contactsafe.experiments.results import Experiment, to_json
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.manifest import MANIFEST, digest


def _usual_trials() -> str:
    by_number: dict[int, list[str]] = {}
    for name, entry in registry.ENTRIES.items():
        by_number.setdefault(entry.trials, []).append(name)
    return "; ".join(f"{number} for {', '.join(names)}" for number, names in by_number.items())


def demo(
    out: Path = Path("contactsafe-demo"),
    trials: int = 10,
    seed: int = 0,
    controllers: Controllers = ExperimentConfig.controllers,
    bundle: BundleFolder = None,
) -> None:
    """Run the paper's three experiments and write a page about them.

    Args:
        out: folder for report.html, summary.json and the trials as CSV.
        trials: seeds tried with each controller.
        seed: first seed.
        controllers: presets to compare.
        bundle: folder of another policy.
    """
    from contactsafe.report import prepare_output, terminal_table, write_report

    config = ExperimentConfig(controllers, trials, seed)
    loaded = load_bundle(bundle)
    folder = prepare_output(out)
    started = time.monotonic()
    results = _run(registry.PAPER, loaded, config)
    description = _description("contactsafe demo", config, loaded, time.monotonic() - started)
    page = write_report(folder, results, description)
    print(terminal_table(results))
    print(f"\nreport:  {page}\nsummary: {page.with_name('summary.json')}")


def experiment(
    name: Annotated[str, one_of(registry.ENTRIES), tyro.conf.Positional],
    controllers: Controllers = ExperimentConfig.controllers,
    trials: Annotated[int | None, tyro.conf.arg(help_behavior_hint=f"(default: {_usual_trials()})")] = None,
    seed: int = 0,
    plants: Annotated[tuple[str, ...], some_of(PLANTS)] = PLANTS,
    minutes: float = ExperimentConfig.minutes,
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none is written)")] = None,
    json: bool = False,
    bundle: BundleFolder = None,
) -> None:
    """Run one of the experiments.

      task-safety   the policy wipes boards never seen: how hard does it press?
      joint-safety  the forearm runs into an obstacle while the policy works.
      disturbance   somebody leans on the arm with 25 N.
      collisions    random motions meet random obstacles anywhere on the arm.
      detection     how soon is a contact reported, where, how often falsely?
      hostile       a policy asks for the impossible: are all limits kept?
      clock         ticks late, measurements lost, frozen or impossible, no policy.

    The first two need a policy. A trial depends on its own seed alone: `--seed 17 --trials 1 --out DIR` runs trial 17
    of any batch once more and draws it.

    Args:
        name: what to run.
        controllers: presets to compare.
        trials: seeds tried with each controller.
        seed: first seed.
        plants: collisions with an arm and sensors that have errors (real), without any (clean), or both side by side.
        minutes: simulated time in which detection counts false alarms.
        out: folder for report.html, summary.json and the trials as NAME.csv.
        json: print tables, spreads and trials as JSON instead of text.
        bundle: folder of another policy.
    """
    from contactsafe.report import prepare_output, terminal_table, write_report
    from contactsafe.report.summary import summarise

    entry = registry.by_name(name)
    config = ExperimentConfig(controllers, entry.trials if trials is None else trials, seed, plants, minutes)
    loaded = load_bundle(bundle) if bundle or entry.needs_policy else None
    folder = prepare_output(out) if out else None
    started = time.monotonic()
    results = _run([name], loaded, config)
    description = _description(f"contactsafe experiment {name}", config, loaded, time.monotonic() - started)
    page = write_report(folder, results, description) if folder else None
    print(to_json(summarise(results, description)) if json else terminal_table(results))
    if page:
        print(f"report: {page}", file=sys.stderr)


def _run(names: Sequence[str], bundle: Bundle | None, config: ExperimentConfig) -> list[Experiment]:
    entries = {name: registry.by_name(name) for name in names}
    results = []
    with progress(names[0], sum(entry.count(config) for entry in entries.values())) as bar:
        for name, entry in entries.items():
            bar.set_description_str(described(name))
            results.append(entry.run(bundle, config, bar.update))
    return results


def _description(command: str, config: ExperimentConfig, bundle: Bundle | None, seconds: float) -> dict:
    from contactsafe.experiments.disturbance import PUSH_S

    words = [command, f"--trials {config.trials} --seed {config.seed} --controllers {','.join(config.controllers)}"]
    if config.plants != ExperimentConfig.plants:
        words.append(f"--plants {','.join(config.plants)}")
    if config.minutes != ExperimentConfig.minutes:
        words.append(f"--minutes {config.minutes:g}")
    description = {
        "command": " ".join(words),
        "when": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "seeds": list(config.seeds),
        "push_s": PUSH_S,
        "seconds": round(seconds, 1),
    }
    if bundle is not None:
        description["bundle_sha256"] = digest((Path(bundle.folder) / MANIFEST).read_bytes())
    return description
