"""Detection: how soon is a contact reported, is its link isolated correctly, and how often is it false?"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments import false_alarms
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.false_alarms import FREE, SLIDING, false_alarm_trials, sample_strokes
from contactsafe.experiments.onsets import CONTACT, NAMED_AFTER_MS, STEP, push_trials, pushed_links
from contactsafe.results.experiment import Experiment, Table, Trial
from contactsafe.results.metrics import ZERO, Aim, Metric
from contactsafe.robot.arm import Arm

NAME = "detection"
QUESTION = (
    "A random point of links 3 to 7 is pushed while the arm moves, its plant and sensors with errors: how soon is a "
    "step of 3 N m reported, is the link of 10 to 60 N isolated correctly, and is a contact ever reported where there "
    "is none?"
)
METRICS = (
    Metric("within_15_ms", "reported within 15 ms, mean", "%", 100.0, main=True, aim=Aim(at_least=95.0), mean=True),
    Metric("within_30_ms", "reported within 30 ms, mean", "%", 100.0, main=True, aim=Aim(at_least=99.0), mean=True),
    Metric("detect_ms", "onset to report", "ms", main=True),
    Metric("link_right", "link isolated correctly, mean", "%", 100.0, main=True, aim=Aim(at_least=95.0), mean=True),
    Metric("own_torque_nm", "true torque on the link's own joint", "N m"),
    Metric("force_n", "force of the push", "N"),
    Metric("reported_early", "a contact reported before the push, mean", "%", 100.0, main=True, mean=True),
    Metric("false_alarms", "false alarms in a run", main=True, aim=ZERO),
    Metric("false_contact_s", "time in contact mode without a contact", "s"),
)

_BATCH = 50


def detection(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy. Controllers that are blind to contact are left out.

    Args:
        config: controllers, arm, seeds and minutes.
        progress: told of every trial done.

    Raises:
        InvalidInputError: no controller reports contacts.
    """
    arm, seeds = config.arm, config.seeds
    trials: list[Trial] = []
    for name, controller in reporting(config.controllers).items():
        for first in range(0, len(seeds), _BATCH):
            for scenario in (STEP, CONTACT):
                trials += push_trials(
                    arm, name, controller, seeds[first : first + _BATCH], scenario, config.real_sensors
                )
                if progress:
                    progress(len(seeds[first : first + _BATCH]))
        strokes = sample_strokes(arm, config.seed, _stroke_worlds(config.minutes))
        for first in range(0, len(strokes), _BATCH):
            trials += false_alarm_trials(arm, name, controller, strokes[first : first + _BATCH], config.real_sensors)
            if progress:
                progress(len(strokes[first : first + _BATCH]))
    return Experiment(NAME, "Detection", QUESTION, tuple(trials), METRICS, tables=detection_tables(arm, trials))


def reporting(names: Sequence[str]) -> dict[str, ControllerConfig]:
    """Return the controllers that report contacts, by name.

    Raises:
        InvalidInputError: there is none among them.
    """
    known = {name: presets.by_name(name) for name in names}
    found = {name: controller for name, controller in known.items() if controller.reaction.contact_aware}
    if not found:
        raise InvalidInputError(f"none of {', '.join(names)} reports contacts; choose paper or safe")
    return found


def count(config: ExperimentConfig) -> int:
    """Count the trials of all controllers."""
    return len(reporting(config.controllers)) * (2 * config.trials + _stroke_worlds(config.minutes))


ENTRY = Entry(
    NAME,
    "how soon is a contact reported, where, how often falsely?",
    detection,
    count=count,
    trials=100,
    takes=("sensors", "minutes"),
)


def _stroke_worlds(minutes: float) -> int:
    return math.ceil(60.0 * minutes / false_alarms.STROKES_S)


def detection_tables(arm: Arm, trials: Sequence[Trial]) -> tuple[Table, ...]:
    """Sum the false alarms up, and show for each controller which links were named."""
    by_name: dict[str, list[Trial]] = {}
    for trial in trials:
        by_name.setdefault(trial.controller, []).append(trial)
    return (_alarm_table(by_name), *(_confusion(arm, name, of_name) for name, of_name in by_name.items()))


def _alarm_table(by_name: Mapping[str, list[Trial]]) -> Table:
    rows = []
    for name, trials in by_name.items():
        watched = [trial.metrics for trial in trials if trial.scenario in (FREE, SLIDING)]
        minutes, entries, lasted_s, touched = (
            sum(metrics[figure] for metrics in watched)
            for figure in ("minutes", "false_alarms", "false_contact_s", "touched")
        )
        an_hour = 60.0 * entries / minutes if minutes else math.nan
        rows.append((name, minutes, int(entries), an_hour, lasted_s, int(touched)))
    columns = (
        "controller",
        "minutes watched",
        "false alarms",
        "an hour",
        "they last (s)",
        "runs touched",
    )
    note = (
        "A false alarm is an entry into contact mode while nothing touches the arm, the surface under the tool apart. "
        "A run in which something did, such as the table, is watched until then."
    )
    return Table(
        "false_alarms", "False alarms while the tool moves freely and on a surface", columns, tuple(rows), note
    )


def _confusion(arm: Arm, name: str, trials: Sequence[Trial]) -> Table:
    kept = [t.metrics for t in trials if t.scenario == CONTACT and not t.metrics["reported_early"]]
    rows = []
    for link in pushed_links(arm):
        here = [metrics for metrics in kept if metrics["link"] == link]
        named = [int(metrics["link_named"]) for metrics in here]
        right = 100.0 * named.count(link) / len(here) if here else math.nan
        own = float(np.median([metrics["own_torque_nm"] for metrics in here])) if here else math.nan
        rows.append((link, len(here), *(named.count(other) for other in range(arm.n + 1)), right, own))
    named_links = (f"{link} named" for link in range(1, arm.n + 1))
    columns = ("link", "contacts", "none named", *named_links, "right (%)", "own (N m)")
    early = sum(t.scenario == CONTACT and t.metrics["reported_early"] > 0 for t in trials)
    note = (
        f"Links isolated {NAMED_AFTER_MS} ms after the onset of 10 to 60 N. Own: median of the true torque on the "
        f"joint that moves the link; a push near its axis shows none. Left out, reported before: {early}."
    )
    return Table(f"links_{name}", f"Links isolated by {name}", columns, tuple(rows), note)
