"""How the arm is brought to rest: braked until reset, or its tool where no new target came."""

from contactsafe.control.laws import task_error
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec
from contactsafe.core.rotation import matrix_to_quat, quat_multiply, rotvec_to_quat
from contactsafe.core.stack import stack_vector

_BRAKE = 10.0
"""Corner of the brake, critically damped, 1/s: speed is gone within some 0.2 s."""

_SLOW_RAD_S = 0.05

_HOLD_RAD = 0.1


@compiled
def stop_torque(clock: Record, arm: Record, M: Matrix) -> Vector:
    """Stop all joints alike and hold them there: −M (2 ω q̇ + ω² (q − q_hold)), (n,), N m, without c and g.

    Critically damped whatever the joints' inertia. q_hold is where the arm comes to rest.
    """
    n = arm.q.shape[0]
    if clock.at_rest == 0:
        clock.q_hold[:] = arm.q
        clock.at_rest = 1
        for i in range(n):
            if abs(arm.qd[i]) > _SLOW_RAD_S:
                clock.at_rest = 0
    wanted = stack_vector(n)
    for i in range(n):
        away = min(max(arm.q[i] - clock.q_hold[i], -_HOLD_RAD), _HOLD_RAD)
        wanted[i] = -2.0 * _BRAKE * arm.qd[i] - _BRAKE * _BRAKE * away
    return matvec(M, wanted)


@compiled
def stop_late_target(clock: Record, target: Record, kept: int, arm: Record, dynamics: Record, params: Record) -> None:
    """Where no new target has come for too long, put x_d where the tool comes to rest by itself, if that is nearer.

    That is x + ẋ D/K on every axis, where what acts on the tool elastically is just what damps it: nothing jumps.

    Args:
        clock, target: of the state; both are advanced.
        kept: 1 in a tick for which no new target came.
        arm, dynamics, params: as believed now; those of the clock.
    """
    if kept == 0:
        clock.target_age, clock.target_late = 0.0, 0
        return
    clock.target_age += clock.elapsed
    if clock.target_late != 0 or clock.target_age * params.dt <= params.target_timeout_s:
        return
    clock.target_late, coasts = 1, stack_vector(6)
    error = task_error(target.position, target.quat, dynamics.position, dynamics.rotation)
    for i in range(6):
        if target.K_task[i] > 0.0:
            velocity = dynamics.velocity[i] + dynamics.carried_velocity[i]
            coasts[i] = velocity * target.D_task[i] / target.K_task[i]
        else:  # what was let go has no place to come to
            coasts[i], error[i] = 0.0, 0.0
    if dot(error[:3], error[:3]) > dot(coasts[:3], coasts[:3]):
        target.position[:] = dynamics.position
        target.position += coasts[:3]
    if dot(error[3:], error[3:]) > dot(coasts[3:], coasts[3:]):
        target.quat[:] = quat_multiply(rotvec_to_quat(coasts[3:]), matrix_to_quat(dynamics.rotation))
    target.q_posture[:] = arm.q
