"""Robots of the simulator with errors that were planted, moved on a trajectory and logged as real ones are."""

import mujoco
import numpy as np

from contactsafe.logs.log import Log


def logged(arm, trajectory, plant=None, friction=None, torque_bias=0.0, command_bias=0.0, noise=1.0, every=1):
    """Move an arm along a trajectory of 1 kHz by computed torque and log it.

    Args:
        arm: that the controller believes in.
        trajectory: of `excitation`.
        plant: model of the real one; None for the arm's own.
        friction: torque that is lost at the joints, of their velocity; None for none.
        torque_bias: that the sensors behind the gears show beside the torque, N m.
        command_bias: that is lost of every command, N m.
        noise: of sensors, as a multiple of a good robot's.
        every: tick that is logged.
    """
    model, rng, n = plant or arm.model, np.random.default_rng(1), arm.n
    data, rows = mujoco.MjData(model), []
    data.qpos[:] = trajectory.q[0]
    inertia = np.zeros((n, n))
    acceleration = np.gradient(trajectory.qd, 0.001, axis=0)
    before = np.zeros(n)
    for tick, (q, qd, qdd) in enumerate(zip(trajectory.q, trajectory.qd, acceleration, strict=True)):
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia)
        wanted = qdd + 400.0 * (q - data.qpos) + 40.0 * (qd - data.qvel)
        command = inertia @ wanted + data.qfrc_bias
        lost = 0.0 if friction is None else friction(data.qvel)
        data.qfrc_applied[:] = command - lost - command_bias
        state = data.qpos.copy(), data.qvel.copy()
        mujoco.mj_step(model, data)
        shown = data.qfrc_applied - model.dof_armature * (data.qvel - state[1]) / 0.001 + torque_bias
        before = shown
        if tick % every == 0:
            rows.append((0.001 * tick, *state, before, command))
    time, q, qd, torque, command = (np.array(values) for values in zip(*rows, strict=True))
    q, qd = q + 1e-6 * noise * rng.normal(size=q.shape), qd + 1e-3 * noise * rng.normal(size=q.shape)
    torque = torque + 0.05 * noise * rng.normal(size=q.shape)
    return Log("a log", time, q, qd, torque, command)
