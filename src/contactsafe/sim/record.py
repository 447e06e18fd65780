"""One simulated world as a NumPy record: its backend's addresses, its errors, its truth, and a push on its arm."""

import functools

import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.sim.mujoco_record import mujoco_dtype
from contactsafe.sim.sensing import errors_dtype
from contactsafe.sim.truth import truth_dtype

_f = np.float64
_i = np.int64

push_dtype = np.dtype(
    [
        ("body", _i),  # that is pushed; 0 for none
        ("point", _f, (3,)),  # in that body's frame, m
        ("force", _f, (3,)),  # world axes, N
        ("start", _i),  # tick
        ("stop", _i),  # tick
        ("ramp", _i),  # ticks from nothing to full
        ("fraction", _f),  # of the force that is in force at this tick
    ]
)
"""A push on one link, for some time."""


@functools.cache
def world_dtype(n: int) -> np.dtype:
    """Describe one world whose arm has n joints."""
    return np.dtype(
        [
            ("tick", _i),  # since reset
            ("plant", mujoco_dtype),
            ("errors", errors_dtype(n)),
            ("truth", truth_dtype(n)),
            ("push", push_dtype),
            ("motor", _f, (n,)),  # torque of the motors, N m
            ("drag", _f, (n,)),  # friction torque, against the motion, N m
            ("pushed", _f, (n,)),  # torque of the push in force, N m
            ("pushed_wrench", _f, (6,)),  # the same as a wrench about the world's origin, N and N m
        ]
    )


def world_bounds(bodies: int) -> dict[str, tuple[float, float]]:
    """Return the fields of a world that change, and what they may be; the others are what it was made with."""
    ticks, measure = (-1, 2**53), (-1e9, 1e9)
    sensed = ("joints.band", "joints.torque_bias", "joints.torque_held", "joints.qd_before")
    changing = ("q_seen", "qd_seen", "tau_delayed", "wrench_bias", "base.bias", "friction", "bristle", *sensed)
    return {
        **dict.fromkeys(("tick", "push.start", "push.stop", "push.ramp", "errors.delay_ticks"), ticks),
        **dict.fromkeys(
            ("push.point", "push.force", "push.fraction", "motor", "drag", "pushed", "pushed_wrench"), measure
        ),
        **{f"errors.{name}": measure for name in changing},
        **{f"truth.{name}": measure for name in truth_dtype(1).names or ()},
        "plant.obstacle_stopped": (0, 1),
        "push.body": (0, bodies - 1),
    }


@compiled
def push_fraction(world: Record) -> float:
    """Compute how much of its push a world's arm feels at this tick, 0 … 1."""
    push = world.push
    if push.body == 0 or world.tick < push.start or world.tick >= push.stop:
        return 0.0
    return min(1.0, (world.tick - push.start + 1) / max(push.ramp, 1))
