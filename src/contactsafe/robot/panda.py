"""Franka Emika Panda (FER) and what it carries, from published figures.

Frames and limits: Franka Control Interface documentation, "Robot and interface specifications" (modified DH).
Masses, centres, inertias and friction: Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca, "Dynamic identification of the
Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization", IEEE RA-L 4(4), 2019,
in the form used by MuJoCo Menagerie. Capsules: the coarse collision shapes of franka_description.
Rotor inertia is not published; 0.1 kg m² a joint is Menagerie's value (math of the wrist: README, "Limits").
"""

import math

from contactsafe.robot.facts import ArmFacts, Capsule, Inertia, Joint, Link, Tool

_ROTOR = 0.1
_HALF = math.sqrt(0.5)
_UP = (1.0, 0.0, 0.0, 0.0)
_PLUS_X = (_HALF, _HALF, 0.0, 0.0)
_MINUS_X = (_HALF, -_HALF, 0.0, 0.0)

PANDA = ArmFacts(
    name="panda",
    source="Gaz et al. 2019, doi:10.1109/LRA.2019.2931248; Franka Control Interface documentation",
    base=Inertia(
        0.629769, (-0.041018, -0.00014, 0.049974), (0.00315, 0.00388, 0.004285, 8.2904e-7, 0.00015, 8.2299e-6)
    ),
    base_capsules=(
        Capsule((-0.06, 0.0, 0.06), (-0.09, 0.0, 0.06), 0.06),
        Capsule((0.0, 0.0, 0.06), (0.0, 0.0, 0.14), 0.06),
    ),
    links=(
        Link(
            (0.0, 0.0, 0.333),
            _UP,
            Inertia(
                4.970684,
                (0.003875, 0.002081, -0.04762),
                (0.70337, 0.70661, 0.0091170, -0.00013900, 0.0067720, 0.019169),
            ),
            Joint(-2.8973, 2.8973, 2.175, 87.0, (0.546, 5.118, 0.0395), _ROTOR),
            (Capsule((0.0, 0.0, -0.19), (0.0, 0.0, -0.05), 0.06),),
        ),
        Link(
            (0.0, 0.0, 0.0),
            _MINUS_X,
            Inertia(
                0.646926,
                (-0.003141, -0.02872, 0.003495),
                (0.0079620, 2.8110e-2, 2.5995e-2, -3.925e-3, 1.0254e-2, 7.04e-4),
            ),
            Joint(-1.7628, 1.7628, 2.175, 87.0, (0.872, 9.066, 0.0259), _ROTOR),
            (Capsule((0.0, 0.0, -0.06), (0.0, 0.0, 0.06), 0.06),),
        ),
        Link(
            (0.0, -0.316, 0.0),
            _PLUS_X,
            Inertia(
                3.228604,
                (2.7518e-2, 3.9252e-2, -6.6502e-2),
                (3.7242e-2, 3.6155e-2, 1.083e-2, -4.761e-3, -1.1396e-2, -1.2805e-2),
            ),
            Joint(-2.8973, 2.8973, 2.175, 87.0, (0.641, 10.14, -0.0461), _ROTOR),
            (Capsule((0.0, 0.0, -0.22), (0.0, 0.0, -0.07), 0.06),),
        ),
        Link(
            (0.0825, 0.0, 0.0),
            _PLUS_X,
            Inertia(
                3.587895,
                (-5.317e-2, 1.04419e-1, 2.7454e-2),
                (2.5853e-2, 1.9552e-2, 2.8323e-2, 7.796e-3, -1.332e-3, 8.641e-3),
            ),
            Joint(-3.0718, -0.0698, 2.175, 87.0, (1.279, 5.590, 0.0362), _ROTOR),
            (
                Capsule((0.0, 0.0, -0.06), (0.0, 0.0, 0.06), 0.06),
                Capsule((-0.0825, 0.06, 0.0), (-0.0825, 0.10, 0.0), 0.06),
            ),
        ),
        Link(
            (-0.0825, 0.384, 0.0),
            _MINUS_X,
            Inertia(
                1.225946,
                (-1.1953e-2, 4.1065e-2, -3.8437e-2),
                (3.5549e-2, 2.9474e-2, 8.627e-3, -2.117e-3, -4.037e-3, 2.29e-4),
            ),
            Joint(-2.8973, 2.8973, 2.61, 12.0, (0.839, 8.347, 0.0262), _ROTOR),
            (
                Capsule((0.0, 0.0, -0.29), (0.0, 0.0, -0.19), 0.06),
                Capsule((0.0, 0.08, -0.20), (0.0, 0.08, -0.06), 0.025),
            ),
        ),
        Link(
            (0.0, 0.0, 0.0),
            _PLUS_X,
            Inertia(
                1.666555,
                (6.0149e-2, -1.4117e-2, -1.0517e-2),
                (1.964e-3, 4.354e-3, 5.433e-3, 1.09e-4, -1.158e-3, 3.41e-4),
            ),
            Joint(-0.0175, 3.7525, 2.61, 12.0, (0.303, 17.13, -0.0210), _ROTOR),
            (Capsule((0.0, 0.0, -0.07), (0.0, 0.0, 0.01), 0.05),),
        ),
        Link(
            (0.088, 0.0, 0.0),
            _PLUS_X,
            Inertia(
                7.35522e-01,
                (1.0517e-2, -4.252e-3, 6.1597e-2),
                (1.2516e-2, 1.0027e-2, 4.815e-3, -4.28e-4, -1.196e-3, -7.41e-4),
            ),
            Joint(-2.8973, 2.8973, 2.61, 12.0, (0.565, 10.34, 0.0036), _ROTOR),
            (Capsule((0.0, 0.0, -0.06), (0.0, 0.0, 0.08), 0.04),),
        ),
    ),
    mount_position=(0.0, 0.0, 0.107),
    mount_quat=(math.cos(math.pi / 8), 0.0, 0.0, -math.sin(math.pi / 8)),
    torque_rate_max=1000.0,
    home=(0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4),
)

_HAND_CAPSULES = (Capsule((0.0, -0.06, 0.04), (0.0, 0.06, 0.04), 0.04),)
_HAND_INERTIA = Inertia(0.73, (-0.01, 0.0, 0.03), (0.001, 0.0025, 0.0017, 0.0, 0.0, 0.0))

HAND = Tool(
    name="franka hand",
    inertia=_HAND_INERTIA,
    tcp=(0.0, 0.0, 0.1034),
    capsules=(*_HAND_CAPSULES, Capsule((0.0, 0.0, 0.06), (0.0, 0.0, 0.0934), 0.01)),
)
"""The two-finger gripper; its TCP lies between the finger tips."""


def _block(mass: float, centre: tuple[float, float, float], half: tuple[float, float, float]) -> Inertia:
    xx, yy, zz = (value * value * mass / 3 for value in half)
    return Inertia(mass, centre, (yy + zz, xx + zz, xx + yy, 0.0, 0.0, 0.0))


_PAD_HALF = (0.045, 0.035, 0.025)

WIPING_PAD = Tool(
    name="franka hand with wiping pad",
    inertia=_HAND_INERTIA + _block(0.1, (0.0, 0.0, 0.105), _PAD_HALF),
    tcp=(0.0, 0.0, 0.130),
    capsules=_HAND_CAPSULES,
    pad_half_size=_PAD_HALF,
)
"""The gripper holding a felt block of 90 × 70 × 50 mm and 0.1 kg; the TCP is the middle of its lower face."""
