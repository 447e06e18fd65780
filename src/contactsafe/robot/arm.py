"""An arm as the controller knows it: a nominal model, its limits, its tool."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import matrix_to_quat, quat_to_matrix
from contactsafe.robot.binding import Binding, bind_joints
from contactsafe.robot.description import ArmDescription, Tool
from contactsafe.robot.dynamics import dynamics_dtype, forward_kinematics, update_dynamics
from contactsafe.robot.mjcf import TOOL_SITE, arm_mjcf
from contactsafe.robot.nominal import Frame, NominalModel
from contactsafe.robot.soundness import array_of, as_numbers, refuse_unsound
from contactsafe.robot.surface import SURFACE_COLUMNS, capsule_surface
from contactsafe.robot.touchable import capsule_places, touchable
from contactsafe.robot.wrist import WristNames


class Pose(NamedTuple):
    """Where a frame is, in world axes.

    Attributes:
        position: (3,), m.
        quat: unit quaternion w x y z, (4,).
    """

    position: np.ndarray
    quat: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Arm(Independent):
    """A serial torque-controlled arm with its tool.

    Attributes:
        name: of the robot.
        model: nominal MuJoCo model of the arm alone; rotor inertia included.
        site: end-effector point in `model`.
        q_min, q_max: joint range, (n,), rad; ±inf where a joint turns without end.
        qd_max: joint speed limits, (n,), rad/s; inf where unknown.
        tau_max: joint torque limits, (n,), N m.
        torque_rate_max: N m/s, every joint; 1e9 allows any torque at once.
        friction: φ1, φ2, φ3 of every joint, (n, 3); zeros where unknown.
        home: a posture well inside the limits, (n,), rad.
        drag: viscous friction N m s/rad, constant torque N m and dry friction N m beside `friction`, (n, 3).
        friction_unknown: friction that the model does not know, viscous N m s/rad and dry N m, (n, 2): detection
            allows for it, at rest too, and most of it is overcome. By default nothing.
        sensor_friction, sensor_drag: what torque sensors behind the gears show beside the torque at the links, of the
            same form as friction and drag, (n, 3) each: a bias, hysteresis. By default nothing.
        description: what the model was generated from, or for a user's own what was derived from it; None where
            nobody says.
        tool: what the flange carries; None likewise.
        surface: points of the links' surface, (P, 7), rows as in `contactsafe.robot.surface`; empty where unknown.
        places: where something may touch the links or, last, the tool, (P, 7), see `contactsafe.robot.touchable`; by
            default the surface and what the tool says. Where another tool or surface replaces them, give none.
        calibrated: whether it is as it was identified; see `contactsafe.robots.calibrated`.
        lever_doubted: lever arm at which a point of the surface is hardly believed to be a contact, m: of points that
            explain a torque alike, the one that takes less force is. 0 to go by the torque's direction alone.
        base: where the body stands in `model` in which the first joint's axis is fixed; None for what the model says.

    Raises:
        InvalidInputError: gravity, the model, a limit, friction, drag or home is not finite or not one row a joint, a
            mass or friction is negative, or a joint's range is empty.
    """

    name: str
    model: mujoco.MjModel
    site: str
    q_min: np.ndarray
    q_max: np.ndarray
    qd_max: np.ndarray
    tau_max: np.ndarray
    torque_rate_max: float
    friction: np.ndarray
    home: np.ndarray
    description: ArmDescription | None = None
    tool: Tool | None = None
    surface: np.ndarray = field(default_factory=lambda: np.zeros((0, SURFACE_COLUMNS)))
    lever_doubted: float = 0.0
    places: np.ndarray = field(default_factory=lambda: np.zeros((0, SURFACE_COLUMNS)))
    drag: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    friction_unknown: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    sensor_friction: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    sensor_drag: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    calibrated: bool = False
    base: Pose | None = None

    def __post_init__(self) -> None:
        """Take numbers as arrays, and refuse what no arm can be."""
        if len(self.places) == 0:
            object.__setattr__(self, "places", touchable(self.surface, self.tool))
        for name, columns in (("drag", 3), ("friction_unknown", 2), ("sensor_friction", 3), ("sensor_drag", 3)):
            if np.size(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros((self.n, columns)))
        for name, value in as_numbers(self).items():
            object.__setattr__(self, name, value)
        refuse_unsound(self)

    def __repr__(self) -> str:
        """Say which arm it is in one line; its numbers are its attributes."""
        return f"Arm({self.name!r}, {self.n} joints, tool point {self.site!r})"

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    def bind(self, model: mujoco.MjModel, tick_s: float = 0.001, wrist: WristNames | None = None) -> Binding:
        """Find this arm's joints and motors, by the joints' names, and its wrist sensors in the model of a whole scene.

        One tick of a MuJoCo loop is then `measured = Measurement(data.qpos[at.qpos], data.qvel[at.dof])`, the
        controller's step, `data.ctrl[at.ctrl] = out.torque / at.gear`, `mj_step(model, data, at.steps)`. Where
        force and torque sensors stand between the last joint and the tool, `at.wrench(data)` is the
        measurement's `wrench_ee`.

        Args:
            model: of the scene.
            tick_s: the controller's tick, `ControllerConfig.clock.dt`, s.
            wrist: names of the sensors; None for those that are found.

        Raises:
            InvalidInputError: a joint is missing, has not exactly one motor, the timestep does not divide the tick, or
                a sensor that was named is not there.
        """
        names = [self.model.joint(i).name for i in range(self.n)]
        return bind_joints(names, self.site, model, tick_s, wrist)

    def nominal(self) -> NominalModel:
        """Make a copy of the nominal model for one controller or one thread."""
        base = None if self.base is None else Frame(self.base.position, quat_to_matrix(self.base.quat))
        return NominalModel(self.model, self.site, self.surface, self.places, base)

    def joint_vector(self, value: ArrayLike, name: str) -> np.ndarray:
        """Check a joint-space vector at the door.

        Args:
            value: n finite numbers.
            name: what to call it in the message.

        Returns:
            Float array, (n,).

        Raises:
            InvalidInputError: wrong shape or not finite.
        """
        return finite_array(value, (self.n,), name)

    def tool_pose(self, q: ArrayLike) -> Pose:
        """Return the tool's pose at joint positions q (n,), rad."""
        q = self.joint_vector(q, "q")
        position, rotation, J = np.zeros(3), np.zeros((3, 3)), np.zeros((6, self.n))
        nominal = self.nominal()  # named, so that it outlives the call: the handle is but an address
        forward_kinematics(nominal.handle, q, position, rotation, J)
        return Pose(position, matrix_to_quat(rotation))

    def dynamics(self, q: ArrayLike, qd: ArrayLike) -> np.void:
        """Evaluate the nominal dynamics at q (n,) rad, qd (n,) rad/s; a `dynamics_dtype` record."""
        out = np.zeros(1, dtype=dynamics_dtype(self.n))
        nominal = self.nominal()
        update_dynamics(nominal.handle, self.joint_vector(q, "q"), self.joint_vector(qd, "qd"), out[0])
        return out[0]


def finite_array(value: ArrayLike, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Check an array at the door: its shape, and that every number is finite.

    Raises:
        InvalidInputError: naming what was found and what is allowed.
    """
    array = array_of(value, shape, name, "finite ")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        where = f"[{', '.join(map(str, index))}]" if index else ""
        raise InvalidInputError(f"{name}{where} = {array[index]}; every number must be finite")
    return array


def unit_quaternion(value: ArrayLike, name: str) -> np.ndarray:
    """Check a quaternion w x y z to 1e-3 of unit length and normalise it, (4,).

    Raises:
        InvalidInputError: not four finite numbers, or not of unit length.
    """
    quat = finite_array(value, (4,), name)
    norm = float(np.linalg.norm(quat))
    if abs(norm - 1.0) > 1e-3:
        raise InvalidInputError(f"{name} has length {norm:.4g}; give a unit quaternion w x y z (divide by its length)")
    return quat / norm


def finite_range(q_min: np.ndarray, q_max: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a joint range to choose postures from, (n,) and (n,), rad: one turn where a joint turns without end."""
    return np.where(np.isfinite(q_min), q_min, -np.pi), np.where(np.isfinite(q_max), q_max, np.pi)


def require_arm(value: Any) -> Arm:
    """Return what was given for an arm.

    Raises:
        InvalidInputError: it is none.
    """
    if not isinstance(value, Arm):
        raise InvalidInputError(f"arm is {type(value).__name__}; give an Arm such as contactsafe.robots.panda()")
    return value


def description_and_tool(arm: Arm) -> tuple[ArmDescription, Tool]:
    """Return what an arm and its tool are built from.

    Raises:
        InvalidInputError: nobody says.
    """
    if arm.description is None or arm.tool is None:
        raise InvalidInputError(
            f"arm '{arm.name}' has no description of its links and tool; give contactsafe.robots.panda(), or one of "
            "robots.from_mjcf"
        )
    return arm.description, arm.tool


def arm_from_description(description: ArmDescription, tool: Tool) -> Arm:
    """Build an arm from its description and a tool."""
    return Arm(
        name=description.name,
        model=mujoco.MjModel.from_xml_string(arm_mjcf(description, tool)),
        site=TOOL_SITE,
        q_min=description.joint_array("q_min"),
        q_max=description.joint_array("q_max"),
        qd_max=description.joint_array("qd_max"),
        tau_max=description.joint_array("tau_max"),
        torque_rate_max=description.torque_rate_max,
        friction=description.joint_array("friction"),
        home=np.array(description.home),
        description=description,
        tool=tool,
        surface=capsule_surface(description),
        places=touchable(capsule_places(description), tool),
    )
