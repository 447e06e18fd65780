"""Detection: how soon is a contact reported, is its link named rightly, and how often is one reported that is none?"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.control import codes, presets
from contactsafe.control.config import ControllerConfig
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.collision_scenes import (
    Motion,
    clearance,
    description_and_tool,
    sample_motion,
    sample_surface_point,
    scene_rng,
)
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.motions import Playback
from contactsafe.experiments.results import Experiment, Table, Trial
from contactsafe.experiments.run import Progress
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.robot.shape import link_frames
from contactsafe.sim.records import trace_dtype
from contactsafe.sim.world import MAX_TICKS, POLICY_RATE_HZ, Worlds

QUESTION = (
    "A random point of links 3 to 7 is pushed while the arm moves, its plant and sensors with errors: how soon is a "
    "step of 3 N m reported, is the link of 10 to 60 N named rightly, and is a contact ever reported where there is "
    "none?"
)
STEP, CONTACT, FREE, WIPING = "step of 3 N m", "contact of 10 to 60 N", "free motion", "wiping strokes"
STEP_NM = 3.0
"""Largest joint torque of a step."""

FORCE_N = (10.0, 60.0)
LINKS = (3, 4, 5, 6, 7)
NAMED_AFTER_MS = 30
"""When the reported link is looked at, since the onset."""

STROKES_S = 20.0
"""How long one world moves to and fro for false alarms, s."""

_BATCH = 50
_LEVER_M = 0.03  # least joint torque of a newton for a step: 3 N m take at most 100 N
_AFTER_STEPS = 4  # policy steps recorded from the onset on: 66 or 67 ms
_TOUCHED_NM = 0.5  # true torque on the arm that makes an alarm no false one


def detection(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy. Controllers that are blind to contact are left out.

    Args:
        bundle: not used.
        config: controllers, seeds and minutes.
        progress: told of every trial done.

    Raises:
        InvalidInputError: no controller reports contacts.
    """
    arm, seeds = robots.panda(), config.seeds
    trials: list[Trial] = []
    for name, controller in reporting(config.controllers).items():
        for first in range(0, len(seeds), _BATCH):
            for scenario in (STEP, CONTACT):
                trials += push_trials(arm, name, controller, seeds[first : first + _BATCH], scenario)
                if progress:
                    progress(len(seeds[first : first + _BATCH]))
        strokes = paint_strokes(arm, config.seed, _stroke_worlds(config.minutes))
        for first in range(0, len(strokes), _BATCH):
            trials += alarm_trials(arm, name, controller, strokes[first : first + _BATCH])
            if progress:
                progress(len(strokes[first : first + _BATCH]))
    return Experiment("detection", QUESTION, tuple(trials), (), detection_tables(trials))


def reporting(names: Sequence[str]) -> dict[str, ControllerConfig]:
    """Give the controllers that report contacts, by name.

    Raises:
        InvalidInputError: there is none among them.
    """
    found = {name: presets.by_name(name) for name in names}
    found = {name: controller for name, controller in found.items() if controller.reaction.contact_aware}
    if not found:
        raise InvalidInputError(f"none of {', '.join(names)} reports contacts; choose paper or safe")
    return found


def count(config: ExperimentConfig) -> int:
    """Count the trials of all controllers."""
    return len(reporting(config.controllers)) * (2 * config.trials + _stroke_worlds(config.minutes))


def _stroke_worlds(minutes: float) -> int:
    return math.ceil(60.0 * minutes / STROKES_S)


# Pushes ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Push:
    """A push on the arm's surface, inwards along its normal.

    Attributes:
        link: that is pushed.
        point: in the link's frame, (3,), m.
        force: world axes, (3,), N.
        torque: on the joints at the onset, (n,), N m.
    """

    link: int
    point: np.ndarray
    force: np.ndarray
    torque: np.ndarray


def sample_push(arm: Arm, q: np.ndarray, rng: np.random.Generator, scenario: str) -> Push:
    """Draw a push on a point of the arm that nothing of the arm covers.

    A step has the force that makes its largest joint torque `STEP_NM`; points that would take more than 100 N for it
    are drawn anew. A contact has any point, and a force of `FORCE_N`, log-uniform.

    Args:
        arm: built from a description.
        q: its joint positions, (n,), rad.
        rng: of the draw.
        scenario: `STEP` or `CONTACT`.
    """
    origins, rotations = link_frames(description_and_tool(arm)[0], q[None])
    while True:
        link = int(rng.choice(LINKS))
        point, normal = sample_surface_point(arm, link, rng)
        size = math.exp(rng.uniform(*np.log(FORCE_N)))
        place, inwards = origins[0, link] + rotations[0, link] @ point, -rotations[0, link] @ normal
        if clearance(arm, q[None], place - 1e-3 * inwards) < 0.5e-3:
            continue
        torque = point_torque(origins[0], rotations[0], link, place, inwards)
        if scenario == STEP:
            lever = float(np.abs(torque).max())
            if lever < _LEVER_M:
                continue
            size = STEP_NM / lever
        return Push(link, point, size * inwards, size * torque)


def point_torque(origins: np.ndarray, rotations: np.ndarray, link: int, place: np.ndarray, force: np.ndarray):
    """Give the joint torque of a force on a point of a link, Jᵀ f, (n,), N m.

    Args:
        origins, rotations: frames of `link_frames` in one posture, (n + 2, 3) m and (n + 2, 3, 3).
        link: 1 … n.
        place: of the point, world, (3,), m.
        force: world axes, (3,), N.
    """
    axes, levers = rotations[1:-1, :, 2], place - origins[1:-1]
    torque = np.einsum("ik,ik->i", axes, np.cross(levers, force))
    torque[link:] = 0.0
    return torque


def push_trials(arm: Arm, name: str, controller: ControllerConfig, seeds: Sequence[int], scenario: str) -> list[Trial]:
    """Push the arm once in each scene, while it moves, and see when and where a contact is reported.

    Args:
        arm: built from a description.
        name: of the controller.
        controller: that reports contacts.
        seeds: of the scenes.
        scenario: `STEP` or `CONTACT`.
    """
    motions = [sample_motion(arm, seed) for seed in seeds]
    rngs = [scene_rng(seed, 2 if scenario == STEP else 3) for seed in seeds]
    onsets = [round(POLICY_RATE_HZ * rng.uniform(0.3, m.meets_s)) for rng, m in zip(rngs, motions, strict=True)]
    worlds = Worlds(arm, [motion.world((), real=True) for motion in motions], controller, len(motions), seeds)
    play, steps = Playback(worlds, motions), np.zeros((len(motions), MAX_TICKS), dtype=trace_dtype(arm.n))
    pushes: dict[int, Push] = {}
    pieces: list[list[np.ndarray]] = [[] for _ in motions]
    for step in range(max(onsets) + _AFTER_STEPS):
        for i in (i for i, onset in enumerate(onsets) if onset == step):
            pushes[i] = push = sample_push(arm, worlds.datas[i].qpos[: arm.n], rngs[i], scenario)
            now = play.ticks / 1000.0
            worlds.push(i, f"link{push.link}", push.point, push.force, now, now + 1.0, ramp_s=0.001)
        ticks = play.step(steps)
        for i, onset in enumerate(onsets):
            if onset <= step < onset + _AFTER_STEPS:
                pieces[i].append(steps[i, :ticks].copy())
    worlds.close()
    measure = step_metrics if scenario == STEP else contact_metrics
    return [Trial(scenario, name, seed, measure(np.concatenate(pieces[i]), pushes[i])) for i, seed in enumerate(seeds)]


def step_metrics(trace: np.ndarray, push: Push) -> dict[str, float]:
    """Tell how soon a step was reported; NaN where a contact was reported before it.

    Args:
        trace: `trace_dtype` records from the onset on, (T,).
        push: what was done.
    """
    reported = trace["mode"] != codes.FREE
    after_ms = float(np.argmax(reported)) if reported.any() else math.nan
    early = bool(reported[0])
    return {
        "link": float(push.link),
        "force_n": float(np.linalg.norm(push.force)),
        "reported_early": float(early),
        "detect_ms": math.nan if early else after_ms,
        "within_15_ms": math.nan if early else float(after_ms <= 15),
        "within_30_ms": math.nan if early else float(after_ms <= 30),
    }


def contact_metrics(trace: np.ndarray, push: Push) -> dict[str, float]:
    """Tell which link was named `NAMED_AFTER_MS` after the onset; arguments as for `step_metrics`."""
    named = int(trace["link"][NAMED_AFTER_MS])
    early = bool(trace["mode"][0] != codes.FREE)
    return {
        "link": float(push.link),
        "force_n": float(np.linalg.norm(push.force)),
        "reported_early": float(early),
        "link_named": math.nan if early else float(named),
        "link_right": math.nan if early else float(named == push.link),
        "own_torque_nm": float(abs(push.torque[push.link - 1])),
    }


# False alarms ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Strokes(Motion):
    """To and fro on the way of a motion, smoothly, its speed the largest; for `STROKES_S`."""

    @property
    def duration_s(self) -> float:
        """How long it lasts, s."""
        return STROKES_S

    def target(self, time_s: float) -> np.ndarray:
        """Give where on its way x_d is, (3,), m."""
        phase = 2.0 * self.speed_m_s / self.length_m * max(time_s - 0.2, 0.0)
        return self.start.position + 0.5 * (1.0 - math.cos(phase)) * self.way


def paint_strokes(arm: Arm, seed: int, n: int) -> list[Strokes]:
    """Give the strokes of the first n scenes from a seed on that do not hold."""
    found: list[Strokes] = []
    while len(found) < n:
        motion = sample_motion(arm, seed)
        if not motion.holds:
            found.append(Strokes(**{name: getattr(motion, name) for name in Motion.__dataclass_fields__}))
        seed += 1
    return found


def alarm_trials(arm: Arm, name: str, controller: ControllerConfig, strokes: Sequence[Strokes]) -> list[Trial]:
    """Count entries into contact mode where nothing touches the arm.

    A world is watched until its end, or until the arm truly bears more than 0.5 N m, such as from the table.
    """
    n, seeds = len(strokes), [stroke.seed for stroke in strokes]
    worlds = Worlds(arm, [stroke.world((), real=True) for stroke in strokes], controller, n, seeds)
    play, steps = Playback(worlds, strokes), np.zeros((n, MAX_TICKS), dtype=trace_dtype(arm.n))
    before, untouched = np.zeros((n, 1), int), np.ones(n, bool)
    alarms, yielding, watched = np.zeros(n), np.zeros(n), np.zeros(n)
    while play.running.any():
        ticks = play.step(steps)
        now = steps[:, :ticks]
        untouched &= np.abs(now["tau_arm"]).max(axis=(1, 2)) <= _TOUCHED_NM
        contact = np.concatenate([before, now["mode"] != codes.FREE], axis=1)
        alarms += untouched * np.count_nonzero(np.diff(contact) > 0, axis=1)
        yielding += untouched * contact[:, 1:].sum(axis=1)
        watched += untouched * ticks
        before = contact[:, -1:]
    worlds.close()
    return [
        Trial(
            WIPING if stroke.wiping else FREE,
            name,
            stroke.seed,
            {
                "false_alarms": float(alarms[i]),
                "false_contact_s": float(yielding[i]) / 1000.0,
                "minutes": float(watched[i]) / 60000.0,
                "touched": float(not untouched[i]),
            },
        )
        for i, stroke in enumerate(strokes)
    ]


# Tables ---------------------------------------------------------------------------------------------------------------


def detection_tables(trials: Sequence[Trial]) -> tuple[Table, ...]:
    """Sum the false alarms up, and show for each controller which links were named."""
    by_name: dict[str, list[Trial]] = {}
    for trial in trials:
        by_name.setdefault(trial.controller, []).append(trial)
    return (_alarm_table(by_name), *(_confusion(name, of_name) for name, of_name in by_name.items()))


def _alarm_table(by_name: Mapping[str, list[Trial]]) -> Table:
    rows = []
    for name, trials in by_name.items():
        watched = [trial.metrics for trial in trials if trial.scenario in (FREE, WIPING)]
        minutes, alarms, lasted_s, touched = (
            sum(metrics[figure] for metrics in watched)
            for figure in ("minutes", "false_alarms", "false_contact_s", "touched")
        )
        an_hour = 60.0 * alarms / minutes if minutes else math.nan
        rows.append((name, minutes, int(alarms), an_hour, lasted_s, int(touched)))
    columns = (
        "controller",
        "minutes watched",
        "false alarms",
        "an hour",
        "they last (s)",
        "runs touched",
    )
    note = (
        "A false alarm is an entry into contact mode while nothing touches the arm, the board at the pad apart. A run "
        "in which something did, such as the table, is watched until then."
    )
    return Table("false_alarms", "False alarms while the arm moves freely and wipes", columns, tuple(rows), note)


def _confusion(name: str, trials: Sequence[Trial]) -> Table:
    kept = [t.metrics for t in trials if t.scenario == CONTACT and not t.metrics["reported_early"]]
    rows = []
    for link in LINKS:
        here = [metrics for metrics in kept if metrics["link"] == link]
        named = [int(metrics["link_named"]) for metrics in here]
        right = 100.0 * named.count(link) / len(here) if here else math.nan
        own = float(np.median([metrics["own_torque_nm"] for metrics in here])) if here else math.nan
        rows.append((link, len(here), *(named.count(other) for other in range(8)), right, own))
    columns = ("link", "contacts", "none named", *(f"{link} named" for link in range(1, 8)), "right (%)", "own (N m)")
    early = sum(t.scenario == CONTACT and t.metrics["reported_early"] > 0 for t in trials)
    note = (
        f"Links as named {NAMED_AFTER_MS} ms after the onset of 10 to 60 N. Own: median of the true torque on the "
        f"joint that moves the link; a push near its axis shows none. Left out, reported before: {early}."
    )
    return Table(f"links_{name}", f"Links named by {name}", columns, tuple(rows), note)
