"""Clocks: measurements late, lost, frozen, repeated or impossible, another rate, a late policy: what then?"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.control import presets
from contactsafe.control.codes import FREE
from contactsafe.control.config import ControllerConfig
from contactsafe.control.controller import Controller
from contactsafe.experiments.collision_scenes import Motion, sample_meetings, sample_motion, scene_rng
from contactsafe.experiments.collisions import CONTACT_N
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.late_worlds import (
    FROZEN,
    LOST,
    NO_CALL,
    NUDGED,
    POSITION_JUMPS,
    SEEN,
    VELOCITY_JUMPS,
    LatePlayback,
    LateWorlds,
)
from contactsafe.experiments.motions import record
from contactsafe.experiments.results import Experiment, Table, Trial
from contactsafe.experiments.run import Progress
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import Obstacle
from contactsafe.sim.world import MAX_TICKS, Worlds

QUESTION = (
    "Ticks come late, measurements are lost, frozen, repeated or impossible, the rate is another, the policy falls "
    "silent: is a contact reported that is none, does the torque jump, does the tool stray, and is it said?"
)
SITUATIONS = ("moving", "holding", "wiping", "in contact")
AFTER_S = 1.2
"""How long a trial goes on after its disturbance began, s."""

_CONTACT_S = 0.3  # after the obstacle would be met
_BACK_TICKS = 500  # after the reset that ends a trial

Codes = Callable[[int, int, np.random.Generator], np.ndarray]
"""From the ticks of a trial, the one at which something happens, and random numbers: what happens at each, (ticks,)."""


@dataclass(frozen=True)
class Case:
    """One thing that may happen to a clock.

    Attributes:
        name: for readers.
        codes: what happens when; see `LateWorlds`.
        stops: whether it is more than may be bridged, so that the arm has to be braked.
        silent_s: how long the policy says nothing, s.
    """

    name: str
    codes: Codes
    stops: bool = False
    silent_s: float = 0.0


def _burst(code: int, length: int) -> Codes:
    """One disturbance of so many ticks."""

    def codes(ticks: int, at: int, rng: np.random.Generator) -> np.ndarray:
        out = np.full(ticks, SEEN)
        out[at : at + length] = code
        return out

    return codes


def _every(code: int, period: int, length: int) -> Codes:
    """The same again and again: of every `period` ticks so many."""
    return lambda ticks, at, rng: np.where(np.arange(ticks) % period >= period - length, code, SEEN)


def _jitter(ticks: int, at: int, rng: np.random.Generator) -> np.ndarray:
    """One to four ticks between two calls, at random."""
    return np.where(rng.random(ticks) < 0.4, NO_CALL, SEEN)


CASES = (
    Case("one encoder step off, once", _burst(NUDGED, 1)),
    *(Case(f"tick {n} ms late", _burst(NO_CALL, n)) for n in (2, 5, 10, 20)),
    Case("jitter: four ticks in ten missed", _jitter),
    Case("loop at 500 Hz", _every(NO_CALL, 2, 1)),
    Case("loop at 250 Hz", _every(NO_CALL, 4, 3)),
    *(Case(f"{n} measurement{'s' if n > 1 else ''} lost", _burst(LOST, n)) for n in (1, 5, 20)),
    Case("10 of every 40 measurements lost", _every(LOST, 40, 10)),
    *(Case(f"frozen for {n} ms", _burst(FROZEN, n)) for n in (5, 20)),
    Case("every measurement twice", _every(FROZEN, 2, 1)),
    Case("velocity 0.2 rad/s off, once", _burst(VELOCITY_JUMPS, 1)),
    Case("position 0.05 rad off, once", _burst(POSITION_JUMPS, 1)),
    Case("tick 40 ms late", _burst(NO_CALL, 40), stops=True),
    Case("measurements lost for 1 s", _burst(LOST, 1000), stops=True),
    Case("frozen for 300 ms", _burst(FROZEN, 300), stops=True),
    Case("position 0.05 rad off, 100 ms", _burst(POSITION_JUMPS, 100), stops=True),
    Case("policy silent for 500 ms", _burst(SEEN, 0), silent_s=0.5),
)


def clock(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy.

    Args:
        bundle: not used.
        config: controllers and seeds.
        progress: told of every trial done.
    """
    arm = robots.panda()
    scenes = {situation: [draw_scene(arm, situation, seed) for seed in config.seeds] for situation in SITUATIONS}
    trials: list[Trial] = []
    for name in config.controllers:
        controller = presets.by_name(name)
        for situation, of_situation in scenes.items():
            calm, _ = _run(arm, controller, of_situation, None, False)
            for case, timed in itertools.product(CASES, (False, True)):
                traces, endings = _run(arm, controller, of_situation, case, timed)
                for scene, trace, still, ending in zip(of_situation, traces, calm, endings, strict=True):
                    metrics = clock_metrics(trace, still, scene, case) | ending.metrics()
                    trials.append(Trial(_heading(case, timed, situation), name, scene.seed, metrics))
                if progress:
                    progress(len(endings))
    return Experiment("clock", QUESTION, tuple(trials), (), tuple(_tables(trials, config.controllers)))


def count(config: ExperimentConfig) -> int:
    """Count the trials of a configuration."""
    return config.trials * len(config.controllers) * len(SITUATIONS) * len(CASES) * 2


@dataclass(frozen=True)
class Scene:
    """What the arm is doing when something happens to its clock.

    Attributes:
        motion: of the tool.
        obstacles: what it meets.
        seed: of the sensors' noise.
        at: tick at which it happens.
    """

    motion: Motion
    obstacles: tuple[Obstacle, ...]
    seed: int
    at: int


def draw_scene(arm: Arm, situation: str, seed: int) -> Scene:
    """Draw a scene of one of `SITUATIONS`; it depends on its seed alone."""
    fits = {
        "moving": lambda motion: not motion.holds and not motion.wiping,
        "holding": lambda motion: motion.holds and not motion.wiping,
        "wiping": lambda motion: not motion.holds and motion.wiping,
        "in contact": lambda motion: not motion.holds,
    }[situation]
    number = 1000 * seed
    while not fits(motion := sample_motion(arm, number)):
        number += 1
    at = round(1000 * motion.meets_s)
    if situation != "in contact":
        return Scene(motion, (), seed, at)
    worlds = Worlds(arm, motion.world((), True), presets.vices(), 1, [seed])
    free = record(worlds, [motion])[0]
    worlds.close()
    met = tuple(meeting.obstacle for meeting in sample_meetings(arm, motion, free["q"]))
    return Scene(motion, met, seed, at + round(1000 * _CONTACT_S))


@dataclass(frozen=True)
class _Ending:
    """How a trial was left: fault, largest joint speed in rad/s, and largest torque step in N m while it was reset."""

    fault: int
    joint_speed: float
    step_back: float

    def metrics(self) -> dict[str, float]:
        return {
            "fault": float(self.fault),
            "joint_speed_left_rad_s": self.joint_speed,
            "torque_step_back_nm": self.step_back,
        }


def _run(
    arm: Arm, controller: ControllerConfig, scenes: Sequence[Scene], case: Case | None, timed: bool
) -> tuple[np.ndarray, list[_Ending]]:
    """Run scenes side by side, nothing disturbed without a case, and reset their controllers in the end.

    Returns:
        `trace_dtype` records, (n, ticks), and how each was left.
    """
    ticks = max(scene.at for scene in scenes) + round(1000 * AFTER_S)
    codes = np.full((len(scenes), ticks + MAX_TICKS + _BACK_TICKS), SEEN)
    if case is not None:
        for row, scene in zip(codes, scenes, strict=True):
            row[:ticks] = case.codes(ticks, scene.at, scene_rng(scene.seed, 3))
    silent = [(scene.at, scene.at + round(1000 * case.silent_s) if case else 0) for scene in scenes]
    configs = [scene.motion.world(scene.obstacles, True) for scene in scenes]
    worlds = LateWorlds(arm, configs, controller, [scene.seed for scene in scenes], codes, timed)
    trace = LatePlayback(worlds, [scene.motion for scene in scenes], ticks, silent).record()
    faults = worlds.controllers["state"]["fault"].tolist()
    speeds = [float(np.abs(data.qvel[: arm.n]).max()) for data in worlds.datas]
    steps = _reset(worlds, controller)
    worlds.close()
    return trace, [_Ending(*found) for found in zip(faults, speeds, steps, strict=True)]


def _reset(worlds: LateWorlds, controller: ControllerConfig) -> list[float]:
    """Reset all controllers where their arms are; give the largest torque step of each from then on, N m."""
    torques = [worlds.controllers["output"]["torque"].copy()]
    arm = worlds.arm
    owners = [Controller(arm, controller, worlds.controllers, i) for i in range(worlds.n)]
    for owner, data, sent in zip(owners, worlds.datas, torques[0], strict=True):
        owner.reset(np.clip(data.qpos[: arm.n], arm.q_min, arm.q_max), data.qvel[: arm.n], sent)
    for _ in range(_BACK_TICKS):
        worlds.run(1)
        torques.append(worlds.controllers["output"]["torque"].copy())
    return np.abs(np.diff(torques, axis=0)).max(axis=(0, 2)).tolist()


def clock_metrics(trace: np.ndarray, calm: np.ndarray, scene: Scene, case: Case) -> dict[str, float]:
    """Compare a trial with the same one undisturbed.

    Args:
        trace, calm: `trace_dtype` records, (T,).
        scene: what the arm was doing.
        case: what happened; whatever strays that is braked or not led any more, its deviation does not exist (NaN).
    """
    away = np.linalg.norm(trace["position"] - calm["position"], axis=1)
    after = trace["position"][scene.at :]
    led = not case.stops and case.silent_s == 0.0
    touched = bool(scene.obstacles)
    return {
        "false_contact_ms": np.nan
        if touched
        else float(np.count_nonzero((trace["mode"] != FREE) & (calm["mode"] == FREE))),
        "torque_step_nm": float(np.abs(np.diff(trace["torque"], axis=0)).max()),
        "tool_away_mm": float(1000.0 * away.max()) if led else np.nan,
        "tool_travel_mm": np.nan if led else float(1000.0 * np.linalg.norm(after - after[0], axis=1).max()),
        "contact_peak_n": float(trace["obstacle_force"][scene.at :].max()) if touched else np.nan,
        "contact_peak_calm_n": float(calm["obstacle_force"][scene.at :].max()) if touched else np.nan,
        "touching": float(calm["obstacle_force"][scene.at] > CONTACT_N) if touched else np.nan,
    }


def _tables(trials: Sequence[Trial], controllers: Sequence[str]) -> list[Table]:
    """Gather the worst of all seeds, one table of what is bridged and one of what is not, for each controller."""
    tables = []
    for name in controllers:
        of_controller: dict[str, list[dict[str, float]]] = {}
        for trial in trials:
            if trial.controller == name:
                of_controller.setdefault(trial.scenario, []).append(trial.metrics)
        for stops, columns, metric, title in (
            (False, _AWAY, "tool_away_mm", "bridged"), (True, _TRAVEL, "tool_travel_mm", "braked"),
        ):  # fmt: skip
            rows = tuple(
                _row(of_controller, case, timed, metric, stops)
                for case in CASES if (case.stops or case.silent_s > 0.0) == stops
                for timed in (False, True)
            )  # fmt: skip
            tables.append(Table(f"{title}_{name}", f"{name}: what is {title}, the worst of all seeds", columns, rows))
    return tables


_AWAY = (
    "what happens", "time", "false contact, ms", "torque step, N m", "tool away, mm: moving", "holding", "wiping",
    "in contact", "contact force, N", "undisturbed, N",
)  # fmt: skip
_TRAVEL = (
    "what happens", "time", "false contact, ms", "torque step, N m", "tool travels, mm: moving", "holding", "wiping",
    "in contact", "joint speed left, rad/s", "fault", "step when reset, N m",
)  # fmt: skip


def _row(of_controller, case: Case, timed: bool, metric: str, stops: bool) -> tuple[str | float, ...]:
    rows = {situation: of_controller[_heading(case, timed, situation)] for situation in SITUATIONS}
    everything = [row for found in rows.values() for row in found]

    def worst(name: str, found=None) -> float:
        values = [row[name] for row in (everything if found is None else found) if np.isfinite(row[name])]
        return max(values, default=np.nan)

    first = (case.name, "given" if timed else "-", worst("false_contact_ms"), worst("torque_step_nm"))
    middle = tuple(worst(metric, rows[situation]) for situation in SITUATIONS)
    if not stops:
        return (*first, *middle, worst("contact_peak_n"), worst("contact_peak_calm_n"))
    faults = ", ".join(str(fault) for fault in sorted({int(row["fault"]) for row in everything}))
    return (*first, *middle, worst("joint_speed_left_rad_s"), faults, worst("torque_step_back_nm"))


def _heading(case: Case, timed: bool, situation: str) -> str:
    return f"{case.name}{', time given' if timed else ''}, {situation}"
