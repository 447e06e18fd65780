"""What may happen to a controller's clock, and what the arm is doing then."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactsafe.control import presets
from contactsafe.experiments.collision_motions import Motion, sample_motion
from contactsafe.experiments.collision_scenes import sample_meetings
from contactsafe.experiments.late_worlds import (
    FROZEN,
    LOST,
    NO_CALL,
    NUDGED,
    POSITION_JUMPS,
    SEEN,
    VELOCITY_JUMPS,
)
from contactsafe.experiments.motions import record
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.worlds import Worlds

SITUATIONS = ("moving", "at rest", "sliding", "in contact")
"""What the arm may be doing: in free air, on a surface, or pressed by an obstacle."""

_CONTACT_S = 0.3  # after the obstacle would be met

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


def sample_scene(arm: Arm, situation: str, seed: int) -> Scene:
    """Sample a scene of one of `SITUATIONS`; it depends on its seed alone."""
    fits = {
        "moving": lambda motion: not motion.holds and not motion.slides,
        "at rest": lambda motion: motion.holds and not motion.slides,
        "sliding": lambda motion: not motion.holds and motion.slides,
        "in contact": lambda motion: not motion.holds,
    }[situation]
    number = 1000 * seed
    while not fits(motion := sample_motion(arm, number)):
        number += 1
    at = round(1000 * motion.meets_s)
    if situation != "in contact":
        return Scene(motion, (), seed, at)
    worlds = Worlds(arm, motion.world((), REAL_SENSORS), presets.vices(), 1, [seed])
    free = record(worlds, [motion])[0]
    worlds.close()
    met = tuple(meeting.obstacle for meeting in sample_meetings(arm, motion, free["q"]))
    return Scene(motion, met, seed, at + round(1000 * _CONTACT_S))


def heading(case: Case, timed: bool, situation: str) -> str:
    """Return the scenario of a case: whether measurements carry their time, and what the arm is doing."""
    return f"{case.name}{', time given' if timed else ''}, {situation}"
