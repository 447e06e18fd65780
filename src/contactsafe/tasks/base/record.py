"""What every task knows of each of its worlds, as NumPy records; a task adds fields of its own."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.policy.action import observed_pose, observed_target

_f = np.float64
_i = np.int64


def task_dtype(reward_terms: Sequence[str], own_fields: Sequence[tuple[Any, ...]] = ()) -> np.dtype:
    """Describe a task's record.

    Args:
        reward_terms: names of the reward's terms.
        own_fields: the task's, as `numpy.dtype` takes them.
    """
    return np.dtype(
        [
            ("steps", _i),  # policy steps since reset
            ("reward", _f, (len(reward_terms),)),  # of the last step, by term
            ("success", _i),  # 1 once the task is done; ends the episode
            ("failed", _i),  # 1 once it cannot be done any more; ends the episode
            ("force_mean", _f),  # on the tip in the last step, N
            ("force_peak", _f),  # N
            ("pose", _f, (6,)),  # observed: tool position, m, and rotation vector from straight down, rad
            ("target", _f, (18,)),  # observed: x_d less the pose, m and rad; K1, 1/s²; D1, 1/s
            ("force", _f, (3,)),  # observed: on the tool, as measured, smoothed, world axes, N
            *own_fields,
        ]
    )


@compiled
def observe_arm(controller: Record, task: Record) -> None:
    """Fill what every policy may observe: the tool's pose, where it is told to be and how stiffly, the force.

    Args:
        controller: `controller_dtype` record.
        task: `task_dtype` record.
    """
    observed_pose(controller, task.pose)
    observed_target(controller, task.pose, task.target)
    task.force[:] = controller.state.tool_wrench.force


@compiled
def end_step(metrics: Record, task: Record) -> None:
    """Count the step and note the forces in it.

    Args:
        metrics: `step_metrics_dtype` record.
        task: `task_dtype` record.
    """
    task.steps += 1
    task.force_mean, task.force_peak = metrics.tool_force_mean, metrics.tool_force_peak


@compiled
def force_excess(metrics: Record, gentle_n: float) -> float:
    """Return how far the largest force on the tool passes a gentle one, as a multiple of it, from 0 to 4.

    Args:
        metrics: `step_metrics_dtype` record.
        gentle_n: N.
    """
    return min(max(metrics.tool_force_peak / gentle_n - 1.0, 0.0), 4.0)


@compiled(nogil=True)
def observe_one(controllers: np.ndarray, tasks: np.ndarray, i: int) -> None:
    """Run `observe_arm` on one of an array of records."""
    observe_arm(controllers[i], tasks[i])
