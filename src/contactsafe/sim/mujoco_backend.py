"""MuJoCo as a backend: read what its plant does, write torques on its joints, step it; compiled, without the GIL."""

import math

import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross, matvec
from contactsafe.core.native import mj_jac, mj_kinematics, mj_step, view1, view2


@compiled(nogil=True)
def read(world: Record) -> None:
    """Fill the truth of a `world_dtype` record from MuJoCo's arrays.

    After a step positions and velocities are new, and sensors and frames are those of its beginning.
    """
    plant, truth = world.plant, world.truth
    n = truth.q.shape[0]
    truth.q[:], truth.qd[:] = view1(plant.qpos, n), view1(plant.qvel, n)
    truth.position[:] = view2(plant.site_xpos, plant.tcp_site + 1, 3)[plant.tcp_site]
    truth.rotation[:] = view2(plant.site_xmat, plant.tcp_site + 1, 9)[plant.tcp_site].reshape(3, 3)
    data = view1(plant.sensordata, plant.nsensordata)
    for k in range(3):
        truth.wrist_force[k] = data[plant.adr_wrist_force + k]
        truth.wrist_torque[k] = data[plant.adr_wrist_torque + k]
        truth.wrist_acceleration[k] = data[plant.adr_wrist_accelerometer + k]
    if plant.adr_base_force >= 0:
        for k in range(3):  # MuJoCo has what the base exerts on the arm, and a push as joint torques, which do not show
            truth.base_wrench[k] = world.pushed_wrench[k] - data[plant.adr_base_force + k]
            truth.base_wrench[3 + k] = world.pushed_wrench[3 + k] - data[plant.adr_base_torque + k]
    truth.tau_contact[:] = view1(plant.qfrc_constraint, n)
    _read_fixtures(plant, truth, data)
    xpos = view2(plant.xpos, plant.nbody, 3)
    for index in range(plant.n_obstacles):
        force = data[plant.adr_obstacles[index] + 1 :]
        truth.obstacle_force[index] = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
        truth.obstacle_position[index, :] = xpos[plant.obstacle_bodies[index]]


@compiled
def _read_fixtures(plant, truth, data):
    truth.tip_wrench[:] = 0.0
    truth.tip_contacts, truth.arm_contacts = 0.0, 0.0
    for index in range(plant.n_fixtures):
        truth.arm_contacts += data[plant.adr_arm[index]]
        adr = plant.adr_tip[index]
        if adr < 0 or data[adr] == 0.0:
            continue
        truth.tip_contacts += data[adr]
        force, torque, place = data[adr + 1 : adr + 4], data[adr + 4 : adr + 7], data[adr + 7 : adr + 10]
        truth.tip_wrench[:3] += force
        truth.tip_wrench[3:] += torque + cross(place - truth.position, force)


@compiled(nogil=True)
def write(world: Record) -> None:
    """Put the torques of motors, friction and a push on the joints; move the obstacles that travel."""
    plant = world.plant
    n = world.motor.shape[0]
    view1(plant.ctrl, n)[:] = world.motor
    applied = view1(plant.qfrc_applied, n)
    _push(world)
    for i in range(n):
        applied[i] = world.pushed[i] - world.drag[i]
    _move_obstacles(world)


@compiled
def _push(world):
    """Fill the joint torque of the push in force at this tick, and its wrench."""
    tau, fraction, wrench = world.pushed, world.push.fraction, world.pushed_wrench
    tau[:], wrench[:] = 0.0, 0.0
    if fraction == 0.0:
        return
    plant, push = world.plant, world.push
    R = view2(plant.xmat, plant.nbody, 9)[push.body].reshape(3, 3)
    point = view2(plant.xpos, plant.nbody, 3)[push.body] + matvec(R, push.point)
    J, unused = np.zeros((3, plant.nv)), np.zeros((3, plant.nv))
    mj_jac(plant.model, plant.data, J.ctypes, unused.ctypes, point.ctypes, push.body)
    for i in range(tau.shape[0]):
        for k in range(3):
            tau[i] += J[k, i] * push.force[k] * fraction
    wrench[:3] = fraction * push.force
    wrench[3:] = cross(point, wrench[:3])


@compiled
def _move_obstacles(world):
    """Move the springs' rest lengths of the obstacles that travel."""
    plant = world.plant
    rest = view1(plant.qpos_spring, plant.nq)
    for index in range(plant.n_obstacles):
        adr = plant.obstacle_springs[index]
        # Before the first step the sensor still reads what was before the reset.
        if world.tick > 0 and world.truth.obstacle_force[index] >= plant.obstacle_travel_n[index]:
            plant.obstacle_stopped[index] = 1
        if adr >= 0 and plant.obstacle_stopped[index] == 0:
            start, stop = plant.obstacle_travel_ticks[index]
            fraction = min(max((world.tick - start) / (stop - start), 0.0), 1.0)
            for k in range(3):
                rest[adr + k] = fraction * plant.obstacle_travel[index, k]


@compiled(nogil=True)
def mirror(world: Record) -> None:
    """Bring MuJoCo's geometry to where another backend has the arm, for pictures."""
    n = world.truth.q.shape[0]
    view1(world.plant.qpos, n)[:] = world.truth.q
    mj_kinematics(world.plant.model, world.plant.data)


@compiled(nogil=True)
def step(world: Record) -> None:
    """Advance by one tick."""
    mj_step(world.plant.model, world.plant.data)
