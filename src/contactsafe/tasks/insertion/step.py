"""What is scored and observed after every policy step, compiled."""

import math

import numpy as np

from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.tasks.base.record import end_step, force_excess, observe_arm

REWARD_TERMS = ("approach", "depth", "done", "time", "force", "arm_touched")

_f = np.float64

OWN_FIELDS = (
    ("mouth", _f, (3,)),  # of the hole, where it truly is, world, m
    ("axis", _f, (3,)),  # into the hole
    ("believed", _f, (3,)),  # mouth as it is believed to be, m
    ("away", _f),  # of the tip from the true mouth, sideways and up together, m
    ("depth", _f),  # of the tip in the hole, m
    ("offset", _f, (6,)),  # observed: tool less the believed mouth, m; rotation vector from straight down, rad
    ("bias", _f, (6,)),  # of the wrist's sensor, as found in the air before the first touch, N and N m
    ("wrench", _f, (6,)),  # observed: on the tool, as measured, less the bias, smoothed, world axes, N and N m
    ("elapsed", _f, (1,)),  # observed: time since the episode began, s
)

BIAS_STEPS = 6
"""Policy steps over which the sensor's bias is averaged: a tip that goes down does not touch so soon."""

_SMOOTHING = 0.5  # of the wrench, a policy step

parameters_dtype = np.dtype([(name, _f) for name in (*REWARD_TERMS, "gentle_n", "depth_m")])


@compiled
def measure(task: Record, position: Vector) -> tuple[float, float]:
    """Return how far the tip is from the mouth, sideways and up together, and how deep in it, m."""
    along, sideways = 0.0, 0.0
    for k in range(3):
        along += (position[k] - task.mouth[k]) * task.axis[k]
    for k in range(3):
        sideways += (position[k] - task.mouth[k] - along * task.axis[k]) ** 2
    return math.sqrt(sideways) + max(-along, 0.0), max(along, 0.0)


@compiled
def observe(controller: Record, task: Record) -> None:
    """Fill what the policy observes."""
    observe_arm(controller, task)
    for k in range(3):
        task.offset[k] = task.pose[k] - task.believed[k]
        task.offset[3 + k] = task.pose[3 + k]
    task.elapsed[0] = task.steps / POLICY_RATE_HZ
    measured = controller.measurement.wrench_ee
    for k in range(6):
        if task.steps == 0:
            task.bias[k], task.wrench[k] = 0.0, 0.0
        elif task.steps <= BIAS_STEPS:
            task.bias[k] += measured[k] / BIAS_STEPS
        else:
            task.wrench[k] += _SMOOTHING * (measured[k] - task.bias[k] - task.wrench[k])


@compiled
def score(task: Record, metrics: Record, parameters: Record, position: Vector) -> None:
    """Fill the reward's terms of one step, and its ends; potentials, so that nothing is earned in circles."""
    away, depth = measure(task, position)
    task.success = 1 if depth >= parameters.depth_m else 0
    task.failed = metrics.arm_touched
    task.reward[0] = parameters.approach * (task.away - away)
    task.reward[1] = parameters.depth * (depth - task.depth)
    task.reward[2] = parameters.done * task.success
    task.reward[3] = parameters.time
    task.reward[4] = parameters.force * force_excess(metrics, parameters.gentle_n)
    task.reward[5] = parameters.arm_touched * metrics.arm_touched
    task.away, task.depth = away, depth


@compiled(nogil=True)
def finish(
    start: int, stop: int, worlds: Record, controllers: Record, metrics: Record, parameters: Record, tasks: Record
) -> None:
    """Score and observe tasks start to stop; the arrays are those of `Worlds` and `InsertionTasks`."""
    for i in range(start, stop):
        score(tasks[i], metrics[i], parameters, worlds[i].truth.position)
        end_step(metrics[i], tasks[i])
        observe(controllers[i], tasks[i])


@compiled(nogil=True)
def begin(worlds: Record, controllers: Record, tasks: Record, i: int) -> None:
    """Measure and observe task i at the start of an episode."""
    tasks[i].away, tasks[i].depth = measure(tasks[i], worlds[i].truth.position)
    observe(controllers[i], tasks[i])
