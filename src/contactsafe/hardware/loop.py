"""One turn of the control loop, compiled: reading and newest target in, torque for the robot out.

Gravity is taken off here and nowhere else: a Franka adds that of its own model, and its motors' friction.
"""

import functools
import math

import numpy as np

from contactsafe.control.tick import control_tick
from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot
from contactsafe.hardware.gate import admit, follow_state, gate_dtype
from contactsafe.hardware.mailbox import publish, receive
from contactsafe.hardware.messages import message_dtype, reading_dtype, seen_dtype
from contactsafe.hardware.states import BRAKED, FAULT, STOPPING, TIME_UP, WATCHDOG_SILENT

_f = np.float64
_i = np.int64

WATCHDOG_TICKS = 200
"""Without a beat of the watchdog for so long the run ends."""

_REST_M_S, _REST_RAD_S, _REST_TICKS = 0.005, 0.02, 100
"""The arm rests where tool and joints have been slower than this for so long."""

_AT_MOST_TICKS = 2000
"""After so long the robot is let go of though the arm does not rest, to be held by its own controller."""


@functools.cache
def loop_dtype(n: int) -> np.dtype:
    """Describe what the loop remembers."""
    return np.dtype(
        [
            ("tick", _i),
            ("gate", gate_dtype),
            ("message", message_dtype(n)),  # read last
            ("seen", seen_dtype(n)),  # to be published
            ("reading", reading_dtype(n)),
            ("sent", _f, (n,)),  # torque without gravity, N m
            ("step_limit", _f, (n,)),  # most that it may change in a tick, N m
            ("watchdog", _i),  # its beat
            ("watchdog_ticks", _i),  # since that changed
            ("stopping_ticks", _i),  # since the arm is to come to rest
            ("rest_ticks", _i),  # for which it has rested
            ("done", _i),  # the robot may be let go of
            ("busy_ns", _i),  # of the turn before
            ("stamp", _i),  # wall clock, ns
        ]
    )


@compiled(nogil=True)
def turn(
    controllers: np.ndarray, loops: np.ndarray, statuses: np.ndarray, inbox: np.ndarray, message_words: np.ndarray,
    outbox: np.ndarray, seen_words: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """Run one turn: `loop.reading` has been filled, `loop.sent` is for the robot afterwards.

    Args:
        controllers, loops, statuses: one record each, `controller_dtype`, `loop_dtype` and `status_dtype`.
        inbox, outbox: mailboxes of the targets and of what the policy is told.
        message_words, seen_words: `loop.message` and `loop.seen` as words.
        rows: the recorder's ring.
    """
    c, loop, status = controllers[0], loops[0], statuses[0]
    loop.tick += 1
    gate = loop.gate
    admit(gate, loop.message, receive(inbox, message_words), loop.tick, c)
    follow_state(gate, loop.tick, _wish_to_stop(loop, status), c)
    _measure(c, loop.reading)
    control_tick(c)
    if c.output.braked != 0 and gate.state != FAULT:
        gate.state, gate.reason = FAULT, BRAKED
    _send(c, loop, status)
    _follow_rest(c, loop)
    _tell(c, loop, outbox, seen_words)
    _report(c, loop, status)
    _record(c, loop, status, rows)


@inlined
def _wish_to_stop(loop: Record, status: Record) -> int:
    """Return why the run is to end, 0 for no reason."""
    loop.watchdog_ticks += 1
    if status.beat_watchdog != loop.watchdog:
        loop.watchdog, loop.watchdog_ticks = status.beat_watchdog, 0
    if status.stop == 0 and status.lockstep == 0 and loop.watchdog_ticks > WATCHDOG_TICKS:
        return WATCHDOG_SILENT
    if status.stop == 0 and 0 < status.last_tick <= loop.tick:
        return TIME_UP
    return status.stop


@inlined
def _measure(c: Record, reading: Record) -> None:
    measurement = c.measurement
    measurement.q[:], measurement.qd[:], measurement.torque[:] = reading.q, reading.qd, reading.torque
    measurement.time, measurement.has_time, measurement.has_torque = reading.time, 1, 1
    measurement.has_wrench = 0


@inlined
def _send(c: Record, loop: Record, status: Record) -> None:
    """Take off the gravity that the robot adds, and keep to the rate once more: gravity changes as the arm moves."""
    largest = 0.0
    for i in range(loop.sent.shape[0]):
        gravity = c.dynamics.g[i] - c.state.link_masses.gravity_correction[i]
        step, limit = c.output.torque[i] - gravity - loop.sent[i], loop.step_limit[i]
        step = min(max(step, -limit), limit)
        loop.sent[i] += step
        largest = max(largest, abs(step))
    if loop.tick == 1:
        status.first_step_nm = largest
    else:
        status.largest_step_nm = max(status.largest_step_nm, largest)


@inlined
def _follow_rest(c: Record, loop: Record) -> None:
    """Tell when an arm that is to come to rest has, and may be let go of."""
    if loop.gate.state != STOPPING and loop.gate.state != FAULT:
        return
    loop.stopping_ticks += 1
    v, fastest = c.output.velocity, 0.0
    for i in range(loop.sent.shape[0]):
        fastest = max(fastest, abs(c.state.arm.qd[i]))
    slow = dot(v[:3], v[:3]) < _REST_M_S**2 and fastest < _REST_RAD_S
    loop.rest_ticks = loop.rest_ticks + 1 if slow else 0
    if loop.rest_ticks > _REST_TICKS or loop.stopping_ticks > _AT_MOST_TICKS:
        loop.done = 1


@inlined
def _tell(c: Record, loop: Record, outbox: np.ndarray, seen_words: np.ndarray) -> None:
    """Publish what the policy may know."""
    seen, wrench = loop.seen, c.state.tool_wrench
    seen.tick, seen.held, seen.mode, seen.link = loop.tick, loop.gate.holds, c.output.mode, c.output.link
    seen.q[:], seen.position[:], seen.rotation[:] = c.state.arm.q, c.output.position, c.output.rotation
    seen.force[:], seen.residual[:] = wrench.force, c.output.residual_fast
    held, target = c.state.target, seen.target
    target.position[:], target.quat[:], target.q_posture[:] = held.position, held.quat, held.q_posture
    target.K_task[:], target.D_task[:] = held.K_task, held.D_task
    publish(outbox, seen_words)


@inlined
def _report(c: Record, loop: Record, status: Record) -> None:
    gate = loop.gate
    status.beat_control += 1
    status.tick, status.state, status.reason = loop.tick, gate.state, gate.reason
    status.target_age, status.refused = loop.tick - gate.of_tick, gate.refused
    v, force, residual = c.output.velocity, c.state.tool_wrench.force, c.output.residual_fast
    status.tool_speed = math.sqrt(dot(v[:3], v[:3]))
    status.contact_link = c.output.link if c.output.mode != 0 else 0
    status.contact_n = math.sqrt(dot(c.output.force, c.output.force))
    status.contact_nm = math.sqrt(dot(residual, residual))
    status.tool_n = math.sqrt(dot(force, force))


@inlined
def _record(c: Record, loop: Record, status: Record, rows: np.ndarray) -> None:
    """Put the tick into the ring, and only then count it."""
    row, gate = rows[status.rows % rows.shape[0]], loop.gate
    row.tick, row.stamp, row.state, row.reason = loop.tick, loop.stamp, gate.state, gate.reason
    row.target_number, row.target_age, row.busy_ns = gate.number, loop.tick - gate.of_tick, loop.busy_ns
    row.reading, row.measurement, row.target, row.output = loop.reading, c.measurement, c.target, c.output
    row.sent[:] = loop.sent
    status.rows += 1
