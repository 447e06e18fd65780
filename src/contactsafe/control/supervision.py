"""From detection to the mode: what each stage says of a contact, in order."""

from contactsafe.control.classification import STANDS_OUT_NM, begin_classification, classify, follow_velocity
from contactsafe.control.codes import COMPLY, FREE, OBSTACLE
from contactsafe.control.contact_bound import reject_limit
from contactsafe.control.contact_work import follow_work, stored_at_most, take_for_passive
from contactsafe.control.detection import detect
from contactsafe.control.isolation import forget_contact, isolate
from contactsafe.control.reaction import begin_reaction, react
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined


@inlined
def supervise(c: Record) -> None:
    """Detect, isolate and classify a contact, and choose the mode.

    Args:
        c: `controller_dtype` record, its thresholds and the arm's part of the residual up to date.
    """
    state, params, torque = c.state, c.params, c.state.tool_wrench.arm_torque_fast
    ticks = max(round(state.step.ticks), 1)
    in_contact, presses = state.mode != FREE, state.classification.torque_smooth_nm > STANDS_OUT_NM
    link, touched = detect(state.detection, in_contact, presses, ticks, params.detection)
    if state.mode != FREE and not touched:
        switch(state, FREE)
    elif state.mode == FREE and touched and params.reaction.contact_aware != 0:
        switch(state, COMPLY)
    if state.mode != FREE and link != 0:
        isolate(state.isolation, c.handle, link, torque, params.arm.lever_doubted)
    follow_velocity(state.classification, state.arm.qd, state.step)
    _follow_work(state, params.classification.obstacle_stiffness_min)
    if state.mode != FREE:
        _classify(state, params, torque)
    c.output.link = state.isolation.link if state.mode != FREE and state.isolation.link != 0 else link


@inlined
def _classify(state: Record, params: Record, torque: Vector) -> None:
    """Classify the contact, and choose the mode."""
    isolation, work, doubt_nm = state.isolation, state.contact_work, 0.0
    for i in range(torque.shape[0]):
        doubt_nm += abs(isolation.direction[i]) * state.detection.model_uncertainty[i]
    shown = classify(
        state.classification, isolation, work, torque, doubt_nm, state.mode, state.step, params.classification
    )
    if shown == OBSTACLE:
        take_for_passive(work, _stored(state, params.classification.obstacle_stiffness_min))
    along = state.classification.torque_smooth_nm
    limit = reject_limit(along, isolation, params.reaction)
    state.mode = react(state.reaction, state.mode, shown, along, limit, state.step.dt, params.reaction)


@inlined
def _follow_work(state: Record, softest: float) -> None:
    """Follow the work of whatever acts on the arm, also before it is found to be a contact."""
    stored = _stored(state, softest) if state.mode != FREE else 0.0
    uncertainty, velocity = state.detection.model_uncertainty, state.classification.velocity
    follow_work(state.contact_work, state.touch, uncertainty, velocity, state.mode, stored, state.step.dt)


@inlined
def _stored(state: Record, softest: float) -> float:
    """Return what an obstacle may hold back at the contact's present torque, J."""
    return stored_at_most(state.classification.torque_smooth_nm, state.isolation.lever, softest)


@compiled
def switch(state: Record, mode: int) -> None:
    """Begin a contact, or end one."""
    state.mode = mode
    state.detection.contact_ticks = 0
    forget_contact(state.isolation)
    begin_classification(state.classification)
    begin_reaction(state.reaction)
