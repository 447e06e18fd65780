"""What a simulated Franka meets: a bottle in its wrist's path, and a person's pushes, at rest and amid the work."""

from contactsafe.robot.arm import Arm
from contactsafe.sim.franka_scene import LinkPush
from contactsafe.sim.obstacles import Obstacle

PUSH_N = 25.0
REST_S, WORK_S, FOR_S = 7.5, 20.0, 1.0
"""When the arm is pushed, s: while it waits at the start, and while it works; and for how long."""

GOES_S = 2.4
"""When the bottle, which stood in the path from the beginning, is taken away, s."""

WORK_BEGINS_S = 9.0
"""When there is work, s."""

_TAKEN_IN_S, _TAKEN_M = 0.3, 0.4
_RADIUS_M, _HALF_M, _STIFFNESS, _KG = 0.035, 0.12, 2000.0, 0.5
_COVER_M, _GAP_M, _ABOVE_M = 0.06, 0.05, 0.05
"""Of the wrist about its axis; to the bottle at first; and how far the bottle's middle is above the flange."""

_PUSHED = 5


def pushes() -> tuple[LinkPush, ...]:
    """Return a person's pushes on the forearm, from the front."""
    return tuple(LinkPush(_PUSHED, (-PUSH_N, 0.0, 0.0), at_s, FOR_S) for at_s in (REST_S, WORK_S))


def bottle_in_the_way(arm: Arm) -> Obstacle:
    """Return a bottle held in a hand before the arm's wrist, which meets it as the tool goes forward from home."""
    tool, tcp = arm.tool_pose(arm.home).position, 0.0 if arm.tool is None else arm.tool.tcp[2]
    x, y, z = (float(value) for value in tool)
    position = (x + _COVER_M + _GAP_M + _RADIUS_M, y, z + tcp + _ABOVE_M)
    return Obstacle(
        position, _RADIUS_M, _STIFFNESS, mass=_KG, half_length=_HALF_M, travel=(0.0, _TAKEN_M, 0.0),
        travel_s=(GOES_S, GOES_S + _TAKEN_IN_S),
    )  # fmt: skip
