"""From detection to the mode: what each stage says of a contact, in order."""

from contactsafe.control.classification import begin_classification, classify, follow_velocity
from contactsafe.control.codes import COMPLY, FREE
from contactsafe.control.contact_work import follow_work, is_active, stored_at_most
from contactsafe.control.detection import detect
from contactsafe.control.isolation import forget_contact, isolate
from contactsafe.control.reaction import begin_reaction, react
from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled, inlined


@inlined
def supervise(c: Record) -> None:
    """Detect, isolate and classify a contact, and choose the mode.

    Args:
        c: `controller_dtype` record, its thresholds and the arm's part of the residual up to date.
    """
    state, params, torque = c.state, c.params, c.state.tool_wrench.arm_torque_fast
    ticks = max(round(state.step.ticks), 1)
    link, touched = detect(state.detection, state.mode != FREE, ticks, params.detection)
    if state.mode != FREE and not touched:
        switch(state, FREE)
    elif state.mode == FREE and touched and params.reaction.contact_aware != 0:
        switch(state, COMPLY)
    if state.mode != FREE and link != 0:
        isolate(state.isolation, c.handle, link, torque, params.arm.lever_doubted)
    follow_velocity(state.classification, state.arm.qd, state.step)
    _follow_work(state, params.classification.obstacle_stiffness_min)
    if state.mode != FREE:
        doubt_nm = 0.0
        for i in range(torque.shape[0]):
            doubt_nm += abs(state.isolation.direction[i]) * state.detection.model_uncertainty[i]
        shown = classify(
            state.classification, state.isolation, torque, is_active(state.contact_work), state.contact_work.taken_j,
            doubt_nm, state.mode, state.step, params.classification,
        )  # fmt: skip
        along = state.classification.torque_smooth_nm
        state.mode = react(state.reaction, state.mode, shown, along, state.isolation.lever_max, state.step.dt, params.reaction)
    c.output.link = state.isolation.link if state.mode != FREE and state.isolation.link != 0 else link


@inlined
def _follow_work(state: Record, softest: float) -> None:
    """Follow the work of whatever acts on the arm, also before it is found to be a contact."""
    stored = 0.0
    if state.mode != FREE:
        stored = stored_at_most(state.classification.torque_smooth_nm, state.isolation.lever, softest)
    touch, velocity = state.touch, state.classification.velocity
    follow_work(
        state.contact_work, touch.torque, touch.sigma, state.detection.model_uncertainty, velocity, state.mode != FREE,
        stored, state.step.dt,
    )  # fmt: skip


@compiled
def switch(state: Record, mode: int) -> None:
    """Begin a contact, or end one."""
    state.mode = mode
    state.detection.contact_ticks = 0
    forget_contact(state.isolation)
    begin_classification(state.classification)
    begin_reaction(state.reaction)
