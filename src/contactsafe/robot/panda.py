"""Franka Emika Panda (FER), from published figures; frames, shape and tools: `contactsafe.robot.franka`.

Limits: Franka Control Interface documentation, "Robot and interface specifications".
Masses, centres, inertias and friction: Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca, "Dynamic identification of the
Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization", IEEE RA-L 4(4), 2019,
in the form used by MuJoCo Menagerie. Rotor inertia is not published; 0.1 kg m² a joint is Menagerie's value.
"""

from contactsafe.robot.description import Inertia, Joint
from contactsafe.robot.franka import HAND, WIPER, franka_arm

__all__ = ["FRICTION", "HAND", "PANDA", "WIPER"]

FRICTION = (
    (0.546, 5.118, 0.0395),
    (0.872, 9.066, 0.0259),
    (0.641, 10.14, -0.0461),
    (1.279, 5.590, 0.0362),
    (0.839, 8.347, 0.0262),
    (0.303, 17.13, -0.0210),
    (0.565, 10.34, 0.0036),
)
"""φ1 N m, φ2 s/rad, φ3 rad/s of each joint (Gaz et al. 2019)."""

_ROTOR = 0.1

PANDA = franka_arm(
    name="panda",
    source="Gaz et al. 2019, doi:10.1109/LRA.2019.2931248; Franka Control Interface documentation",
    base=Inertia(
        0.629769, (-0.041018, -0.00014, 0.049974), (0.00315, 0.00388, 0.004285, 8.2904e-7, 0.00015, 8.2299e-6)
    ),
    inertias=(
        Inertia(
            4.970684,
            (0.003875, 0.002081, -0.04762),
            (0.70337, 0.70661, 0.0091170, -0.00013900, 0.0067720, 0.019169),
        ),
        Inertia(
            0.646926,
            (-0.003141, -0.02872, 0.003495),
            (0.0079620, 2.8110e-2, 2.5995e-2, -3.925e-3, 1.0254e-2, 7.04e-4),
        ),
        Inertia(
            3.228604,
            (2.7518e-2, 3.9252e-2, -6.6502e-2),
            (3.7242e-2, 3.6155e-2, 1.083e-2, -4.761e-3, -1.1396e-2, -1.2805e-2),
        ),
        Inertia(
            3.587895,
            (-5.317e-2, 1.04419e-1, 2.7454e-2),
            (2.5853e-2, 1.9552e-2, 2.8323e-2, 7.796e-3, -1.332e-3, 8.641e-3),
        ),
        Inertia(
            1.225946,
            (-1.1953e-2, 4.1065e-2, -3.8437e-2),
            (3.5549e-2, 2.9474e-2, 8.627e-3, -2.117e-3, -4.037e-3, 2.29e-4),
        ),
        Inertia(
            1.666555,
            (6.0149e-2, -1.4117e-2, -1.0517e-2),
            (1.964e-3, 4.354e-3, 5.433e-3, 1.09e-4, -1.158e-3, 3.41e-4),
        ),
        Inertia(
            7.35522e-01,
            (1.0517e-2, -4.252e-3, 6.1597e-2),
            (1.2516e-2, 1.0027e-2, 4.815e-3, -4.28e-4, -1.196e-3, -7.41e-4),
        ),
    ),
    joints=(  # q_min, q_max (rad), qd_max (rad/s), tau_max (N m), friction, rotor inertia (kg m²)
        Joint(-2.8973, 2.8973, 2.175, 87.0, FRICTION[0], _ROTOR),
        Joint(-1.7628, 1.7628, 2.175, 87.0, FRICTION[1], _ROTOR),
        Joint(-2.8973, 2.8973, 2.175, 87.0, FRICTION[2], _ROTOR),
        Joint(-3.0718, -0.0698, 2.175, 87.0, FRICTION[3], _ROTOR),
        Joint(-2.8973, 2.8973, 2.61, 12.0, FRICTION[4], _ROTOR),
        Joint(-0.0175, 3.7525, 2.61, 12.0, FRICTION[5], _ROTOR),
        Joint(-2.8973, 2.8973, 2.61, 12.0, FRICTION[6], _ROTOR),
    ),
)
