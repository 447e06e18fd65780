"""Playing motions in simulated worlds: x_d follows its path, moved once a policy step."""

import math
from collections.abc import Sequence

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.experiments.collision_motions import TARGET_OFFSET_MAX_M, Motion
from contactsafe.policy.rate import ticks_of_step
from contactsafe.robot.ik import solve_ik
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds


class Playback(Independent):
    """Motions played side by side, one in each world, from their beginning.

    Args:
        worlds: to play them in; reset.
        motions: one for each.

    Attributes:
        ticks: played so far.
        lengths: of the motions, ticks, (n,).
    """

    _bound = ("_target", "_tool")

    def __init__(self, worlds: Worlds, motions: Sequence[Motion]):
        self.worlds, self.motions, self.ticks = worlds, motions, 0
        self.lengths = np.array([round(1000 * motion.duration_s) for motion in motions])
        self._step, self._nominal = 0, worlds.arm.nominal()
        self._bind()
        for i, motion in enumerate(motions):
            worlds.reset(i, motion.q_start, motion.stiffness)
            self._target["quat"][i] = motion.start.quat

    def _bind(self) -> None:
        controllers = self.worlds.controllers
        self._target, self._tool = controllers["target"], controllers["output"]["position"]

    @property
    def running(self) -> np.ndarray:
        """Whether each motion is not over yet, (n,)."""
        return self.ticks < self.lengths

    def step(self, trace: np.ndarray | None = None) -> int:
        """Play one policy step, or a single tick of what is over.

        Args:
            trace: `trace_dtype` records to fill, (n, MAX_TICKS).

        Returns:
            Its ticks.
        """
        running, ticks = self.running, ticks_of_step(self._step)
        for i in np.flatnonzero(running).tolist():
            self._aim(i, self.ticks / 1000.0)
        self.worlds.run(np.where(running, ticks, 1), trace)
        self._step, self.ticks = self._step + 1, self.ticks + ticks
        return ticks

    def _aim(self, i: int, time_s: float) -> None:
        """Set x_d where the motion has it, within its offset, and the posture that goes with it."""
        motion, arm, tool, q_posture = self.motions[i], self.worlds.arm, self._tool[i], self._target["q_posture"][i]
        position = motion.target(time_s)
        if motion.limited:
            away = position - tool
            distance = math.sqrt(away @ away)
            if distance > TARGET_OFFSET_MAX_M:
                position = tool + away * (TARGET_OFFSET_MAX_M / distance)
        self._target["position"][i] = position
        q = np.empty(arm.n)
        error, turn = solve_ik(self._nominal.handle, position, motion.start.quat, q_posture, arm.q_min, arm.q_max, q)
        if error < 1e-3 and turn < 1e-2:
            q_posture[:] = q


def record(worlds: Worlds, motions: Sequence[Motion]) -> list[np.ndarray]:
    """Play motions from their beginning to their end; see `record_rest`."""
    return record_rest(Playback(worlds, motions))


def record_rest(play: Playback) -> list[np.ndarray]:
    """Play motions on to their end, from where they are.

    Returns:
        One array of `trace_dtype` records for each, one a ms.
    """
    begun, worlds = play.ticks, play.worlds
    step = np.zeros((worlds.n, MAX_TICKS), dtype=trace_dtype(worlds.arm.n))
    traces = np.zeros((worlds.n, int(play.lengths.max()) - begun + MAX_TICKS), dtype=step.dtype)
    while play.running.any():
        start = play.ticks - begun
        ticks = play.step(step)
        traces[:, start : start + ticks] = step[:, :ticks]
    return [trace[: length - begun] for trace, length in zip(traces, play.lengths, strict=True)]
