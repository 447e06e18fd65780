"""What passes between the processes of a run, as NumPy records of 64-bit numbers."""

import functools

import numpy as np

from contactsafe.control.records import measurement_dtype, output_dtype, target_dtype

_f = np.float64
_i = np.int64


@functools.cache
def message_dtype(n: int) -> np.dtype:
    """Describe a policy's target as it goes to the control process."""
    return np.dtype(
        [
            ("number", _i),  # counts up from 1
            ("of_tick", _i),  # control tick whose state it was made of
            ("joints", _i),  # of the arm that it is for
            ("position", _f, (3,)),  # of the tool, m
            ("quat", _f, (4,)),  # w x y z
            ("K_task", _f, (6,)),  # 1/s²
            ("D_task", _f, (6,)),  # 1/s
            ("q_posture", _f, (n,)),  # rad
        ]
    )


@functools.cache
def seen_dtype(n: int) -> np.dtype:
    """Describe what the control process tells the policy every tick."""
    return np.dtype(
        [
            ("tick", _i),
            ("q", _f, (n,)),  # as measured, rad
            ("position", _f, (3,)),  # of the tool, m
            ("rotation", _f, (3, 3)),
            ("force", _f, (3,)),  # on the tool, world axes, N
            ("residual", _f, (n,)),  # external torque of the joints, N m
            ("target", target_dtype(n)),  # in force
            ("held", _i),  # the arm is told to stay where it is
            ("mode", _i),
            ("link", _i),  # in contact, 0 for none
        ]
    )


@functools.cache
def reading_dtype(n: int) -> np.dtype:
    """Describe what a robot tells in one cycle."""
    return np.dtype(
        [
            ("time", _f),  # the robot's own clock, s
            ("q", _f, (n,)),  # rad
            ("qd", _f, (n,)),  # rad/s
            ("torque", _f, (n,)),  # measured behind the gears, gravity included, N m
            ("commanded", _f, (n,)),  # that the robot says it follows, gravity not included, N m
            ("success_rate", _f),  # of the commands that arrived in time, 0 … 1
            ("mode", _i),  # the robot's
        ]
    )


@functools.cache
def row_dtype(n: int) -> np.dtype:
    """Describe what the flight recorder keeps of one tick: enough to compute its torque again, bit by bit."""
    return np.dtype(
        [
            ("tick", _i),
            ("stamp", _i),  # wall clock, ns
            ("state", _i),  # of the run, see `states`
            ("reason", _i),
            ("reading", reading_dtype(n)),
            ("measurement", measurement_dtype(n)),
            ("target", target_dtype(n)),  # as handed to the tick
            ("target_number", _i),  # last one accepted
            ("target_age", _i),  # ticks
            ("output", output_dtype(n)),
            ("sent", _f, (n,)),  # to the robot, gravity not included, N m
            ("busy_ns", _i),  # of the tick before
        ]
    )


@functools.cache
def step_dtype() -> np.dtype:
    """Describe what the flight recorder keeps of one policy step."""
    return np.dtype(
        [
            ("step", _i),
            ("of_tick", _i),
            ("stamp", _i),  # wall clock, ns
            ("busy_ns", _i),
            ("frame_age_ms", _f),  # of the picture that was seen; NaN where none is
            ("shown", _i),  # pixels of the mask that show something
            ("pose", _f, (6,)),
            ("force", _f, (3,)),
            ("action", _f, (18,)),
        ]
    )


def as_words(record: np.ndarray) -> np.ndarray:
    """See an array of records as 64-bit words, (k,) int64."""
    return record.reshape(-1).view(np.int64)
