"""Worlds whose physics is PyBullet's: sensing, control, ink and camera are those of `Worlds`, compiled.

The records of `Worlds` point into MuJoCo's arrays. Here MuJoCo computes no motion: before each tick those arrays say
what Bullet's arm did, in the words of MuJoCo's sensors, so that all that reads them is the same code for both engines.
"""

from collections.abc import Sequence

import numpy as np

from contactsafe.control.config import ControllerConfig
from contactsafe.control.tick import control_tick
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross, matvec_t
from contactsafe.core.native import mj_comPos, mj_jac, mj_kinematics, view1
from contactsafe.robot.arm import Arm
from contactsafe.sim.bullet import BulletPlant
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.stepping import act, begin_step_metrics, end_tick, sense, tool_position, tool_rotation
from contactsafe.sim.world import TICK_S, Worlds


class BulletWorlds(Worlds):
    """N independent worlds in PyBullet, stepped one after the other: Python holds the GIL between its calls.

    Arguments, attributes and methods are those of `Worlds`, but for obstacles, which it refuses.

    Raises:
        InvalidInputError: pybullet is not installed, or obstacles are asked for.
    """

    def __init__(
        self,
        arm: Arm,
        world: WorldConfig | Sequence[WorldConfig] | None = None,
        controller: ControllerConfig | None = None,
        n: int = 1,
        seed: int | Sequence[int] | None = None,
    ):
        super().__init__(arm, world, controller, n, seed)
        self.bullets = [BulletPlant(arm, config, TICK_S) for config in self.configs]
        first_link = self.models[0].body("link1").id
        self._bodies = np.arange(first_link - 1, first_link + arm.n + 1)
        self._torque = np.zeros(arm.n)

    def reset(self, i: int, q) -> None:
        """Put world i's arm at rest at q (n,) rad, with a new sensor bias; the board stays as it is."""
        super().reset(i, q)
        self.bullets[i].reset(self.arm.joint_vector(q, "q"))
        _take_over_at(self.plants, i, *self._seen(i))

    def close(self) -> None:
        """Stop the threads and end the clients."""
        super().close()
        for bullet in self.bullets:
            bullet.close()

    def run(self, ticks, trace: np.ndarray | None = None) -> None:
        """Run control ticks in every world; see `Worlds.run`."""
        ticks = self._checked(ticks, trace)
        noise = self.sample_noise()
        traces = self.no_trace if trace is None else trace
        for i, bullet in enumerate(self.bullets):
            _begin(self.reports, i, ticks[i])
            for k in range(ticks[i]):
                _command(self.plants, self.controllers, noise, i, k, self._torque)
                bullet.step(self._torque)
                _end(self.plants, self.controllers, self.cells, self.reports, traces, i, k, *self._seen(i))
        self.reports["tool_force_mean"] /= ticks

    def _seen(self, i: int) -> tuple:
        """Where compiled code finds what Bullet's world i says."""
        bullet = self.bullets[i]
        return bullet.q, bullet.qd, bullet.contacts, bullet.n_contacts, self._bodies


@compiled(nogil=True)
def _begin(reports, i, ticks):
    begin_step_metrics(reports[i], ticks)


@compiled(nogil=True)
def _command(plants, controllers, noise, i, k, tau):
    """Sense, control, act: fill the torque on the joints of world i, tau (n,), N m, friction and pushes included."""
    plant = plants[i]
    sense(plant, controllers[i], noise[i, k])
    control_tick(controllers[i])
    act(plant, controllers[i], noise[i, k])
    n = tau.shape[0]
    tau[:] = view1(plant.ctrl, n)
    tau += view1(plant.qfrc_applied, n)


@compiled(nogil=True)
def _end(plants, controllers, cells, reports, traces, i, k, q, qd, contacts, n_contacts, bodies):
    take_over(plants[i], q, qd, contacts, n_contacts, bodies)
    end_tick(plants[i], controllers[i], cells[i], reports[i], traces[i], k)


@compiled(nogil=True)
def _take_over_at(plants, i, q, qd, contacts, n_contacts, bodies):
    take_over(plants[i], q, qd, contacts, n_contacts, bodies)


@compiled
def take_over(plant, q, qd, contacts, n_contacts, bodies):
    """Write what another engine says into the arrays that a plant record points to.

    The wrist sensor is written as one that has no weight to carry: what `sense` then takes out is nothing but its
    inertial unit's noise.

    Args:
        plant: `plant_dtype` record.
        q, qd: (n,), rad and rad/s.
        contacts: `contact_dtype` records.
        n_contacts: how many of them are in force.
        bodies: number of MuJoCo's body for each link, 0 the base, n + 1 the tool, (n + 2,).
    """
    n = q.shape[0]
    view1(plant.qpos, n)[:] = q
    view1(plant.qvel, n)[:] = qd
    mj_kinematics(plant.model, plant.data)
    mj_comPos(plant.model, plant.data)
    data = view1(plant.sensordata, plant.nsensordata)
    data[:] = 0.0
    torque = view1(plant.qfrc_constraint, n)
    torque[:] = 0.0
    tool, on_tool, on_pad = tool_position(plant), np.zeros(6), np.zeros(6)
    J, turning = np.zeros((3, plant.nv)), np.zeros((3, plant.nv))
    for c in range(n_contacts):
        contact = contacts[c]
        point, force = contact.point.copy(), contact.force
        mj_jac(plant.model, plant.data, J.ctypes, turning.ctypes, point.ctypes, bodies[contact.link])
        for i in range(n):
            for k in range(3):
                torque[i] += J[k, i] * force[k]
        data[plant.adr_arm_table if contact.table else plant.adr_arm_board] += 1.0
        moment = cross(point - tool, force)
        if contact.link == n + 1:
            on_tool[:3] += force
            on_tool[3:] += moment
        if contact.pad:
            data[plant.adr_pad_table if contact.table else plant.adr_pad_board] += 1.0
            on_pad[:3] += force
            on_pad[3:] += moment
    if plant.adr_pad_board >= 0:
        # `pad_force` adds up board and table, so all of it may stand with the board's.
        data[plant.adr_pad_board + 1 : plant.adr_pad_board + 7] = on_pad
        data[plant.adr_pad_board + 7 : plant.adr_pad_board + 10] = tool
    R = tool_rotation(plant)
    force, moment = matvec_t(R, on_tool[:3]), matvec_t(R, on_tool[3:])
    about_flange = moment + cross(plant.tcp, force)
    for k in range(3):
        data[plant.adr_wrist_force + k] = -force[k]
        data[plant.adr_wrist_torque + k] = -about_flange[k]
