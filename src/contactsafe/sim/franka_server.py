"""A simulated Franka Research 3 that speaks the robot's own network protocol: franky-sim's arm in a scene of ours.

The protocol and the arm, its masses, meshes and stiction, are franky-sim's. Mended here: the joint torque that it
reports is measured behind the gears, friction and rotor inertia before the sensor, as a Franka's is; and most of that
friction is taken off by a torque loop, as a Franka's own does.
"""

import contextlib
import os
import select
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

import mujoco
import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.process import ignore_terminal
from contactsafe.robot.franka import HAND
from contactsafe.sim.franka_scene import OBSTACLE, TIP, FrankaScene, add_fixtures, add_obstacles, add_tip

ADDRESSES = tuple(f"127.0.0.{number}" for number in range(1, 33))
"""Of this machine alone, at which simulated robots listen."""

_TICK_S = 0.001
_BEHIND_S = 0.02  # more than this behind, it starts counting anew instead of catching up
_PATIENCE_S = 30.0  # for a command, in lockstep
_AGAIN_S = 0.2  # after so long without a first command a state is sent again: libfranka skips all but the newest
_FRICTION = int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)
_NICE = -10  # a robot's own computer waits for no program of this one; SCHED_FIFO is stopped where it takes it all
_UNTIL_ALONE = 100  # ticks between looks whether whoever began this still lives

truth_dtype = np.dtype(
    [
        ("time", float),  # s since the first command
        ("q", float, (7,)),  # rad
        ("qd", float, (7,)),  # rad/s
        ("position", float, (3,)),  # of the tool, m
        ("tip_n", float),  # force on the tip
        ("arm_n", float),  # force of obstacles on the arm
        ("pushed_n", float),  # force of a person
    ]
)
"""What really happened in a tick."""


class Effect(Protocol):
    """What the tool does to the scene."""

    def begin(self, model: mujoco.MjModel) -> None:
        """Prepare, in the server's process; the model is the scene's."""
        ...

    def after_step(self, tick: int, q: np.ndarray, position: np.ndarray, rotation: np.ndarray, force_n: float) -> None:
        """Take note of a tick: joint positions, pose of the tool point and force on its tip."""
        ...


class SimulatedFranka(Unique):
    """One robot and its scene.

    Args:
        scene: as given.
        home: joint positions to begin with, (7,), rad.
        effect: of the tool, or None.

    Attributes:
        address: of this machine, that it listens at: 127.0.0.1, or the next one where that is taken.
    """

    _why = "a simulated robot listens at one address; make another one"

    def __init__(self, scene: FrankaScene, home: np.ndarray, effect: Effect | None = None):
        try:
            import franky_sim
            from franky_sim.base_simulator import InnerRobotState
            from franky_sim.mujoco_simulator import MujocoSimulator
        except ImportError:
            raise InvalidInputError("franky-sim is not installed; install contactsafe[simulated]") from None
        self.scene, self.effect = scene, effect
        self._sim = sim = MujocoSimulator()
        sim.init()
        self._robot = sim.add_robot(initial_q=tuple(float(angle) for angle in home))
        hand = next(body for body in sim.worldbody.iter("body") if body.get("name") == "robot0_hand")
        add_tip(hand, scene, HAND.inertia.mass)
        add_fixtures(sim.worldbody, scene.fixtures)
        add_obstacles(sim.worldbody, scene.obstacles)
        self._server = franky_sim.SimulationServer(sim, hostname_candidates=ADDRESSES)
        try:
            self._server.init()
        except OSError as error:
            where = f"{ADDRESSES[0]} to {ADDRESSES[-1]}"
            raise InvalidInputError(f"nothing can listen at {where}: {error}; end other simulated robots") from None
        self._protocol = self._server.robot_servers[0]
        self.address = str(self._protocol.hostname)
        self.model, self.data = sim.model, sim.data
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # MuJoCo 4.0.0 errs with sparse ones
        self._q, self._dof = np.array(self._robot._qpos_addrs), np.array(self._robot._dof_addrs)
        self._armature = self.model.dof_armature[self._dof].copy()
        self._link_torque, self._drag = np.zeros(7), np.zeros(7)
        self._robot._get_state = lambda: InnerRobotState(
            q=tuple(self.data.qpos[self._q].tolist()),
            dq=tuple(self.data.qvel[self._dof].tolist()),
            tau_j=tuple(self._link_torque.tolist()),
        )
        self._home = self.data.qpos.copy()
        self._find_bodies()
        self._settle()
        self.ticks = 0
        self.begun = self._awaits_command = self._answers = False
        self._truth: list[np.ndarray] = []
        if effect is not None:
            effect.begin(self.model)

    def _find_bodies(self) -> None:
        model = self.model
        self._tip = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, TIP)
        self._hand = model.body("robot0_hand").id
        geoms = [model.geom(i).name for i in range(model.ngeom)]
        self._obstacles = {i for i, name in enumerate(geoms) if name.startswith(OBSTACLE)}
        self._links = [model.body(f"robot0_fr3_link{k}").id for k in range(1, 8)]
        self._tcp = np.array(self.scene.tool.tcp)
        self._rest = [
            [model.jnt_qposadr[model.joint(f"{OBSTACLE}{k}_{axis}").id] for axis in "xyz"]
            for k, one in enumerate(self.scene.obstacles)
            if not one.fixed
        ]

    def _settle(self) -> None:
        """Let the torque sensor show what holds the arm at home."""
        mujoco.mj_forward(self.model, self.data)
        self._link_torque[:] = self.data.qfrc_bias[self._dof]

    @property
    def is_controlled(self) -> bool:
        """Whether somebody commands its torques."""
        return self._protocol._FrankaRobotServer__control_mode.value == "torque"

    @property
    def _is_commanded(self) -> bool:
        return bool(self._protocol._FrankaRobotServer__has_new_command)

    def tick(self, lockstep: bool) -> None:
        """Take commands, advance by a millisecond, send the state; where in lockstep, wait for the command first."""
        protocol = self._protocol
        is_controlled = lockstep and self.is_controlled
        if is_controlled and self._awaits_command:
            patience = _PATIENCE_S if self._answers else _AGAIN_S
            select.select([protocol._FrankaServer__udp_socket, protocol._tcp_socket], [], [], patience)
        self._awaits_command = is_controlled
        protocol.process_commands()
        self._answers = self.is_controlled and (self._answers or self._is_commanded)
        if not self.begun:
            self.begun = self.is_controlled and self._is_commanded
            if not self.begun:
                self._freeze()
        if self.begun:
            self._touch()
            self._take_friction_off()
        self._sim.step()
        if self.begun:
            self._sense()
            self._note()
            self.ticks += 1
        protocol.send_state()

    def _freeze(self) -> None:
        """Stay as at the beginning until the first command; the torque sensor shows what `_settle` left."""
        data = self.data
        data.qpos[:], data.qvel[:], data.qacc_warmstart[:], data.qfrc_applied[:] = self._home, 0.0, 0.0, 0.0
        mujoco.mj_forward(self.model, data)

    def _touch(self) -> None:
        """Apply the pushes that are on."""
        seconds, data = self.ticks * _TICK_S, self.data
        data.xfrc_applied[:] = 0.0
        for push in self.scene.pushes:
            data.xfrc_applied[self._links[push.link - 1], :3] += push.at(seconds) * np.array(push.force)
        for address, one in zip(self._rest, self._springs(), strict=True):
            leaves, arrives = one.travel_s
            gone = min(max((seconds - leaves) / (arrives - leaves), 0.0), 1.0)
            self.model.qpos_spring[address] = gone * np.array(one.travel)

    def _take_friction_off(self) -> None:
        """Let the motors carry most of what dragged on them in the last step."""
        robot = self._robot
        helped = robot._applied_torques - (1.0 - self.scene.friction_left) * self._drag
        robot._applied_torques = np.clip(helped, robot.torque_limit_low, robot.torque_limit_high)
        self.data.qfrc_applied[self._dof] = robot._applied_torques

    def _springs(self) -> list[Any]:
        return [one for one in self.scene.obstacles if not one.fixed]

    def _sense(self) -> None:
        """Take the joint torque behind the gears: motor, less friction, less what the rotors take."""
        data, n = self.data, self.data.nefc
        dry = np.zeros(self.model.nv)
        is_dry = data.efc_type[:n] == _FRICTION
        dry[data.efc_id[:n][is_dry]] = data.efc_force[:n][is_dry]
        self._drag[:] = data.qfrc_passive[self._dof] + dry[self._dof]
        self._link_torque[:] = self._robot._applied_torques + self._drag - self._armature * data.qacc[self._dof]

    def _note(self) -> None:
        """Note what happened, and let the tool have its effect."""
        data, row = self.data, np.zeros((), truth_dtype)
        R = data.xmat[self._hand].reshape(3, 3)
        row["time"], row["q"], row["qd"] = self.ticks * _TICK_S, data.qpos[self._q], data.qvel[self._dof]
        row["position"] = data.xpos[self._hand] + R @ self._tcp
        row["tip_n"], row["arm_n"] = self._forces()
        row["pushed_n"] = np.linalg.norm(data.xfrc_applied[self._links, :3].sum(axis=0))
        self._truth.append(row)
        if self.effect is not None:
            self.effect.after_step(self.ticks, row["q"], row["position"], R, float(row["tip_n"]))

    def _forces(self) -> tuple[float, float]:
        """Return the forces on the tip and of obstacles on the arm, N."""
        data, wrench, tip, arm = self.data, np.zeros(6), np.zeros(3), 0.0
        for k in range(data.ncon):
            contact = data.contact[k]
            pair = {int(contact.geom1), int(contact.geom2)}
            on_tip, on_obstacle = self._tip in pair, bool(pair & self._obstacles)
            if not (on_tip or on_obstacle):
                continue
            mujoco.mj_contactForce(self.model, data, k, wrench)
            if on_obstacle:
                arm += float(np.linalg.norm(wrench[:3]))
            else:
                sign = -1.0 if contact.geom1 == self._tip else 1.0
                tip += sign * contact.frame.reshape(3, 3).T @ wrench[:3]
        return float(np.linalg.norm(tip)), arm

    def truth(self) -> np.ndarray:
        """Return what happened so far, `truth_dtype` records."""
        return np.array(self._truth, dtype=truth_dtype)

    def close(self) -> None:
        """Listen no more."""
        self._server.cleanup()


def serve(
    scene: FrankaScene, home: np.ndarray, lockstep: bool, effect: Effect | None, told: Connection, truth: Path | None
) -> None:
    """Be the robot of a run, in a process of its own, until told to end or nobody is left.

    Args:
        scene, home, effect: as `SimulatedFranka` takes them.
        lockstep: it waits for each command, and time is counted in ticks; otherwise it keeps to the clock.
        told: "ready" and its address, or what is wrong goes out; anything that comes in ends it.
        truth: file for what happened, .npy; None for none.
    """
    ignore_terminal()
    parent = os.getppid()
    try:
        robot = SimulatedFranka(scene, home, effect=effect)
    except InvalidInputError as error:
        told.send(str(error))
        return
    told.send(f"ready {robot.address}")
    if not lockstep:
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, _NICE)
    due, turns = time.perf_counter(), 0
    while True:
        robot.tick(lockstep)
        turns += 1
        if turns % _UNTIL_ALONE == 0 and (told.poll() or os.getppid() != parent):
            break
        if lockstep and robot.is_controlled:
            continue
        due += _TICK_S
        left = due - time.perf_counter()
        if left > 0.0:
            time.sleep(left)
        elif left < -_BEHIND_S:
            due = time.perf_counter()
    if truth is not None:
        np.save(truth, robot.truth())
    robot.close()
    os._exit(0)  # franky-sim's threads do not end by themselves
