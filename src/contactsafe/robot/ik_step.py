"""One step of inverse kinematics by damped least squares, within the joint limits."""

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec, matvec_t, spd_inverse
from contactsafe.core.stack import stack_matrix, stack_vector

_STEP = 0.5  # largest change of one joint in one iteration, rad: the linearised arm is worth little beyond
_DAMPING = 1e-6  # keeps the normal matrix invertible in a singularity; too small to be felt elsewhere
_MARGIN = 0.1  # rad from a joint limit at which a step away from it begins
_RECOVERY = 0.2  # fraction of the missing margin that one iteration asks to win back


@compiled
def limited_step(J: Matrix, error: Vector, q: Vector, q_min: Vector, q_max: Vector, step: Vector) -> None:
    """Fill the step, (n,): joints that it would carry past a limit stop there, and the others make up for them.

    Args:
        J: of the tool, (6, n).
        error: of the pose, (6,), m and rad.
        q, q_min, q_max: joint positions and their limits, (n,), rad.
        step: (n,), rad.
    """
    n = q.shape[0]
    free, A, A_inv = stack_vector(n), stack_matrix(6, 6), stack_matrix(6, 6)
    for i in range(n):
        free[i] = 1.0
        below, above = q_min[i] + _MARGIN - q[i], q[i] - (q_max[i] - _MARGIN)
        step[i] = _RECOVERY * (max(below, 0.0) - max(above, 0.0))
    wanted = step.copy()
    for _ in range(n):
        _damped_step(J, error, wanted, free, step, A, A_inv)
        _shorten(step)
        stopped = False
        for i in range(n):
            past = not q_min[i] <= q[i] + step[i] <= q_max[i]
            if free[i] == 1.0 and past:
                free[i] = 0.0
                wanted[i] = min(max(q[i] + step[i], q_min[i]), q_max[i]) - q[i]
                stopped = True
        if not stopped:
            return


@compiled
def _damped_step(
    J: Matrix, error: Vector, wanted: Vector, free: Vector, step: Vector, A: Matrix, A_inv: Matrix
) -> None:
    """Step = wanted + Jᵀ (J Jᵀ + λ 1)⁻¹ (error − J wanted), joints that are not free left as wanted; λ = ½ |error|²."""
    n = wanted.shape[0]
    damping = 0.5 * dot(error, error) + _DAMPING
    for i in range(6):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                s += J[i, k] * free[k] * J[j, k]
            A[i, j] = s
            A[j, i] = s
        A[i, i] += damping
    spd_inverse(A, A_inv)
    missing = matvec(J, wanted)
    for i in range(6):
        missing[i] = error[i] - missing[i]
    correction = matvec_t(J, matvec(A_inv, missing))
    for i in range(n):
        step[i] = wanted[i] + free[i] * correction[i]


@compiled
def _shorten(step: Vector) -> None:
    largest = 0.0
    for i in range(step.shape[0]):
        largest = max(largest, abs(step[i]))
    if largest > _STEP:
        for i in range(step.shape[0]):
            step[i] *= _STEP / largest
