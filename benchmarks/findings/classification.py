"""Obstacle or push, and what rejecting the one as the other takes."""

import math
from collections.abc import Sequence

import numpy as np
from benchmarks.findings.models import ARM, FAST, FAST_BOUNDED, SAFE, VICES
from benchmarks.findings.printing import say
from benchmarks.findings.scenes import PUSH_N, Scenes, hold, strays_mm

import contactsafe as cs
from contactsafe.control.codes import FREE, REJECT
from contactsafe.experiments.franka_links import PUSH_POINTS
from contactsafe.experiments.motions import Playback
from contactsafe.experiments.surfaces import clearance
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds


def push_or_obstacle() -> None:
    """The bare sign of the work is wrong where an arm moves; with its errors, and what yielding brings, it is not."""
    scenes = Scenes(48)
    real = [motion.world(met, REAL_SENSORS) for motion, met in zip(scenes.motions, scenes.obstacles, strict=True)]
    found: dict[str, list[list[int]]] = {}
    for config in (FAST, SAFE):
        for kind, traces in (("a sweep into an obstacle", scenes.run(config, real)), ("", _pushed(scenes, config))):
            for motion, trace in zip(scenes.motions, traces, strict=True):
                if not (kind and motion.holds):
                    name = kind or ("a push on a held arm" if motion.holds else "a push on a moving arm")
                    found.setdefault(name, []).append([config is SAFE, *_verdicts(trace)])
    for name, rows in found.items():
        fast, safe = (np.array([row[1:] for row in rows if row[0] == which]).sum(axis=0) for which in (False, True))
        by_work = f"{fast[1]} of {fast[0]} (no bound), {safe[1]} of {safe[0]} (safe)"
        say(f"{name:24s} taken for a push by its work: {by_work}; by the controller: {safe[2]} of {safe[0]}")


def _pushed(scenes: Scenes, config: cs.ControllerConfig = SAFE) -> list[np.ndarray]:
    """Push each arm with 25 N for 1.5 s instead, on link 4, 5 or 6, from the side."""
    n = len(scenes.motions)
    worlds = Worlds(ARM, [motion.world((), REAL_SENSORS) for motion in scenes.motions], config, n, scenes.seeds)
    play, steps = Playback(worlds, scenes.motions), np.zeros((n, MAX_TICKS), dtype=trace_dtype(ARM.n))
    for i, motion in enumerate(scenes.motions):
        link, angle = 4 + i % 3, 2.4 * i
        force = PUSH_N * np.array([math.cos(angle), math.sin(angle), 0.0])
        worlds.push(i, f"link{link}", PUSH_POINTS[link], force, motion.meets_s, motion.meets_s + 1.5)
    pieces = []
    while play.ticks < 2600:
        ticks = play.step(steps)
        pieces.append(steps[:, :ticks].copy())
    worlds.close()
    return list(np.concatenate(pieces, axis=1))


def _verdicts(trace: np.ndarray) -> tuple[bool, bool, bool]:
    """Tell whether a contact was found, whether its work in the next 50 ms says push, and the controller in 0.5 s."""
    found = (trace["mode"] != FREE) & (np.abs(trace["tau_arm"]).max(axis=1) > 0.3)
    first = int(np.argmax(found))
    work = np.einsum("ti,ti->t", trace["residual_fast"][:-1], np.diff(trace["q"], axis=0))
    pushes = bool(work[first : first + 50].sum() > 0), bool(trace["mode"][first : first + 500][-1] == REJECT)
    return (True, *pushes) if found.any() else (False, False, False)


def stiff_obstacle_that_stays() -> None:
    """Where the null space does not yield, rejecting a stiff obstacle that stays means pressing hard."""
    laws = {"vices": VICES, "no bound": FAST, "3 N m always": FAST_BOUNDED, "safe": SAFE}
    obstacles = {"front": _driven_into_the_forearm((-1.0, 0.0, 0.0)), "side": _driven_into_the_forearm((0.0, 1.0, 0.0))}
    for name, config in laws.items():
        found = []
        for side, obstacle in obstacles.items():
            trace = hold(config, 3.0, obstacles=(obstacle,))
            force, away = trace["obstacle_force"][0], strays_mm(trace)[0]
            found.append(
                f"from the {side}: tool {away:2.0f} mm, {force.max():3.0f} N, {force[-500:].mean():3.0f} N at last"
            )
        say(f"{name:13s} {'; '.join(found)}")


def _driven_into_the_forearm(direction: Sequence[float]) -> Obstacle:
    """Return a sphere of 20 kN/m that comes along a direction, 15 mm into where the forearm is, and stays."""
    origins, rotations = link_frames(description_and_tool(ARM)[0], ARM.home[None])
    place = origins[0, 5] + rotations[0, 5] @ np.array(PUSH_POINTS[5])
    radius, gap, side = 0.04, 0.005, np.array(direction)
    while clearance(ARM, ARM.home[None], place) < radius + gap:
        place = place - 0.0005 * side
    (x, y, z), (tx, ty, tz) = place.tolist(), ((gap + 0.015) * side).tolist()
    return Obstacle((x, y, z), radius, 20e3, travel=(tx, ty, tz), travel_s=(0.2, 0.5))
