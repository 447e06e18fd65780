"""Identification: what of a residual is the tool's wrench, and what the arm's contact."""

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.control.laws import line_of_action_misses_tool, observer_step
from contactsafe.control.tool_in_contact import follow_tool_in_contact, forget_tool_in_contact, tool_in_contact_dtype
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import inlined
from contactsafe.core.linalg import matvec_t_into
from contactsafe.core.stack import stack_vector

_f = np.float64
_i = np.int64


def tool_wrench_dtype(n: int) -> np.dtype:
    """Describe what is remembered of the tool's wrench and of the arm's contact."""
    return np.dtype(
        [
            ("wrench", _f, (6,)),  # of the environment on the tool, where no sensor says it, N and N m
            ("force", _f, (3,)),  # on the tool, by the sensor or the residual, smoothed, N
            ("arm_torque", _f, (n,)),  # compensating residual less the tool's part, N m
            ("arm_torque_fast", _f, (n,)),  # the fast one less the tool's part, N m
            ("in_contact", tool_in_contact_dtype(n)),
            ("may_be_pushed", _i),  # 1 where somebody pushes what may be the tool
        ]
    )


@inlined
def separate_tool_wrench(
    tool: Record,
    detection_residual: Vector,
    observer: Record,
    J: Matrix,
    J_bar: Matrix,
    mode: int,
    beside_tool: bool,
    step: Record,
    params: Record,
) -> None:
    """Split the residual into the tool's part and the arm's, where no force sensor does.

    A wrench at the tool never shows in the null space, N_tᵀ Jᵀ F = 0: what does is the arm's contact. So is a force
    whose line passes far from the tool. Of the rest, the tool's is the wrench that was there before the contact, and
    the force that has met it since.

    Args:
        tool: `tool_wrench_dtype` record; advanced.
        detection_residual: (n,), N m; filled.
        observer: `observer_dtype` record.
        J: task Jacobian, (6, n).
        J_bar: its dynamically consistent inverse, (n, 6).
        mode, step: in force.
        beside_tool: whether somebody pushes the arm beside the tool.
        params: of identification.
    """
    n = detection_residual.shape[0]
    tau_tool, tau_met, tau_met_slow = stack_vector(n), stack_vector(n), stack_vector(n)
    met = tool.in_contact
    if mode == FREE:
        forget_tool_in_contact(met)
    else:
        matvec_t_into(J, tool.wrench, tau_tool)
        follow_tool_in_contact(met, observer.residual_fast - tau_tool, observer.noise, J, step)
    matvec_t_into(J[:3], met.force, tau_met)
    matvec_t_into(J[:3], met.force_slow, tau_met_slow)
    for i in range(n):
        detection_residual[i] = observer.residual_fast[i] - tau_met[i]
    wrench = matvec_t_into(J_bar, detection_residual, stack_vector(6))
    if mode == FREE and not beside_tool:
        observer_step(tool.wrench, step.tool_memory_gain, wrench)
    matvec_t_into(J, tool.wrench, tau_tool)
    for i in range(n):
        tool.arm_torque[i] = observer.residual[i] - tau_met_slow[i] - tau_tool[i]
        tool.arm_torque_fast[i] = detection_residual[i] - tau_tool[i]
    if beside_tool:
        wrench[:] = tool.wrench
    if beside_tool or not line_of_action_misses_tool(wrench, params.tool_radius_m, params.tool_moment_nm):
        matvec_t_into(J, wrench, tau_tool)
        for i in range(n):
            detection_residual[i] -= tau_tool[i]


@inlined
def take_all_for_the_arm(tool: Record, detection_residual: Vector, observer: Record) -> None:
    """Take all of the residual for the arm's contact: the tool's wrench is known, or nothing tells it apart."""
    forget_tool_in_contact(tool.in_contact)
    detection_residual[:] = observer.residual_fast
    tool.arm_torque[:] = observer.residual
    tool.arm_torque_fast[:] = observer.residual_fast
