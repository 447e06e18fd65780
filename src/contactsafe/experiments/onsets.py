"""Pushes on random points of a moving arm: how soon is one reported, and which link is named?"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.control.config import ControllerConfig
from contactsafe.experiments.collision_motions import sample_motion, scene_rng
from contactsafe.experiments.motions import Playback
from contactsafe.experiments.surfaces import is_uncovered, sample_place
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.results.experiment import Trial
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import REAL_SENSORS, SensorConfig
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

STEP, CONTACT = "step of 3 N m", "contact of 10 to 60 N"
STEP_NM = 3.0
"""Largest joint torque of a step."""

FORCE_N = (10.0, 60.0)
NAMED_AFTER_MS = 30
"""When the reported link is looked at, since the onset."""

_LEVER_M = 0.03  # least joint torque of a newton for a step: 3 N m take at most 100 N
_AFTER_STEPS = 4  # policy steps recorded from the onset on: 66 or 67 ms


def pushed_links(arm: Arm) -> range:
    """Return the links that are pushed: all from the third on, where a push moves the joints of the base well."""
    return range(3, arm.n + 1)


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
    """Sample a push on a point of the arm that nothing of the arm covers.

    A step has the force that makes its largest joint torque `STEP_NM`; points that would take more than 100 N for it
    are sampled anew. A contact has any point, and a force of `FORCE_N`, log-uniform.

    Args:
        arm: built from a description.
        q: its joint positions, (n,), rad.
        rng: of the sample.
        scenario: `STEP` or `CONTACT`.
        sensors: of the arm.
    """
    origins, rotations = link_frames(description_and_tool(arm)[0], q[None])
    while True:
        at = sample_place(arm, origins[0], rotations[0], pushed_links(arm), rng)
        size = math.exp(rng.uniform(*np.log(FORCE_N)))
        if not is_uncovered(arm, q, at.world, at.inwards):
            continue
        torque = point_torque(origins[0], rotations[0], at.link, at.world, at.inwards)
        if scenario == STEP:
            lever = float(np.abs(torque).max())
            if lever < _LEVER_M:
                continue
            size = STEP_NM / lever
        return Push(at.link, at.point, size * at.inwards, size * torque)


def point_torque(
    origins: np.ndarray, rotations: np.ndarray, link: int, place: np.ndarray, force: np.ndarray
) -> np.ndarray:
    """Return the joint torque of a force on a point of a link, Jᵀ f, (n,), N m.

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


def push_trials(
    arm: Arm,
    name: str,
    controller: ControllerConfig,
    seeds: Sequence[int],
    scenario: str,
    sensors: SensorConfig = REAL_SENSORS,
) -> list[Trial]:
    """Push the arm once in each scene, while it moves, and see when and where a contact is reported.

    Args:
        arm: built from a description.
        name: of the controller.
        controller: that reports contacts.
        seeds: of the scenes.
        scenario: `STEP` or `CONTACT`.
        sensors: of the arm.
    """
    motions = [sample_motion(arm, seed) for seed in seeds]
    rngs = [scene_rng(seed, 2 if scenario == STEP else 3) for seed in seeds]
    onsets = [round(POLICY_RATE_HZ * rng.uniform(0.3, m.meets_s)) for rng, m in zip(rngs, motions, strict=True)]
    worlds = Worlds(arm, [motion.world((), sensors) for motion in motions], controller, len(motions), seeds)
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
    """Return how soon a step was reported; NaN where a contact was reported before it.

    Args:
        trace: `trace_dtype` records from the onset on, (T,).
        push: what was done.
    """
    reported = trace["mode"] != FREE
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
    """Return which link was named `NAMED_AFTER_MS` after the onset; arguments as for `step_metrics`."""
    named = int(trace["link"][NAMED_AFTER_MS])
    early = bool(trace["mode"][0] != FREE)
    return {
        "link": float(push.link),
        "force_n": float(np.linalg.norm(push.force)),
        "reported_early": float(early),
        "link_named": math.nan if early else float(named),
        "link_right": math.nan if early else float(named == push.link),
        "own_torque_nm": float(abs(push.torque[push.link - 1])),
    }
