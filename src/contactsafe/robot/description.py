"""What an arm is, as data: frames, masses, limits, friction and shape, each robot with its sources."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from contactsafe.core.errors import InvalidInputError

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Unit quaternion, w x y z."""


@dataclass(frozen=True)
class Capsule:
    """A cylinder with round ends, in the frame of its link.

    Attributes:
        start: centre of one end, m.
        end: centre of the other end, m.
        radius: m.
    """

    start: Vector3
    end: Vector3
    radius: float


@dataclass(frozen=True)
class Inertia:
    """Mass properties of one rigid body, in the frame of its link.

    Attributes:
        mass: kg.
        com: centre of mass, m.
        tensor: xx, yy, zz, xy, xz, yz about the centre of mass, kg m².
    """

    mass: float
    com: Vector3
    tensor: tuple[float, float, float, float, float, float]

    @classmethod
    def of(cls, mass: float, com: np.ndarray, matrix: np.ndarray) -> "Inertia":
        """Take mass, kg, centre (3,), m, and the tensor about it as a symmetric matrix (3, 3), kg m²."""
        tensor = (matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2])
        return cls(mass, tuple(com.tolist()), tuple(float(value) for value in tensor))  # type: ignore[arg-type]

    def matrix(self) -> np.ndarray:
        """Give the tensor as a symmetric matrix, (3, 3), kg m²."""
        xx, yy, zz, xy, xz, yz = self.tensor
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def __add__(self, other: "Inertia") -> "Inertia":
        """Join two bodies rigidly (parallel-axis theorem)."""
        mass = self.mass + other.mass
        com = (self.mass * np.array(self.com) + other.mass * np.array(other.com)) / mass
        total = np.zeros((3, 3))
        for part in (self, other):
            total += part.matrix() + point_tensor(part.mass, np.array(part.com) - com)
        return Inertia.of(mass, com, total)

    def __sub__(self, part: "Inertia") -> "Inertia":
        """Return what is left of a body without one of its parts."""
        return self + Inertia.of(-part.mass, np.array(part.com), -part.matrix())


def point_tensor(mass: float, at: np.ndarray) -> np.ndarray:
    """Return the tensor of a point mass, kg, at a place (3,), m, about the origin: m (c·c I − c cᵀ), (3, 3), kg m²."""
    return mass * (at @ at * np.eye(3) - np.outer(at, at))


@dataclass(frozen=True)
class Joint:
    """A hinge about the z axis of the link it moves.

    Attributes:
        q_min: lower limit, rad.
        q_max: upper limit, rad.
        qd_max: speed limit, rad/s.
        tau_max: torque limit, N m.
        friction: φ1 N m, φ2 s/rad, φ3 rad/s of `contactsafe.robot.friction`.
        armature: inertia of the rotor seen at the joint, kg m².
    """

    q_min: float
    q_max: float
    qd_max: float
    tau_max: float
    friction: Vector3
    armature: float


@dataclass(frozen=True)
class Link:
    """One moving link and the joint that moves it.

    Attributes:
        position: of the link frame in its parent's, m.
        quat: of the link frame in its parent's.
        inertia: of the link.
        joint: the hinge between parent and link.
        capsules: shape for collision and silhouette.
    """

    position: Vector3
    quat: Quaternion
    inertia: Inertia
    joint: Joint
    capsules: tuple[Capsule, ...]


@dataclass(frozen=True)
class Tip:
    """The part of a tool that works: a box or an upright cylinder whose lower face is centred on the TCP.

    Attributes:
        half_size: half edges along x, y, z, m; a cylinder's radius twice, then half its length.
        shape: 'box' or 'cylinder'.
    """

    half_size: Vector3
    shape: Literal["box", "cylinder"] = "box"

    def __post_init__(self) -> None:
        """Refuse a tip that cannot be."""
        if self.shape not in ("box", "cylinder"):
            raise InvalidInputError(f"tip shape = {self.shape!r}; choose box or cylinder")
        size = np.atleast_1d(np.asarray(self.half_size, dtype=float))
        if size.shape != (3,) or not ((size > 0.0) & np.isfinite(size)).all():
            raise InvalidInputError(f"tip half_size = {self.half_size}; give three lengths greater than 0, m")
        if self.shape == "cylinder" and size[0] != size[1]:
            raise InvalidInputError(
                f"tip half_size = {self.half_size}; give a cylinder its radius twice, then half its length, m"
            )


@dataclass(frozen=True)
class Tool:
    """What the flange carries.

    Attributes:
        name: for messages.
        inertia: in the mount frame.
        tcp: the end-effector point in the mount frame, m; its axes are the mount frame's.
        capsules: shape, in the mount frame.
        tip: the part that works; None where no part is meant to.
    """

    name: str
    inertia: Inertia
    tcp: Vector3
    capsules: tuple[Capsule, ...]
    tip: Tip | None = None


@dataclass(frozen=True)
class ArmDescription:
    """A serial arm.

    Attributes:
        name: for messages and files.
        source: where the numbers come from.
        base: inertia of the fixed base.
        base_capsules: shape of the fixed base.
        links: from base to flange.
        mount_position: of the tool mount in the last link's frame, m.
        mount_quat: of the tool mount in the last link's frame.
        torque_rate_max: N m/s, every joint.
        home: a posture well inside the limits, rad.
    """

    name: str
    source: str
    base: Inertia
    base_capsules: tuple[Capsule, ...]
    links: tuple[Link, ...]
    mount_position: Vector3
    mount_quat: Quaternion
    torque_rate_max: float
    home: tuple[float, ...]

    def joint_array(self, field: str) -> np.ndarray:
        """Collect one field of all joints, (n,) or (n, 3) for friction."""
        return np.array([getattr(link.joint, field) for link in self.links], dtype=float)
