"""Replay: what the estimator makes of a log, with the residuals against their thresholds."""

import math
from dataclasses import dataclass

import numpy as np

from contactsafe.control.config import ControllerConfig
from contactsafe.control.contact_estimator import ContactEstimator
from contactsafe.control.signals import Contact, Measurement
from contactsafe.control.velocity import VELOCITY_SOURCES
from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.log import Log
from contactsafe.robot.arm import Arm

_OFF = 0.5
"""Fraction of its threshold about which no residual lies of an arm that is what its model says."""


@dataclass(frozen=True)
class Touch:
    """One contact in a log.

    Attributes:
        start_s, stop_s: when, by the log's own time, s.
        kind: 'obstacle', 'push' or 'tool', at its peak.
        link: most probable one at its peak, 1 … n.
        torque_nm: largest of a joint, N m.
        force: of the environment at its peak, world, (3,), N.
        point: where, world, (3,), m; NaN where the joints do not show it.
        probability: of the kind's being right as to arm or tool.
    """

    start_s: float
    stop_s: float
    kind: str
    link: int
    torque_nm: float
    force: np.ndarray
    point: np.ndarray
    probability: float


@dataclass(frozen=True)
class Replay:
    """What the estimator made of a log.

    Attributes:
        log: what was played.
        residual: external joint torque, (T, n), N m.
        threshold: with which it is compared, (T, n), N m.
        touched: whether anything touches arm or tool, (T,).
        touches: the contacts, in order.
        noise_nm: of the residual at full bandwidth, standard deviation, (n,), N m.
        bandwidth: of it that is left to the residual, as a fraction, in the end.
        velocity_from: 'robot' or 'positions', of each joint, in the end.
    """

    log: Log
    residual: np.ndarray
    threshold: np.ndarray
    touched: np.ndarray
    touches: tuple[Touch, ...]
    noise_nm: np.ndarray
    bandwidth: float
    velocity_from: tuple[str, ...]

    @property
    def offset(self) -> np.ndarray:
        """The residual about which each joint's lies, as a fraction of its threshold, (n,)."""
        return np.median(self.residual, axis=0) / np.median(self.threshold, axis=0)

    def verdict(self) -> str:
        """Return what the log shows, in one line."""
        felt = f"{len(self.touches)} contacts in {self.log.seconds:.1f} s, {self.touched.mean():.0%} of the time"
        off, worst = self.offset, int(np.argmax(np.abs(self.offset)))
        if abs(off[worst]) > _OFF:
            return (
                f"{felt}: the residual of joint {worst + 1} lies about {off[worst]:+.0%} of its threshold, as if the "
                "arm were another; check robot, tool, payload and gravity, or run contactsafe identify"
            )
        if not self.touches:
            largest = np.abs(self.residual / self.threshold).max(axis=0)
            joint = int(np.argmax(largest))
            return (
                f"nothing felt in {self.log.seconds:.1f} s: the residual is at most {largest[joint]:.0%} of its "
                f"threshold, at joint {joint + 1}"
            )
        return f"{felt}; if nothing touched the arm then, they are false"


def replay(log: Log, arm: Arm, config: ControllerConfig | None = None, wrench: bool = True) -> Replay:
    """Run the estimator over a log.

    Args:
        log: what was recorded.
        arm: of which.
        config: of the estimator; None for its default.
        wrench: whether a log without a wrench is of an arm whose tool touches nothing: a wrench of zero.

    Raises:
        InvalidInputError: the log is of another number of joints, or slower or faster than the estimator is made for.
    """
    if log.n != arm.n:
        raise InvalidInputError(f"{log.source} has {log.n} joints, arm '{arm.name}' has {arm.n}; give the right robot")
    estimator = ContactEstimator(arm, config, _nearest_rate(log))
    estimator.reset(np.clip(log.q[0], arm.q_min, arm.q_max))
    qd = np.gradient(log.q, log.time, axis=0) if log.qd is None else log.qd
    rows = len(log.time)
    residual, threshold = np.zeros((rows, arm.n)), np.zeros((rows, arm.n))
    contacts: list[Contact] = []
    for k in range(rows):
        at_tool = np.zeros(6) if wrench else None
        at_tool = log.wrench_ee[k] if log.wrench_ee is not None else at_tool
        torque = None if log.torque is None else log.torque[k]
        at_base = None if log.wrench_base is None else log.wrench_base[k]
        measured = Measurement(log.q[k], qd[k], at_tool, float(log.time[k]), torque, at_base)
        contacts.append(estimator.step(measured, None if log.command is None else log.command[k]))
        residual[k] = contacts[-1].torque
        threshold[k] = estimator.record["state"]["detection"]["threshold"]
    observer = estimator.record["state"]["observer"]
    touched = np.array([contact.touched for contact in contacts])
    return Replay(
        log,
        residual,
        threshold,
        touched,
        _touches(log, contacts, touched),
        observer["noise"]["sigma"].copy(),
        float(observer["noise"]["bandwidth"]),
        tuple(VELOCITY_SOURCES[source] for source in observer["velocity"]["source"]),
    )


def _nearest_rate(log: Log) -> float:
    """Return the time between two rows, s, within what the estimator takes by a hair."""
    step = log.step_s
    for rate_hz in (2000.0, 1000.0, 500.0, 90.0):
        if math.isclose(step, 1.0 / rate_hz, rel_tol=0.11):
            return 1.0 / rate_hz
    return step


def _touches(log: Log, contacts: list[Contact], touched: np.ndarray) -> tuple[Touch, ...]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], touched, [False]]).astype(int)))
    found = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        peak = max(contacts[start:stop], key=lambda contact: float(np.abs(contact.torque).max()))
        found.append(
            Touch(
                float(log.time[start]),
                float(log.time[min(stop, len(log.time) - 1)]),
                peak.kind,
                peak.link,
                float(np.abs(peak.torque).max()),
                peak.force,
                peak.point,
                peak.probability,
            )
        )
    return tuple(found)
