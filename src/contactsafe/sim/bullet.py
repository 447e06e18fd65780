"""One arm before one whiteboard in PyBullet: a second engine, from the same description through the URDF.

Bullet knows no rotor inertia at a joint, so the rotors are there themselves: small flywheels on the link before each
joint, geared to it so high that they hardly feel the link's own turning. A motor's torque then accelerates the arm as
in the MJCF to 0.4 %; gravity and the links' inertia are the MJCF's to 1e-9.
"""

import weakref
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.files import readable
from contactsafe.robot.arm import Arm
from contactsafe.robot.description import ArmDescription, Tool
from contactsafe.robot.mjcf import numbers
from contactsafe.robot.urdf import BASE_LINK, TIP_LINK, arm_urdf
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import BOARD_HALF_THICKNESS, TABLE_HALF_SIZE, loaded, perturbed

GEAR = 1000.0
"""Turns of a rotor for one of its joint."""

_ROTOR_KG = 1e-6  # the links' masses of Gaz et al. contain the motors

# Of each corner of the pad: MuJoCo's was measured at 4.8 kN/m; its damping ratio of 0.4, of the 7 kg that the arm
# weighs along the board's normal, is 0.4 · 2 √(4 · 4800 · 7) / 4.
_PAD_N_M, _PAD_NS_M = 4800.0, 73.0

_ITERATIONS = 20  # of the solver: against 400, wiping at 10 N differs by 1 µm and 0.05 N at most

MAX_CONTACTS = 32

contact_dtype = np.dtype(
    [
        ("link", np.int64),  # 1 … n of the arm, n + 1 the tool with its pad
        ("pad", np.int64),  # 1 where it is the pad that touches
        ("table", np.int64),  # 1 for the table, 0 for the board
        ("point", np.float64, (3,)),  # world, m
        ("force", np.float64, (3,)),  # on the arm, world, N
    ]
)
"""One point at which something presses on the arm."""


def import_pybullet() -> Any:
    """Import pybullet.

    Raises:
        InvalidInputError: it is not installed.
    """
    try:
        import pybullet
    except ImportError:
        raise InvalidInputError(
            "the second engine needs pybullet, which is not installed; run: pip install 'contactsafe[pybullet]'"
        ) from None
    return pybullet


def bullet_urdf(description: ArmDescription, tool: Tool) -> str:
    """Write the arm for Bullet: the project's URDF, with rotors as links and the pad as a link of its own.

    Args:
        description: the arm.
        tool: what its flange carries.

    Returns:
        XML text. Beyond those of `arm_urdf`: links `rotor1` … on joints `rotor_joint1` …, massless but for what
        `BulletPlant` gives them, and `pad`, fixed to the tool.
    """
    robot = ET.fromstring(arm_urdf(description, replace(tool, pad_half_size=None)))
    for link in robot.iter("link"):
        if link.get("name") in (BASE_LINK, TIP_LINK):
            _inertial(link, 0.0)  # left out, Bullet would take 1 kg
    origins = {joint.get("name"): joint.find("origin") for joint in robot.iter("joint")}
    for index in range(1, len(description.links) + 1):
        _inertial(ET.SubElement(robot, "link", name=f"rotor{index}"), _ROTOR_KG)
        rotor = ET.SubElement(robot, "joint", name=f"rotor_joint{index}", type="continuous")
        _connect(rotor, origins[f"joint{index}"], f"link{index - 1}", f"rotor{index}")
        ET.SubElement(rotor, "axis", xyz="0 0 1")
    if tool.pad_half_size is not None:
        pad = ET.SubElement(robot, "link", name="pad")
        _inertial(pad, 0.0)  # it is part of the tool's
        collision = ET.SubElement(pad, "collision")
        centre = (tool.tcp[0], tool.tcp[1], tool.tcp[2] - tool.pad_half_size[2])
        ET.SubElement(collision, "origin", xyz=numbers(centre), rpy="0 0 0")
        shape = ET.SubElement(collision, "geometry")
        ET.SubElement(shape, "box", size=numbers(2 * half for half in tool.pad_half_size))
        here = ET.Element("origin", xyz="0 0 0", rpy="0 0 0")
        _connect(ET.SubElement(robot, "joint", name="pad_mount", type="fixed"), here, "tool", "pad")
    return ET.tostring(robot, encoding="unicode")


def _inertial(link: ET.Element, mass: float) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", value=numbers([mass]))
    ET.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0"))


def _connect(joint: ET.Element, origin: ET.Element | None, parent: str, child: str) -> None:
    if origin is not None:
        joint.append(origin)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)


class BulletPlant(Unique):
    """Arm, table and board in a PyBullet client of their own.

    Args:
        arm: built from a description, with a tool.
        config: plant errors, board; obstacles are not built.
        tick_s: time step, s.

    Attributes:
        q, qd: joint positions and velocities, (n,), rad and rad/s.
        close: call it to end the client.
        contacts: array of `contact_dtype` records, of which the first `n_contacts` are in force.

    Raises:
        InvalidInputError: pybullet is not installed, the arm has no description, or obstacles are asked for.
    """

    _why = (
        "worlds in PyBullet cannot be copied or pickled, they live in a client of their own; make them where they are "
        "to run, or take the MuJoCo engine"
    )

    def __init__(self, arm: Arm, config: WorldConfig, tick_s: float):
        self._bullet = import_pybullet()
        if arm.description is None or arm.tool is None:
            raise InvalidInputError(
                f"arm '{arm.name}' has no description to build a plant from; give contactsafe.robots.panda()"
            )
        if config.obstacles:
            raise InvalidInputError(
                f"{len(config.obstacles)} obstacles asked for; the PyBullet engine has none, take the MuJoCo engine"
            )
        self._config, self._tick_s, self._n = config, tick_s, arm.n
        self._facts = perturbed(arm.description, config.plant)
        self._urdf = bullet_urdf(self._facts, loaded(arm.tool, config.plant))
        self._client = self._bullet.connect(self._bullet.DIRECT)
        # Ends it once, for PyBullet gives the number of a client that has ended to the next.
        self.close = weakref.finalize(self, _disconnect, self._bullet, self._client)
        self.q, self.qd = np.zeros(arm.n), np.zeros(arm.n)
        self.contacts, self.n_contacts = np.zeros(MAX_CONTACTS, dtype=contact_dtype), 0
        self.reset(arm.home)

    def reset(self, q) -> None:
        """Put the arm at rest at q (n,) rad, in a world built anew: nothing of what was before is left."""
        bullet, client = self._bullet, self._client
        bullet.resetSimulation(physicsClientId=client)
        bullet.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self._tick_s, numSolverIterations=_ITERATIONS, solverResidualThreshold=0.0,
            deterministicOverlappingPairs=1, physicsClientId=client,
        )  # fmt: skip
        self._build_arm()
        self._build_table()
        for joint, rotor, angle in zip(self._joints, self._rotors, q, strict=True):
            bullet.resetJointState(self._arm, joint, float(angle), 0.0, physicsClientId=client)
            bullet.resetJointState(self._arm, rotor, 0.0, 0.0, physicsClientId=client)
        self.q[:], self.qd[:], self.n_contacts = q, 0.0, 0

    def step(self, tau) -> None:
        """Run one tick under joint torques tau (n,), N m."""
        bullet, client = self._bullet, self._client
        bullet.setJointMotorControlArray(
            self._arm, self._joints, bullet.TORQUE_CONTROL, forces=tau.tolist(), physicsClientId=client
        )
        bullet.stepSimulation(physicsClientId=client)
        states = bullet.getJointStates(self._arm, self._joints, physicsClientId=client)
        self.q[:] = [state[0] for state in states]
        self.qd[:] = [state[1] for state in states]
        self._read_contacts()

    def _build_arm(self) -> None:
        bullet, client = self._bullet, self._client
        with readable("arm.urdf", self._urdf) as path:
            flags = bullet.URDF_USE_INERTIA_FROM_FILE
            self._arm = arm = bullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
        infos = [bullet.getJointInfo(arm, i, physicsClientId=client) for i in range(bullet.getNumJoints(arm, client))]
        joints, self._links = ({info[k].decode(): info[0] for info in infos} for k in (1, 12))
        for index in (-1, *joints.values()):
            bullet.changeDynamics(
                arm, index, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, maxJointVelocity=1e6,
                physicsClientId=client,
            )  # fmt: skip
        names = range(1, self._n + 1)
        self._joints = [joints[f"joint{i}"] for i in names]
        self._rotors = [joints[f"rotor_joint{i}"] for i in names]
        moving = sorted(self._joints + self._rotors)
        zeros = [0.0] * len(moving)
        bullet.setJointMotorControlArray(arm, moving, bullet.VELOCITY_CONTROL, forces=zeros, physicsClientId=client)
        for joint, rotor, inertia in zip(self._joints, self._rotors, self._facts.joint_array("armature"), strict=True):
            # Bullet's reader takes so small an inertia for none, so it is given here.
            bullet.changeDynamics(
                arm, rotor, mass=_ROTOR_KG, localInertiaDiagonal=[inertia / GEAR**2] * 3, physicsClientId=client
            )
            gear = bullet.createConstraint(
                arm, joint, arm, rotor, bullet.JOINT_GEAR, [0, 0, 1], [0, 0, 0], [0, 0, 0], physicsClientId=client
            )
            bullet.changeConstraint(gear, gearRatio=-1.0 / GEAR, maxForce=1e9, erp=0.0, physicsClientId=client)
        # Numbers of `contact_dtype`: of every link that may touch, and which of them is the pad.
        self._owner = {self._links[f"link{i}"]: i for i in names} | {
            self._links[name]: self._n + 1 for name in ("tool", "pad") if name in self._links
        }
        self._pad = self._links.get("pad", -2)
        if self._pad >= 0:
            bullet.changeDynamics(
                arm, self._pad, contactStiffness=_PAD_N_M, contactDamping=_PAD_NS_M, lateralFriction=1.0,
                physicsClientId=client,
            )  # fmt: skip

    def _build_table(self) -> None:
        board = self._config.board
        x, y, z = board.centre
        board_half = (board.size[0] / 2, board.size[1] / 2, BOARD_HALF_THICKNESS)
        self._table = self._box((x, 0.0, z - (2 * BOARD_HALF_THICKNESS + TABLE_HALF_SIZE[2])), TABLE_HALF_SIZE)
        self._board = self._box((x, y, z - BOARD_HALF_THICKNESS), board_half)
        for link in (-1, self._links["link0"]):  # the base stands on the table
            for body in (self._table, self._board):
                self._bullet.setCollisionFilterPair(self._arm, body, link, -1, 0, physicsClientId=self._client)

    def _box(self, centre, half_size) -> int:
        bullet, client = self._bullet, self._client
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=list(half_size), physicsClientId=client)
        body = bullet.createMultiBody(0.0, shape, basePosition=list(centre), physicsClientId=client)
        # Bullet multiplies the coefficients of the two that touch.
        bullet.changeDynamics(body, -1, lateralFriction=self._config.board.friction, physicsClientId=client)
        return int(body)

    def _read_contacts(self) -> None:
        """Collect the points that press on the arm; Bullet also lists those that nearly touch."""
        count = 0
        for point in self._bullet.getContactPoints(bodyA=self._arm, physicsClientId=self._client):
            normal_n, owner = point[9], self._owner.get(point[3], 0)
            if normal_n <= 0.0 or owner == 0 or count == MAX_CONTACTS:
                continue
            force = normal_n * np.array(point[7]) + point[10] * np.array(point[11]) + point[12] * np.array(point[13])
            row = (owner, point[3] == self._pad, point[2] == self._table, point[5], force)
            self.contacts[count] = row
            count += 1
        self.n_contacts = count


def _disconnect(bullet: Any, client: int) -> None:
    if bullet.isConnected(client):
        bullet.disconnect(client)
