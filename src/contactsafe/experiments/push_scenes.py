"""Random pushes as people give them: where, how hard, from where, how suddenly, and what the arm does meanwhile."""

import math
from dataclasses import dataclass

import numpy as np

from contactsafe.experiments.collision_motions import Motion, sample_motion, scene_rng
from contactsafe.experiments.onsets import pushed_links
from contactsafe.experiments.surfaces import is_uncovered, sample_place
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.ik import solve_ik
from contactsafe.robot.shape import link_frames

FORCE_N, RAMP_S = (8.0, 30.0), (0.02, 1.0)
"""Force, uniform, and time from nothing to all of it, log-uniform."""

HELD_S, AFTER_S = 1.5, 2.0
"""How long the full force lasts, and how long the arm is watched after its release."""

_MOVING, _ALONG_NORMAL, _SIDEWAYS = 0.35, 0.4, 0.2
"""Fraction of scenes in which the tool moves, and of pushes along the normal and across it; the others are oblique."""

_CONE_RAD = math.radians(60.0)


@dataclass(frozen=True)
class PushedMotion(Motion):
    """A motion or a hold in free air, and a push on the arm amid it.

    Attributes:
        link: that is pushed, 3 … n.
        point: on its surface, in its frame, (3,), m.
        force: world axes, (3,), N.
        ramp_s: time from nothing to full force, s.
        angle_rad: between force and inward normal, 0 … π/2, in the posture that the motion has at the onset.
    """

    link: int
    point: np.ndarray
    force: np.ndarray
    ramp_s: float
    angle_rad: float

    @property
    def release_s(self) -> float:
        """When the force is gone, s; it begins at `meets_s`."""
        return self.meets_s + self.ramp_s + HELD_S

    @property
    def duration_s(self) -> float:
        """How long the trial lasts, s."""
        return self.release_s + AFTER_S


def sample_pushed_motion(arm: Arm, seed: int) -> PushedMotion:
    """Sample what the tool does and how the arm is pushed; it depends on arm and seed alone.

    Args:
        arm: built from a description.
        seed: of the scene.

    Raises:
        UnreachableError: the arm reaches no motion.
    """
    rng = scene_rng(seed, 4)
    motion = sample_motion(arm, seed, slides=False, holds=bool(rng.random() >= _MOVING))
    force_n, ramp_s = rng.uniform(*FORCE_N), math.exp(rng.uniform(*np.log(RAMP_S)))
    angle = sample_angle(rng)
    link, point, inwards = sample_touchable_point(arm, posture_at(arm, motion, motion.meets_s), rng)
    return PushedMotion(
        **{name: getattr(motion, name) for name in Motion.__dataclass_fields__},
        link=link,
        point=point,
        force=force_n * inclined(inwards, angle, rng),
        ramp_s=ramp_s,
        angle_rad=angle,
    )


def sample_angle(rng: np.random.Generator) -> float:
    """Sample the angle between a push and the inward normal: along it, across it, or within a cone, rad."""
    kind = rng.random()
    if kind < _ALONG_NORMAL:
        return 0.0
    if kind < _ALONG_NORMAL + _SIDEWAYS:
        return 0.5 * math.pi
    return math.acos(rng.uniform(math.cos(_CONE_RAD), 1.0))


def inclined(inwards: np.ndarray, angle: float, rng: np.random.Generator) -> np.ndarray:
    """Return a random unit vector at an angle to another, (3,)."""
    across = rng.standard_normal(3)
    across -= (across @ inwards) * inwards
    across /= np.linalg.norm(across)
    return math.cos(angle) * inwards + math.sin(angle) * across


def sample_touchable_point(
    arm: Arm, q: np.ndarray, rng: np.random.Generator, links: tuple[int, ...] = ()
) -> tuple[int, np.ndarray, np.ndarray]:
    """Sample a point of the arm that nothing of the arm covers.

    Args:
        arm: built from a description.
        q: its joint positions, (n,), rad.
        rng: of the sample.
        links: of which the point is; none for `pushed_links`.

    Returns:
        Link, point in its frame, (3,), m, and inward normal, world, (3,).
    """
    origins, rotations = link_frames(description_and_tool(arm)[0], q[None])
    while True:
        at = sample_place(arm, origins[0], rotations[0], links or pushed_links(arm), rng)
        if is_uncovered(arm, q, at.world, at.inwards):
            return at.link, at.point, at.inwards


def posture_at(arm: Arm, motion: Motion, time_s: float) -> np.ndarray:
    """Return the joint positions that follow a motion without error, (n,), rad."""
    q, nominal = motion.q_start, arm.nominal()
    for time in np.linspace(0.0, time_s, 6)[1:]:
        seed, q = q, np.empty(arm.n)
        solve_ik(nominal.handle, motion.target(time), motion.start.quat, seed, arm.q_min, arm.q_max, q)
    return q
