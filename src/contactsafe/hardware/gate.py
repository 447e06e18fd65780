"""What the control process lets through: targets that are new, of now, for this arm and sound; else the arm is held."""

import numpy as np

from contactsafe.control.target import target_fault
from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.rotation import matrix_to_quat
from contactsafe.hardware.states import (
    HELD,
    NONE,
    POLICY_SILENT,
    RUNNING,
    STOPPING,
    TARGET_JOINTS,
    TARGET_OLD,
    TARGET_ORDER,
    TARGET_UNSOUND,
)

_i = np.int64

OLD_TICKS = 50
"""A target made of a state older than this is refused; where the last good one is older, the arm is held."""

SILENT_TICKS = 200
"""After so long without a good target the run ends."""

_HELD_DAMPING = (40.0, 60.0)
"""Of the tool where it is held, along and about an axis, 1/s: from 0.4 m/s it is at rest within 0.15 s."""

gate_dtype = np.dtype(
    [
        ("sequence", _i),  # of the mailbox when it was read last
        ("number", _i),  # of the last target accepted
        ("of_tick", _i),  # likewise
        ("refused", _i),  # targets
        ("refusal", _i),  # why the last one was, NONE since one was accepted
        ("state", _i),
        ("reason", _i),
        ("holds", _i),  # the arm is told to stay where it is
    ]
)


@compiled
def verdict(gate: Record, message: Record, tick: int, joints: int, impedance: Record) -> int:
    """Return why a target is refused, `NONE` where it is not.

    Args:
        gate: `gate_dtype` record.
        message: `message_dtype` record, whole.
        tick: of now.
        joints: of the arm.
        impedance: of the controller's parameters.
    """
    if message.joints != joints:
        return TARGET_JOINTS
    if message.number <= gate.number or message.of_tick < gate.of_tick or message.of_tick > tick:
        return TARGET_ORDER
    if target_fault(message, impedance) != 0:
        return TARGET_UNSOUND
    return TARGET_OLD if tick - message.of_tick > OLD_TICKS else NONE


@compiled
def admit(gate: Record, message: Record, arrived: int, tick: int, c: Record) -> None:
    """Hand a target that has arrived to the controller, or refuse it; an arm that is to come to rest is told no more.

    Args:
        gate: `gate_dtype` record; advanced.
        message: `message_dtype` record.
        arrived: sequence number of its mailbox; one that was seen before, or is torn, is no new target.
        tick: of now.
        c: `controller_dtype` record; its target is replaced.
    """
    c.target.kept = 1
    at_work = gate.state == RUNNING or gate.state == HELD
    if not at_work or arrived <= 0 or arrived == gate.sequence:
        return
    gate.sequence = arrived
    gate.refusal = verdict(gate, message, tick, c.target.q_posture.shape[0], c.params.impedance)
    if gate.refusal != NONE:
        gate.refused += 1
        return
    gate.number, gate.of_tick, gate.holds = message.number, message.of_tick, 0
    c.target.position[:], c.target.quat[:], c.target.q_posture[:] = message.position, message.quat, message.q_posture
    c.target.K_task[:], c.target.D_task[:] = message.K_task, message.D_task
    c.target.kept = 0


@compiled
def follow_state(gate: Record, tick: int, stop: int, c: Record) -> None:
    """Go over to the state that the age of the last good target and a wish to stop ask for.

    Args:
        gate: `gate_dtype` record; advanced.
        tick: of now.
        stop: reason for which the run is to end, 0 for none.
        c: `controller_dtype` record; its target is where the arm is where that is to stay.
    """
    age = tick - gate.of_tick
    if gate.state == RUNNING or gate.state == HELD:
        why = gate.refusal if gate.refusal != NONE else POLICY_SILENT
        if stop != 0 or age > SILENT_TICKS:
            gate.state, gate.reason = STOPPING, (stop if stop != 0 else why)
        elif age > OLD_TICKS:
            gate.state, gate.reason = HELD, (gate.refusal if gate.refusal != NONE else TARGET_OLD)
        else:
            gate.state, gate.reason = RUNNING, NONE
    if gate.state == RUNNING:
        return
    if gate.holds == 0:
        _stay(c)
        gate.holds = 1
    c.target.kept = 0


@inlined
def _stay(c: Record) -> None:
    """Tell the controller to bring the tool to rest where it is, well damped, in the posture that it has."""
    target, out = c.target, c.output
    for i in range(6):
        damping = _HELD_DAMPING[0] if i < 3 else _HELD_DAMPING[1]
        if target.K_task[i] == 0.0:  # a direction that was let go is held as well
            target.K_task[i] = 0.25 * damping * damping
        target.D_task[i] = max(target.D_task[i], damping)
        if i < 3:
            target.position[i] = out.position[i] + out.velocity[i] / target.D_task[i]
    target.quat[:] = matrix_to_quat(out.rotation)
    target.q_posture[:] = c.state.arm.q
