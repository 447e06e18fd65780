"""What an arm puts on its base: momentum and weight of all that it is made of, about the origin of the world.

Its rate of momentum is the sum of all forces on it: of its weight, of what touches it, and of the base. Torques and
friction of the joints act within the arm and are not in that sum, so no Coriolis torque and no friction is needed.
"""

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into
from contactsafe.core.native import view1, view2
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import inertia_times


@compiled
def arm_momentum_into(handle: Record, qd: Vector, out: Vector) -> None:
    """Fill the momentum of the arm, and that about the world's origin, world axes, (6,), kg m/s and kg m²/s.

    The rotors' own spin is not in it.

    Args:
        handle: `handle_dtype` record, up to date.
        qd: joint velocities, (n,), rad/s.
        out: (6,).
    """
    n = qd.shape[0]
    composite, axes = view2(handle.crb, handle.nbody, 10), view2(handle.cdof, n, 6)
    twist, momentum, turned = stack_vector(6), stack_vector(6), stack_vector(3)
    momentum[:] = 0.0
    for i in range(n):
        for k in range(6):
            twist[k] = axes[i, k] * qd[i]
        inertia_times(composite[handle.first_body + i], twist, momentum)
    out[:3] = momentum[3:]  # MuJoCo has the angular part first, about the arm's centre of mass
    cross_into(view2(handle.subtree_com, 2, 3)[1], out[:3], turned)
    for k in range(3):
        out[3 + k] = momentum[k] + turned[k]


@compiled
def arm_weight_into(handle: Record, out: Vector) -> None:
    """Fill the weight of the arm as a wrench about the world's origin, world axes, (6,), N and N m.

    Args:
        handle: `handle_dtype` record, up to date.
        out: (6,).
    """
    mass = view1(handle.body_subtreemass, handle.nbody)[1]
    for k in range(3):
        out[k] = mass * handle.gravity[k]
    cross_into(view2(handle.subtree_com, 2, 3)[1], out[:3], out[3:])


@compiled
def weight_moment_regressor(handle: Record, out: Matrix) -> None:
    """Fill the moment of weight about the world's origin per relative error of each link's mass, (3, n + 1), N m.

    The last column is of what the last link carries as bodies of its own, as in `mass_regressor`.

    Args:
        handle: `handle_dtype` record, up to date.
        out: (3, n + 1).
    """
    com, mass = view2(handle.xipos, handle.nbody, 3), view1(handle.body_mass, handle.nbody)
    weight, moment = stack_vector(3), stack_vector(3)
    out[:] = 0.0
    for body in range(handle.first_body, handle.nbody):
        link = min(body - handle.first_body, out.shape[1] - 1)
        for k in range(3):
            weight[k] = mass[body] * handle.gravity[k]
        cross_into(com[body], weight, moment)
        for k in range(3):
            out[k, link] += moment[k]
