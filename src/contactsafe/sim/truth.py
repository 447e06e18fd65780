"""What a world's plant did, as NumPy records: for sensors, rewards, metrics and tests, never for a controller."""

import functools

import numpy as np

from contactsafe.sim.obstacles import MAX_OBSTACLES

_f = np.float64
_i = np.int64


@functools.cache  # as for `controller_dtype`
def truth_dtype(n: int) -> np.dtype:
    """Describe what a backend reads from its plant after every tick."""
    return np.dtype(
        [
            ("q", _f, (n,)),  # rad
            ("qd", _f, (n,)),  # rad/s
            ("position", _f, (3,)),  # of the tool point, world, m
            ("rotation", _f, (3, 3)),  # its axes, world
            ("wrist_force", _f, (3,)),  # that the arm exerts on the tool, flange axes, N
            ("wrist_torque", _f, (3,)),  # likewise, about the flange, N m
            ("wrist_acceleration", _f, (3,)),  # of the tool's centre of mass, less gravity, flange axes, m/s²
            ("base_wrench", _f, (6,)),  # of the arm on its base, about the world's origin, world axes; 0 with no sensor
            ("tip_wrench", _f, (6,)),  # of the fixtures on the tool's tip, about the tool point, world axes, N, N m
            ("tip_contacts", _f),  # of the tip with fixtures
            ("arm_contacts", _f),  # of any moving part of the arm with fixtures, the tip included
            ("obstacle_force", _f, (MAX_OBSTACLES,)),  # |force| of each on the arm, N
            ("obstacle_position", _f, (MAX_OBSTACLES, 3)),  # world, m
            ("tau_contact", _f, (n,)),  # joint torque of all contacts, N m
        ]
    )


sample_dtype = np.dtype(
    [
        ("position", _f, (3,)),  # of the tool point, world, m
        ("rotation", _f, (3, 3)),
        ("tip_force", _f, (3,)),  # of the fixtures on the tip, world, N
    ]
)
"""What is kept of every tick of a policy step, for tasks."""

step_metrics_dtype = np.dtype(
    [
        ("tool_force_mean", _f),  # of the ticks, |force on the tip|, N
        ("tool_force_peak", _f),  # N
        ("contact_ticks", _i),  # ticks with the tip on a fixture
        ("obstacle_force_peak", _f),  # N
        ("arm_touched", _i),  # 1 where any part but the tip met a fixture
        ("ticks", _i),
    ]
)
"""What one policy step came to."""


@functools.cache
def trace_dtype(n: int) -> np.dtype:
    """Describe one tick as recorded for experiments."""
    return np.dtype(
        [
            ("time", _f),  # s
            ("q", _f, (n,)),  # plant, rad
            ("torque", _f, (n,)),  # command, N m
            ("position", _f, (3,)),  # tool, m
            ("error", _f, (6,)),  # x_d − x, m and rad
            ("K_task", _f, (6,)),  # in force, 1/s²
            ("D_task", _f, (6,)),  # in force, 1/s
            ("tool_force", _f, (3,)),  # fixtures on tip, world axes, N
            ("wrench_ee", _f, (6,)),  # as measured
            ("wrench_base", _f, (6,)),  # likewise
            ("obstacle_force", _f),  # largest |force| of one obstacle on the arm, N
            ("obstacle_position", _f, (MAX_OBSTACLES, 3)),  # m
            ("tau_arm", _f, (n,)),  # true external torque less the tip's, N m
            ("residual", _f, (n,)),  # N m
            ("residual_fast", _f, (n,)),  # N m
            ("mode", _i),  # of the controller: FREE, COMPLY or REJECT
            ("link", _i),
            ("progress", _f),  # of the task, 0 … 1; filled once a policy step
        ]
    )
