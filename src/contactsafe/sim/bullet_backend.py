"""PyBullet as a backend: the same arm from the same description through the URDF, physics by another engine.

Bullet knows no rotor inertia at a joint, so the rotors are there themselves: small flywheels on the link before each
joint, geared to it so high that they hardly feel the link's own turning. A motor's torque then accelerates the arm as
in the MJCF to 0.4 %; gravity and the links' inertia are the MJCF's to 1e-9.
"""

import weakref
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.files import readable
from contactsafe.core.rotation import quat_multiply, quat_to_matrix
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.description import ArmDescription, Tool
from contactsafe.robot.mjcf import TOOL_SITE, numbers
from contactsafe.robot.urdf import BASE_LINK, TIP_LINK, arm_urdf
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant, loaded, perturbed

GEAR = 1000.0
"""Turns of a rotor for one of its joint."""

_ROTOR_KG = 1e-6  # the links' masses of Gaz et al. contain the motors

# Of each corner of the tip: MuJoCo's felt was measured at 4.8 kN/m; its damping ratio of 0.4, of the 7 kg of the arm's
# inertia along a table's normal, is 0.4 · 2 √(4 · 4800 · 7) / 4.
_TIP_N_M, _TIP_NS_M = 4800.0, 73.0

_ITERATIONS = 20  # of the solver: against 400, a stroke at 10 N differs by 1 µm and 0.05 N at most


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
    """Write the arm for Bullet: the project's URDF, with rotors as links and the tip as a link of its own.

    Args:
        description: the arm.
        tool: what its flange carries.

    Returns:
        XML text. Beyond those of `arm_urdf`: links `rotor1` … on joints `rotor_joint1` … where there is a rotor,
        massless but for what `BulletBackend` gives them, and `tip`, fixed to the tool.
    """
    robot = ET.fromstring(arm_urdf(description, replace(tool, tip=None)))
    for link in robot.iter("link"):
        if link.get("name") in (BASE_LINK, TIP_LINK):
            _inertial(link, 0.0)  # left out, Bullet would take 1 kg
    origins = {joint.get("name"): joint.find("origin") for joint in robot.iter("joint")}
    for index, inertia in enumerate(description.joint_array("armature"), start=1):
        if inertia == 0.0:
            continue
        _inertial(ET.SubElement(robot, "link", name=f"rotor{index}"), _ROTOR_KG)
        rotor = ET.SubElement(robot, "joint", name=f"rotor_joint{index}", type="continuous")
        _connect(rotor, origins[f"joint{index}"], f"link{index - 1}", f"rotor{index}")
        ET.SubElement(rotor, "axis", xyz="0 0 1")
    if tool.tip is not None:
        half_size = tool.tip.half_size
        tip = ET.SubElement(robot, "link", name="tip")
        _inertial(tip, 0.0)  # it is part of the tool's
        collision = ET.SubElement(tip, "collision")
        centre = (tool.tcp[0], tool.tcp[1], tool.tcp[2] - half_size[2])
        ET.SubElement(collision, "origin", xyz=numbers(centre), rpy="0 0 0")
        shape = ET.SubElement(collision, "geometry")
        if tool.tip.shape == "box":
            ET.SubElement(shape, "box", size=numbers(2 * half for half in half_size))
        else:
            ET.SubElement(shape, "cylinder", radius=numbers([half_size[0]]), length=numbers([2 * half_size[2]]))
        here = ET.Element("origin", xyz="0 0 0", rpy="0 0 0")
        _connect(ET.SubElement(robot, "joint", name="tip_mount", type="fixed"), here, "tool", "tip")
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


class BulletBackend(Unique):
    """Arm and fixtures in a PyBullet client of their own; see `contactsafe.sim.backend`.

    Args:
        arm: with a description and a tool.
        config: plant errors, fixtures; obstacles are not built.
        tick_s: time step, s.

    Raises:
        InvalidInputError: pybullet is not installed, the arm has no description, or obstacles are asked for.
    """

    _why = (
        "worlds in PyBullet cannot be copied or pickled, they live in a client of their own; make them where they are "
        "to run, or take the MuJoCo engine"
    )

    def __init__(self, arm: Arm, config: WorldConfig, tick_s: float):
        self._bullet = import_pybullet()
        description, tool = description_and_tool(arm)
        if config.obstacles:
            raise InvalidInputError(
                f"{len(config.obstacles)} obstacles asked for; the PyBullet engine has none, take the MuJoCo engine"
            )
        if config.sensors.base:
            raise InvalidInputError(
                "a sensor under the base is asked for; the PyBullet engine has none, take the MuJoCo engine"
            )
        self._config, self._tick_s, self._n = config, tick_s, arm.n
        self._tcp, self._gravity = np.array(tool.tcp), arm.model.opt.gravity.tolist()
        self._description = perturbed(description, config.plant)
        self._urdf = bullet_urdf(self._description, loaded(tool, config.plant))
        # MuJoCo's copy of the arm says where its points are and what Jacobians they have.
        self._model = build_plant(arm, config)
        self._data = mujoco.MjData(self._model)
        self._first_body = self._model.body("link1").id - 1
        self._client = self._bullet.connect(self._bullet.DIRECT)
        # Ends it once, for PyBullet gives the number of a client that has ended to the next.
        self.close = weakref.finalize(self, _disconnect, self._bullet, self._client)
        self._torque = np.zeros(arm.n)
        self.reset(arm.home)

    def reset(self, q: np.ndarray) -> None:
        """Put the arm at rest at q (n,) rad, in a world built anew."""
        bullet, client = self._bullet, self._client
        bullet.resetSimulation(physicsClientId=client)
        bullet.setGravity(*self._gravity, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self._tick_s, numSolverIterations=_ITERATIONS, solverResidualThreshold=0.0,
            deterministicOverlappingPairs=1, physicsClientId=client,
        )  # fmt: skip
        self._build_arm()
        self._build_fixtures()
        for joint, angle in zip(self._joints, q, strict=True):
            bullet.resetJointState(self._arm, joint, float(angle), 0.0, physicsClientId=client)
        for rotor in self._rotors:
            bullet.resetJointState(self._arm, rotor, 0.0, 0.0, physicsClientId=client)

    def read(self, world: np.void) -> None:
        """Fill the truth of a `world_dtype` record; its wrist sensor is one that has no weight to carry."""
        truth, states = world["truth"], self._bullet.getJointStates(self._arm, self._joints, self._client)
        truth["q"], truth["qd"] = [state[0] for state in states], [state[1] for state in states]
        self._place(truth["q"])
        site = self._data.site(TOOL_SITE)
        truth["position"], R = site.xpos, site.xmat.reshape(3, 3)
        truth["rotation"] = R
        on_tool, on_tip, torque, tip_contacts, contacts = np.zeros(6), np.zeros(6), np.zeros(self._n), 0, 0
        for link, is_tip, point, force in self._contacts():
            torque += self._jacobian(self._first_body + link, point).T @ force
            wrench = np.concatenate([force, np.cross(point - truth["position"], force)])
            on_tool += wrench if link == self._n + 1 else 0.0
            on_tip += wrench if is_tip else 0.0
            tip_contacts, contacts = tip_contacts + is_tip, contacts + 1
        truth["tau_contact"], truth["tip_wrench"] = torque, on_tip
        truth["tip_contacts"], truth["arm_contacts"] = tip_contacts, contacts
        force, moment = R.T @ on_tool[:3], R.T @ on_tool[3:]
        truth["wrist_force"], truth["wrist_torque"] = -force, -(moment + np.cross(self._tcp, force))

    def write(self, world: np.void) -> None:
        """Take motors, friction and push as joint torques."""
        push = world["push"]
        world["pushed"] = 0.0
        if push["fraction"] > 0.0:
            body = int(push["body"])
            R = self._data.xmat[body].reshape(3, 3)
            J = self._jacobian(body, self._data.xpos[body] + R @ push["point"])
            world["pushed"] = push["fraction"] * (J.T @ push["force"])
        self._torque[:] = world["motor"] + (world["pushed"] - world["drag"])

    def step(self) -> None:
        """Run one tick."""
        bullet, client = self._bullet, self._client
        bullet.setJointMotorControlArray(
            self._arm, self._joints, bullet.TORQUE_CONTROL, forces=self._torque.tolist(), physicsClientId=client
        )
        bullet.stepSimulation(physicsClientId=client)

    def place_fixture(self, name: str, position: np.ndarray, quat: np.ndarray) -> None:
        """Put a fixture elsewhere, from the next reset on."""
        fixtures = [
            replace(fixture, position=tuple(position.tolist()), quat=tuple(quat.tolist()))
            if fixture.name == name
            else fixture
            for fixture in self._config.fixtures
        ]
        self._config = replace(self._config, fixtures=tuple(fixtures))

    def set_tip_friction(self, friction: float) -> None:
        """Give the tool's tip another Coulomb coefficient, from the next reset on."""
        self._config = replace(self._config, tip=replace(self._config.tip, friction=friction))

    def _place(self, q) -> None:
        self._data.qpos[: self._n] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def _jacobian(self, body: int, point) -> np.ndarray:
        J = np.zeros((3, self._model.nv))
        mujoco.mj_jac(self._model, self._data, J, None, np.ascontiguousarray(point, dtype=float), body)
        return J[:, : self._n]

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
        geared = [i for i in names if f"rotor_joint{i}" in joints]
        self._rotors = [joints[f"rotor_joint{i}"] for i in geared]
        moving = sorted(self._joints + self._rotors)
        zeros = [0.0] * len(moving)
        bullet.setJointMotorControlArray(arm, moving, bullet.VELOCITY_CONTROL, forces=zeros, physicsClientId=client)
        for i, rotor in zip(geared, self._rotors, strict=True):
            joint, inertia = self._joints[i - 1], self._description.links[i - 1].joint.armature
            # Bullet's reader takes so small an inertia for none, so it is given here.
            bullet.changeDynamics(
                arm, rotor, mass=_ROTOR_KG, localInertiaDiagonal=[inertia / GEAR**2] * 3, physicsClientId=client
            )
            gear = bullet.createConstraint(
                arm, joint, arm, rotor, bullet.JOINT_GEAR, [0, 0, 1], [0, 0, 0], [0, 0, 0], physicsClientId=client
            )
            bullet.changeConstraint(gear, gearRatio=-1.0 / GEAR, maxForce=1e9, erp=0.0, physicsClientId=client)
        # Number of the link that each of Bullet's is part of: 1 … n of the arm, n + 1 the tool with its tip.
        self._owner = {self._links[f"link{i}"]: i for i in names} | {
            self._links[name]: self._n + 1 for name in ("tool", "tip") if name in self._links
        }
        self._tip = self._links.get("tip", -2)
        if self._tip >= 0:
            bullet.changeDynamics(
                arm, self._tip, contactStiffness=_TIP_N_M, contactDamping=_TIP_NS_M, lateralFriction=1.0,
                physicsClientId=client,
            )  # fmt: skip

    def _build_fixtures(self) -> None:
        for fixture in self._config.fixtures:
            R = quat_to_matrix(np.array(fixture.quat))
            for box in fixture.boxes:
                quat = quat_multiply(np.array(fixture.quat), np.array(box.quat))
                body = self._box(np.array(fixture.position) + R @ np.array(box.centre), box.half_size, quat)
                for link in (-1, self._links["link0"]):  # the base stands on the table
                    self._bullet.setCollisionFilterPair(self._arm, body, link, -1, 0, physicsClientId=self._client)

    def _box(self, centre, half_size, quat) -> int:
        bullet, client = self._bullet, self._client
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=list(half_size), physicsClientId=client)
        w, x, y, z = quat
        body = bullet.createMultiBody(
            0.0, shape, basePosition=list(centre), baseOrientation=[x, y, z, w], physicsClientId=client
        )
        # Bullet multiplies the coefficients of the two that touch.
        bullet.changeDynamics(body, -1, lateralFriction=self._config.tip.friction, physicsClientId=client)
        return int(body)

    def _contacts(self) -> Iterator[tuple[int, bool, np.ndarray, np.ndarray]]:
        """Iterate over the points that press on the arm: link, whether it is the tip, point, m, force on the arm, N.

        Bullet also lists those that nearly touch.
        """
        for found in self._bullet.getContactPoints(bodyA=self._arm, physicsClientId=self._client):
            normal_n, owner = found[9], self._owner.get(found[3], 0)
            if normal_n > 0.0 and owner > 0:
                force = (
                    normal_n * np.array(found[7]) + found[10] * np.array(found[11]) + found[12] * np.array(found[13])
                )
                yield owner, found[3] == self._tip, np.array(found[5]), force


def _disconnect(bullet: Any, client: int) -> None:
    if bullet.isConnected(client):
        bullet.disconnect(client)
