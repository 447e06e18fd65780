"""The simulated millisecond, compiled: sense, control, actuate, physics, measure. Runs without the GIL."""

import math

import numpy as np

from contactsafe.control.tick import control_tick
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import matvec_t_into
from contactsafe.core.stack import stack_vector
from contactsafe.sim import mujoco_backend
from contactsafe.sim.record import push_fraction
from contactsafe.sim.sensing import actuate, sense


@compiled(nogil=True)
def run_ticks(
    world: Record,
    controller: Record,
    noise: Matrix,
    ticks: int,
    metrics: Record,
    samples: np.ndarray,
    trace: np.ndarray,
) -> None:
    """Run a number of control ticks of one world in MuJoCo.

    Args:
        world: `world_dtype` record.
        controller: `controller_dtype` record, its target set.
        noise: standard normal numbers, (at least ticks, `noise_channels`).
        ticks: how many.
        metrics: `step_metrics_dtype` record; overwritten.
        samples: `sample_dtype` records, one a tick; overwritten.
        trace: array of `trace_dtype` records, one a tick, or an empty one.
    """
    begin_step(metrics, ticks)
    for k in range(ticks):
        begin_tick(world, controller, noise[k])
        mujoco_backend.write(world)
        mujoco_backend.step(world)
        mujoco_backend.read(world)
        end_tick(world, controller, metrics, samples, trace, k)
    end_step(metrics)


@compiled
def begin_step(metrics: Record, ticks: int) -> None:
    """Begin the metrics of a step of so many ticks."""
    metrics.tool_force_mean, metrics.tool_force_peak, metrics.contact_ticks = 0.0, 0.0, 0
    metrics.obstacle_force_peak, metrics.arm_touched = 0.0, 0
    metrics.ticks = ticks


@compiled
def end_step(metrics: Record) -> None:
    """Finish them."""
    metrics.tool_force_mean /= metrics.ticks


@compiled
def begin_tick(world: Record, controller: Record, noise: Vector) -> None:
    """Sense, control, drive."""
    sense(world, controller, noise)
    control_tick(controller)
    drive(world, controller, noise)


@compiled
def drive(world: Record, controller: Record, noise: Vector) -> None:
    """Fill the torques that the backend is to write, and how much of the push is on."""
    actuate(world, controller, noise)
    world.push.fraction = push_fraction(world)


@compiled
def end_tick(
    world: Record, controller: Record, metrics: Record, samples: np.ndarray, trace: np.ndarray, k: int
) -> None:
    """Measure what the k-th tick brought, and write it down; the truth is what the backend read after it."""
    truth, sample = world.truth, samples[k]
    sample.position[:], sample.rotation[:] = truth.position, truth.rotation
    sample.tip_force[:] = truth.tip_wrench[:3]
    _measure(truth, metrics)
    if trace.shape[0] > 0:
        _record(world, controller, trace[k])
    world.tick += 1


@compiled
def _measure(truth, metrics):
    force = truth.tip_wrench
    size = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    metrics.tool_force_mean += size
    metrics.tool_force_peak = max(metrics.tool_force_peak, size)
    metrics.obstacle_force_peak = max(metrics.obstacle_force_peak, truth.obstacle_force.max())
    if truth.arm_contacts > truth.tip_contacts:
        metrics.arm_touched = 1
    if truth.tip_contacts > 0.0:
        metrics.contact_ticks += 1


@compiled
def _record(world, controller, row):
    truth, out = world.truth, controller.output
    row.time = world.tick * controller.params.clock.dt
    row.q[:] = truth.q
    row.torque[:] = out.torque
    row.position[:] = truth.position
    row.error[:] = out.error
    row.K_task[:] = controller.state.impedance.K_task
    row.D_task[:] = controller.state.impedance.D_task
    row.wrench_ee[:] = controller.measurement.wrench_ee
    row.wrench_base[:] = controller.measurement.wrench_base
    row.residual[:] = out.residual
    row.residual_fast[:] = out.residual_fast
    row.mode, row.link = out.mode, out.link
    row.tool_force[:] = truth.tip_wrench[:3]
    row.obstacle_force = truth.obstacle_force.max()
    row.obstacle_position[:] = truth.obstacle_position
    of_tip = matvec_t_into(controller.dynamics.J, truth.tip_wrench, stack_vector(truth.q.shape[0]))
    for i in range(of_tip.shape[0]):
        row.tau_arm[i] = truth.tau_contact[i] + world.pushed[i] - of_tip[i]
