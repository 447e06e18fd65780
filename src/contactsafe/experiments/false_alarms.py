"""Contacts reported where there is none, while the tool moves to and fro."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.control import codes
from contactsafe.control.config import ControllerConfig
from contactsafe.experiments.collision_motions import Motion, sample_motion
from contactsafe.experiments.motions import Playback
from contactsafe.results.experiment import Trial
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import REAL_SENSORS, SensorConfig
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

FREE, SLIDING = "free motion", "strokes on a surface"
STROKES_S = 20.0
"""How long one world moves to and fro, s."""

_TOUCHED_NM = 0.5  # true torque on the arm that makes a reported contact no false one


@dataclass(frozen=True)
class Strokes(Motion):
    """To and fro on the path of a motion, smoothly, its speed the largest; for `STROKES_S`."""

    @property
    def duration_s(self) -> float:
        """How long it lasts, s."""
        return STROKES_S

    def target(self, time_s: float) -> np.ndarray:
        """Return where on its path x_d is, (3,), m."""
        phase = 2.0 * self.speed_m_s / self.length_m * max(time_s - 0.2, 0.0)
        return self.start.position + 0.5 * (1.0 - math.cos(phase)) * self.path


def sample_strokes(arm: Arm, seed: int, n: int) -> list[Strokes]:
    """Return the strokes of the first n scenes from a seed on that do not hold."""
    found: list[Strokes] = []
    while len(found) < n:
        motion = sample_motion(arm, seed)
        if not motion.holds:
            found.append(Strokes(**{name: getattr(motion, name) for name in Motion.__dataclass_fields__}))
        seed += 1
    return found


def false_alarm_trials(
    arm: Arm,
    name: str,
    controller: ControllerConfig,
    strokes: Sequence[Strokes],
    sensors: SensorConfig = REAL_SENSORS,
) -> list[Trial]:
    """Count entries into contact mode where nothing touches the arm.

    A world is watched until its end, or until the arm truly bears more than 0.5 N m, such as from the table.
    """
    n, seeds = len(strokes), [stroke.seed for stroke in strokes]
    worlds = Worlds(arm, [stroke.world((), sensors) for stroke in strokes], controller, n, seeds)
    play, steps = Playback(worlds, strokes), np.zeros((n, MAX_TICKS), dtype=trace_dtype(arm.n))
    before, untouched = np.zeros((n, 1), int), np.ones(n, bool)
    entries, lasting, watched = np.zeros(n), np.zeros(n), np.zeros(n)
    while play.running.any():
        ticks = play.step(steps)
        now = steps[:, :ticks]
        untouched &= np.abs(now["tau_arm"]).max(axis=(1, 2)) <= _TOUCHED_NM
        contact = np.concatenate([before, now["mode"] != codes.FREE], axis=1)
        entries += untouched * np.count_nonzero(np.diff(contact) > 0, axis=1)
        lasting += untouched * contact[:, 1:].sum(axis=1)
        watched += untouched * ticks
        before = contact[:, -1:]
    worlds.close()
    return [
        Trial(
            SLIDING if stroke.slides else FREE,
            name,
            stroke.seed,
            {
                "false_alarms": float(entries[i]),
                "false_contact_s": float(lasting[i]) / 1000.0,
                "minutes": float(watched[i]) / 60000.0,
                "touched": float(not untouched[i]),
            },
        )
        for i, stroke in enumerate(strokes)
    ]
