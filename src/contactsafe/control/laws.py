"""The control laws: pure, compiled, one equation each. Numbers in brackets are equations of the paper.

The paper is Zhu, Kang, Chen, "A Contact-Safe Reinforcement Learning Framework for Contact-Rich Robot Manipulation";
signs follow `M q̈ + c + g = tau_m + tau_ext`, tau_ext being what the environment exerts on the robot.
"""

import math

import numpy as np

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matmul, matmul_into, matvec, matvec_into, matvec_t_into, shorten, spd_inverse
from contactsafe.core.rotation import orientation_error
from contactsafe.core.stack import stack_matrix, stack_vector


@compiled
def task_inertia(J: Matrix, M_inv: Matrix, manipulability_floor: float, damping_max: float) -> tuple[Matrix, Matrix]:
    """Return Λ = (J M⁻¹ Jᵀ)⁻¹, damped where the arm loses a direction.

    Below a floor of manipulability w = det(J M⁻¹ Jᵀ) a term λ² I is added before inverting, growing smoothly from zero
    as (1 − w/w₀)² (Nakamura & Hanafusa 1986): the force asked along a lost direction stays finite.

    Args:
        J: task Jacobian, (6, n).
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        manipulability_floor: w₀, in the units of the determinant.
        damping_max: λ² at w = 0, 1/kg and 1/(kg m²).

    Returns:
        Λ, (6, 6), kg and kg m²; and J M⁻¹, (6, n).
    """
    J_M_inv = matmul(J, M_inv)
    inverse = matmul_into(J_M_inv, J.T, stack_matrix(6, 6))
    w = max(_determinant(inverse), 0.0)
    if w < manipulability_floor:
        damping = damping_max * (1.0 - w / manipulability_floor) ** 2
        for i in range(6):
            inverse[i, i] += damping
    Lambda = np.zeros((6, 6))
    spd_inverse(inverse, Lambda)
    return Lambda, J_M_inv


@compiled
def _determinant(A: Matrix) -> float:
    """Determinant of a symmetric positive semi-definite matrix, by Cholesky's pivots; 0 where one is not positive."""
    n = A.shape[0]
    L = stack_matrix(n, n)
    L[:] = A
    det = 1.0
    for k in range(n):
        pivot = L[k, k]
        if not pivot > 0.0:
            return 0.0
        det *= pivot
        for i in range(k + 1, n):
            factor = L[i, k] / pivot
            for j in range(k + 1, n):
                L[i, j] -= factor * L[k, j]
    return det


@compiled
def stiffness_wrench(Lambda: Matrix, error: Vector, K_task: Vector, linear_max: float, angular_max: float) -> Vector:
    """Return the task stiffness force, Λ K e of (5), (6,), N and N m; K e no longer than a bound.

    Args:
        Lambda: task inertia, (6, 6).
        error: x_d − x, position then rotation vector, (6,), m and rad.
        K_task: stiffness per unit task inertia, (6,), 1/s².
        linear_max: bound on the acceleration asked for, m/s².
        angular_max: rad/s².
    """
    acceleration = stack_vector(6)
    for i in range(6):
        acceleration[i] = K_task[i] * error[i]
    shorten(acceleration[:3], linear_max)
    shorten(acceleration[3:], angular_max)
    return matvec(Lambda, acceleration)


@compiled
def damping_wrench(Lambda: Matrix, velocity: Vector, Jdot_qd: Vector, D_task: Vector) -> Vector:
    """Return the damping force of the task, −Λ (D ẋ + J̇ q̇) of (5), (6,), N and N m.

    Args:
        Lambda: task inertia, (6, 6).
        velocity: of the tool, (6,), m/s and rad/s.
        Jdot_qd: J̇ q̇, and what a moving base adds, (6,).
        D_task: damping per unit task inertia, (6,), 1/s.
    """
    acceleration = stack_vector(6)
    for i in range(6):
        acceleration[i] = -D_task[i] * velocity[i] - Jdot_qd[i]
    return matvec(Lambda, acceleration)


@compiled
def task_error(position_d: Vector, quat_d: Vector, position: Vector, rotation: Matrix) -> Vector:
    """Return x_d − x: position difference, then rotation vector of R_d Rᵀ, world axes, (6,), m and rad."""
    error = np.empty(6)
    rotvec = orientation_error(quat_d, rotation)
    for i in range(3):
        error[i] = position_d[i] - position[i]
        error[3 + i] = rotvec[i]
    return error


@compiled
def task_nullspace(J: Matrix, J_bar: Matrix) -> Matrix:
    """Return N_t = I − J# J, (16), (n, n); J_bar is the dynamically consistent inverse M⁻¹ Jᵀ Λ, (n, 6)."""
    N = matmul(J_bar, J)
    for i in range(N.shape[0]):
        for j in range(N.shape[1]):
            N[i, j] = -N[i, j]
        N[i, i] += 1.0
    return N


@compiled
def contact_nullspace(N_t: Matrix, M_inv: Matrix, residual: Vector) -> Matrix:
    """Remove the contact direction from the task null space; return the projector, (n, n).

    N_ct = N_t (I − a# a) with a = residualᵀ N_t and a# = M⁻¹ aᵀ / (a M⁻¹ aᵀ), (21). The printed law is 0/0 where the
    contact lies wholly in task directions; there N_ct = N_t.

    Args:
        N_t: task null-space projector, (n, n).
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        residual: contact torque on the arm, (n,), N m.
    """
    n = N_t.shape[0]
    a = matvec_t_into(N_t, residual, stack_vector(n))
    M_inv_a = matvec_into(M_inv, a, stack_vector(n))
    a_M_inv_a = dot(a, M_inv_a)
    N_ct = N_t.copy()
    whole = dot(residual, matvec_into(M_inv, residual, stack_vector(n)))
    if a_M_inv_a <= 1e-6 * whole:
        return N_ct
    N_t_a_sharp = matvec_into(N_t, M_inv_a, stack_vector(n))
    for i in range(a.shape[0]):
        for j in range(a.shape[0]):
            N_ct[i, j] -= N_t_a_sharp[i] * a[j] / a_M_inv_a
    return N_ct


@compiled
def torque_against_contact(direction: Vector, M_inv: Matrix, tau_net: Vector) -> float:
    """Return the torque with which a command acts against a contact, N m.

    s = −a M⁻¹ tau_net / (a M⁻¹ aᵀ): the commanded acceleration against the contact, as a torque along it.

    Args:
        direction: unit joint-space direction of the contact torque on the arm, (n,).
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        tau_net: commanded torque less c and g, (n,), N m.
    """
    M_inv_a = matvec_into(M_inv, direction, stack_vector(direction.shape[0]))
    return -dot(M_inv_a, tau_net) / dot(direction, M_inv_a)


@compiled
def momentum_into(M: Matrix, qd: Vector, out: Vector) -> Vector:
    """Fill p = M q̇, (10), (n,), kg m²/s, and give it back."""
    return matvec_into(M, qd, out)


@compiled
def filter_gain(gain: float, dt: float) -> float:
    """Return 1 − exp(−K dt), the fraction of a step that a first-order filter of gain K (1/s) takes up in a tick."""
    return 1.0 - math.exp(-gain * dt)


@compiled
def observer_step(residual: Vector, gain: float, tau_external: Vector) -> None:
    """Advance the momentum observer in place by one tick, (12)-(14).

    r ← r + (1 − exp(−K dt)) (tau_external − r), where tau_external = Δp/dt − (tau_m + Jᵀ w − β) is the raw external
    torque of the last tick. It is the paper's integral form solved exactly for a torque constant over the tick;
    without a stored integral it neither drifts nor jumps when K changes.

    Args:
        residual: (n,), N m; updated.
        gain: `filter_gain`.
        tau_external: (n,), N m.
    """
    for i in range(residual.shape[0]):
        residual[i] += gain * (tau_external[i] - residual[i])


@compiled
def identify_masses(
    mass_error: Vector, covariance: Matrix, row: Vector, torque: float, variance: float, largest: Vector
) -> None:
    """Identify in place the masses of the links from one joint's gravity torque: one step of a Kalman filter.

    A mass that no link can have is not believed: a push too faint to be noticed would otherwise be taken for weight.

    Args:
        mass_error: relative error of each link's mass, (m,); updated.
        covariance: of it, (m, m); updated.
        row: gravity torque of the joint per relative error, (m,), N m.
        torque: found at the joint beyond the model's, N m.
        variance: of that reading, (N m)².
        largest: relative error that is believed at most, (m,).
    """
    P_row = matvec_into(covariance, row, stack_vector(row.shape[0]))
    gain = 1.0 / (dot(row, P_row) + variance)
    for i in range(row.shape[0]):
        mass_error[i] = min(max(mass_error[i] + P_row[i] * gain * torque, -largest[i]), largest[i])
        for j in range(row.shape[0]):
            covariance[i, j] -= P_row[i] * gain * P_row[j]


@compiled
def line_of_action_misses_tool(wrench: Vector, radius: float, margin: float) -> bool:
    """Tell whether a wrench at the tool point cannot come from a contact of the tool: its line of action misses it.

    Args:
        wrench: about the tool point, (6,), N and N m.
        radius: of the tool about that point, m.
        margin: moment that noise may show, N m.
    """
    force, moment = wrench[:3], wrench[3:]
    return math.sqrt(dot(moment, moment)) > radius * math.sqrt(dot(force, force)) + margin
