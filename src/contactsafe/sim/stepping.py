"""The simulated millisecond, compiled: sense, control, act, integrate, measure. Runs without the GIL."""

import math

import numpy as np

from contactsafe.control.tick import control_tick
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross, cross_into, matvec, matvec_into, matvec_t
from contactsafe.core.native import mj_jac, mj_step, view1, view2
from contactsafe.core.stack import stack_vector
from contactsafe.robot.friction import joint_friction_into
from contactsafe.sim.whiteboard import erase_under_pad

_ERASE_EVERY = 8  # ticks: at 0.4 m/s the pad moves 3 mm between, a twentieth of its width


@compiled(nogil=True)
def run_ticks(plant, controller, cells, noise, ticks, report, trace):
    """Run a number of control ticks of one world.

    Args:
        plant: `plant_dtype` record.
        controller: `controller_dtype` record, its target set.
        cells: the board's, uint8, (rows, columns).
        noise: standard normal numbers, (at least ticks, `noise_channels`).
        ticks: how many.
        report: `step_metrics_dtype` record; overwritten.
        trace: array of `trace_dtype` records, one a tick, or an empty one.
    """
    begin_step_metrics(report, ticks)
    for k in range(ticks):
        sense(plant, controller, noise[k])
        control_tick(controller)
        act(plant, controller, noise[k])
        mj_step(plant.model, plant.data)
        end_tick(plant, controller, cells, report, trace, k)
    report.tool_force_mean /= ticks


@compiled
def begin_step_metrics(report, ticks):
    """Begin to report on so many ticks."""
    report.tool_force_mean, report.tool_force_peak, report.contact_ticks = 0.0, 0.0, 0
    report.obstacle_force_peak, report.arm_touched, report.erased = 0.0, 0, 0
    report.ticks = ticks


@compiled
def end_tick(plant, controller, cells, report, trace, k):
    """Measure what the k-th tick brought, erase, and write it down; the plant holds what physics made of it."""
    _measure(plant, cells, report)
    if trace.shape[0] > 0:
        _record(plant, controller, trace[k])
    plant.tick += 1


@compiled
def sense(plant, controller, noise):
    """Fill the controller's measurement from the plant, with noise; the only way from plant to controller."""
    measurement = controller.measurement
    n = measurement.q.shape[0]
    qpos, qvel = view1(plant.qpos, n), view1(plant.qvel, n)
    for i in range(n):
        q = qpos[i] + plant.q_sigma * noise[i]
        if plant.encoder_step > 0.0:
            q = plant.encoder_step * math.floor(q / plant.encoder_step + 0.5)
        qd = qvel[i] + plant.qd_sigma * noise[n + i]
        if plant.velocity_filter_gain > 0.0:
            rate = 0.0 if plant.tick == 0 else (q - plant.q_seen[i]) / controller.params.clock.dt
            qd = plant.qd_seen[i] + plant.velocity_filter_gain * (rate - plant.qd_seen[i])
        plant.q_seen[i], plant.qd_seen[i] = q, qd
        measurement.q[i], measurement.qd[i] = q, qd
    _sense_wrench(plant, controller, noise[3 * n :])


@compiled
def _sense_wrench(plant, controller, noise):
    """Wrist sensor with its inertial unit: what is left after the tool's weight and inertia are taken out.

    A sensor reads what the arm exerts on the tool. With the specific force a of the tool's centre of mass,
    f_env = m a − f_read and t_env = com × m a − t_read about the flange; then moved to the tool point. The axes are
    those of the last tick's measured posture.
    """
    data = view1(plant.sensordata, plant.nsensordata)
    ma, force, moment, lever_moment = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    for k in range(3):
        accelerometer = data[plant.adr_wrist_accelerometer + k] + plant.accelerometer_sigma * noise[6 + k]
        ma[k] = plant.tool_mass * accelerometer
        force[k] = ma[k] - data[plant.adr_wrist_force + k] + plant.wrench_bias[k] + plant.force_sigma * noise[k]
    cross_into(plant.tool_com, ma, lever_moment)
    for k in range(3):
        read = data[plant.adr_wrist_torque + k]
        moment[k] = lever_moment[k] - read + plant.wrench_bias[3 + k] + plant.moment_sigma * noise[3 + k]
    moment -= cross_into(plant.tcp, force, lever_moment)
    R = controller.dynamics.rotation
    measurement = controller.measurement
    matvec_into(R, force, measurement.wrench_ee[:3])
    matvec_into(R, moment, measurement.wrench_ee[3:])
    measurement.has_wrench = 1


@compiled
def act(plant, controller, noise):
    """Apply the command to the plant: delay, torque noise, friction, the push that disturbs it; move the obstacles."""
    tau = controller.output.torque
    n = tau.shape[0]
    ctrl, applied = view1(plant.ctrl, n), view1(plant.qfrc_applied, n)
    friction = joint_friction_into(plant.friction, view1(plant.qvel, n), stack_vector(n))
    push = push_torque_into(plant, stack_vector(n))
    for i in range(n):
        command = plant.tau_delayed[i] if plant.delay_ticks > 0 else tau[i]
        plant.tau_delayed[i] = tau[i]
        ctrl[i] = command + plant.torque_sigma * noise[2 * n + i]
        applied[i] = push[i] - friction[i]
    _move_obstacles(plant)


@compiled
def _move_obstacles(plant):
    """Move the springs' rest lengths of the obstacles that travel."""
    rest = view1(plant.qpos_spring, plant.nq)
    for index in range(plant.n_obstacles):
        adr = plant.obstacle_springs[index]
        # Before the first step the sensor still reads what was before the reset.
        if plant.tick > 0 and force_of_obstacle(plant, index) >= plant.obstacle_travel_n[index]:
            plant.obstacle_stopped[index] = 1
        if adr >= 0 and plant.obstacle_stopped[index] == 0:
            start, stop = plant.obstacle_travel_ticks[index]
            share = min(max((plant.tick - start) / (stop - start), 0.0), 1.0)
            for k in range(3):
                rest[adr + k] = share * plant.obstacle_travel[index, k]


@compiled
def push_torque_into(plant, tau):
    """Fill the joint torque of the push in force at this tick, (n,), N m, and give it back."""
    tau[:] = 0.0
    if plant.push_body == 0 or plant.tick < plant.push_start or plant.tick >= plant.push_stop:
        return tau
    body = plant.push_body
    R = view2(plant.xmat, plant.nbody, 9)[body].reshape(3, 3)
    point = view2(plant.xpos, plant.nbody, 3)[body] + matvec(R, plant.push_point)
    J = np.zeros((3, plant.nv))
    unused = np.zeros((3, plant.nv))
    mj_jac(plant.model, plant.data, J.ctypes, unused.ctypes, point.ctypes, body)
    share = min(1.0, (plant.tick - plant.push_start + 1) / max(plant.push_ramp, 1))
    for i in range(tau.shape[0]):
        for k in range(3):
            tau[i] += J[k, i] * plant.push_force[k] * share
    return tau


@compiled
def tool_position(plant):
    """Give where the plant's tool point is, world, (3,), m."""
    return view2(plant.site_xpos, plant.tcp_site + 1, 3)[plant.tcp_site]


@compiled
def tool_rotation(plant):
    """Give the axes of the plant's tool, world, (3, 3)."""
    return view2(plant.site_xmat, plant.tcp_site + 1, 9)[plant.tcp_site].reshape(3, 3)


@compiled
def pad_force(plant, out):
    """Fill the force of board and table on the pad by the simulator, world axes, (3,), N."""
    data = view1(plant.sensordata, plant.nsensordata)
    for k in range(3):
        out[k] = 0.0
    if plant.adr_pad_board >= 0:
        for k in range(3):
            out[k] = data[plant.adr_pad_board + 1 + k] + data[plant.adr_pad_table + 1 + k]


@compiled
def force_of_obstacle(plant, index):
    """Give the |force| between the arm and one obstacle by the simulator, N."""
    force = view1(plant.sensordata, plant.nsensordata)[plant.adr_obstacles[index] + 1 :]
    return math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)


@compiled
def obstacle_force(plant):
    """Give the largest |force| between the arm and one obstacle by the simulator, N."""
    largest = 0.0
    for index in range(plant.n_obstacles):
        largest = max(largest, force_of_obstacle(plant, index))
    return largest


@compiled
def _measure(plant, cells, report):
    force = stack_vector(3)
    pad_force(plant, force)
    size = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    report.tool_force_mean += size
    report.tool_force_peak = max(report.tool_force_peak, size)
    report.obstacle_force_peak = max(report.obstacle_force_peak, obstacle_force(plant))
    data = view1(plant.sensordata, plant.nsensordata)
    pad_contacts = 0.0
    if plant.adr_pad_board >= 0:
        pad_contacts = data[plant.adr_pad_board] + data[plant.adr_pad_table]
    if data[plant.adr_arm_board] + data[plant.adr_arm_table] > pad_contacts:
        report.arm_touched = 1
    if pad_contacts > 0.0:
        report.contact_ticks += 1
    if plant.tick % _ERASE_EVERY == 0 and size > plant.press_n:
        report.erased += erase_under_pad(
            cells, plant.origin[0], plant.origin[1], plant.cell, tool_position(plant), tool_rotation(plant),
            plant.pad_half[0], plant.pad_half[1],
        )  # fmt: skip


@compiled
def _record(plant, controller, row):
    out = controller.output
    n = out.torque.shape[0]
    row.time = plant.tick * controller.params.clock.dt
    row.q[:] = view1(plant.qpos, n)
    row.torque[:] = out.torque
    row.position[:] = tool_position(plant)
    row.error[:] = out.error
    row.K_task[:] = controller.state.impedance.K_task
    row.D_task[:] = controller.state.impedance.D_task
    row.wrench_ee[:] = controller.measurement.wrench_ee
    row.residual[:] = out.residual
    row.residual_fast[:] = out.residual_fast
    row.mode, row.link = out.mode, out.link
    pad_force(plant, row.tool_force)
    row.obstacle_force = obstacle_force(plant)
    xpos = view2(plant.xpos, plant.nbody, 3)
    for index in range(plant.n_obstacles):
        row.obstacle_position[index, :] = xpos[plant.obstacle_bodies[index]]
    row.tau_arm[:] = view1(plant.qfrc_constraint, n)
    row.tau_arm[:] += push_torque_into(plant, stack_vector(n))
    row.tau_arm[:] -= matvec_t(controller.dynamics.J, _pad_wrench(plant, tool_position(plant)))


@compiled
def _pad_wrench(plant, position):
    """Wrench of the board on the pad about the tool point by the simulator, (6,)."""
    wrench = np.zeros(6)
    if plant.adr_pad_board < 0:
        return wrench
    data = view1(plant.sensordata, plant.nsensordata)
    adr = plant.adr_pad_board
    force, torque, place = data[adr + 1 : adr + 4], data[adr + 4 : adr + 7], data[adr + 7 : adr + 10]
    wrench[:3] = force
    wrench[3:] = torque + cross(place - position, force)
    return wrench
