"""What Franka's arms have in common, whatever their generation: frames, shape, tools.

Frames (modified DH): Franka Control Interface documentation, "Robot and interface specifications". Capsules: the
coarse collision shapes of franka_description.
"""

import math

from contactsafe.robot.description import ArmDescription, Capsule, Inertia, Joint, Link, Tip, Tool

_HALF = math.sqrt(0.5)
_UP = (1.0, 0.0, 0.0, 0.0)
_PLUS_X = (_HALF, _HALF, 0.0, 0.0)
_MINUS_X = (_HALF, -_HALF, 0.0, 0.0)

_FRAMES = (
    ((0.0, 0.0, 0.333), _UP),
    ((0.0, 0.0, 0.0), _MINUS_X),
    ((0.0, -0.316, 0.0), _PLUS_X),
    ((0.0825, 0.0, 0.0), _PLUS_X),
    ((-0.0825, 0.384, 0.0), _MINUS_X),
    ((0.0, 0.0, 0.0), _PLUS_X),
    ((0.088, 0.0, 0.0), _PLUS_X),
)

_BASE_CAPSULES = (
    Capsule((-0.06, 0.0, 0.06), (-0.09, 0.0, 0.06), 0.06),
    Capsule((0.0, 0.0, 0.06), (0.0, 0.0, 0.14), 0.06),
)

_CAPSULES = (
    (Capsule((0.0, 0.0, -0.19), (0.0, 0.0, -0.05), 0.06),),
    (Capsule((0.0, 0.0, -0.06), (0.0, 0.0, 0.06), 0.06),),
    (Capsule((0.0, 0.0, -0.22), (0.0, 0.0, -0.07), 0.06),),
    (
        Capsule((0.0, 0.0, -0.06), (0.0, 0.0, 0.06), 0.06),
        Capsule((-0.0825, 0.06, 0.0), (-0.0825, 0.10, 0.0), 0.06),
    ),
    (
        Capsule((0.0, 0.0, -0.29), (0.0, 0.0, -0.19), 0.06),
        Capsule((0.0, 0.08, -0.20), (0.0, 0.08, -0.06), 0.025),
    ),
    (Capsule((0.0, 0.0, -0.07), (0.0, 0.0, 0.01), 0.05),),
    (Capsule((0.0, 0.0, -0.06), (0.0, 0.0, 0.08), 0.04),),
)


def franka_arm(
    name: str, source: str, base: Inertia, inertias: tuple[Inertia, ...], joints: tuple[Joint, ...]
) -> ArmDescription:
    """Put what one generation has of its own on the common frames.

    Args:
        name: of the robot.
        source: where its numbers come from.
        base: inertia of the fixed base.
        inertias: of the seven links, each in its link's frame.
        joints: the seven.
    """
    parts = zip(_FRAMES, inertias, joints, _CAPSULES, strict=True)
    return ArmDescription(
        name=name,
        source=source,
        base=base,
        base_capsules=_BASE_CAPSULES,
        links=tuple(Link(*frame, inertia, joint, capsules) for frame, inertia, joint, capsules in parts),
        mount_position=(0.0, 0.0, 0.107),
        mount_quat=(math.cos(math.pi / 8), 0.0, 0.0, -math.sin(math.pi / 8)),
        torque_rate_max=1000.0,
        home=(0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4),
    )


FLANGE = Tool(name="bare flange", inertia=Inertia(0.0, (0.0, 0.0, 0.0), (0.0,) * 6), tcp=(0.0, 0.0, 0.0), capsules=())
"""Nothing: the tool point is the middle of the flange."""

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


_WIPER_HALF = (0.045, 0.035, 0.025)

WIPER = Tool(
    name="franka hand with wiper",
    inertia=_HAND_INERTIA + _block(0.1, (0.0, 0.0, 0.105), _WIPER_HALF),
    tcp=(0.0, 0.0, 0.130),
    capsules=_HAND_CAPSULES,
    tip=Tip(_WIPER_HALF),
)
"""The gripper with a felt block of 90 × 70 × 50 mm and 0.1 kg; the TCP is the middle of its lower face."""
