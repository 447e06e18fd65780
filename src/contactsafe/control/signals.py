"""What goes into a step of the controller, and what comes out."""

from typing import NamedTuple

import numpy as np

from contactsafe.control.codes import FAULTS, FREE, KINDS, LIMITS
from contactsafe.robot.arm import Pose


class Measurement(NamedTuple):
    """What the sensors say at one tick.

    Attributes:
        q: joint positions, (n,), rad.
        qd: joint velocities, (n,), rad/s.
        wrench_ee: wrench of the environment on the end effector at the tool point, world axes, (6,), N and N m;
            None without a force sensor.
        time: when it was measured, s, by any clock that only goes forward; None where it is not known: then a tick
            counts as one tick of time, unless the joints went further than that.
        torque: joint torque measured behind the gears, where the links begin, gravity included, (n,), N m: Franka's
            `tau_J`. None without such sensors: then the command stands for it, less friction and what the rotors take.
        wrench_base: wrench that the arm exerts on what it stands on, about the world's origin, where its base is, world
            axes, (6,), N and N m: at rest its weight, (0, 0, −m g) and the moment of that; in motion what the links'
            acceleration takes is in it too, as a sensor under the base shows it. A constant beside it, such as the
            weight of the base itself or the sensor's bias, is learned. None without such a sensor.
    """

    q: np.ndarray
    qd: np.ndarray
    wrench_ee: np.ndarray | None = None
    time: float | None = None
    torque: np.ndarray | None = None
    wrench_base: np.ndarray | None = None


class Target(NamedTuple):
    """What a policy asks for; held until the next.

    Attributes:
        pose: desired tool pose, world. Of its orientation an arm of fewer than six joints takes the nearest that it has
            at the position.
        stiffness: per unit task inertia, (6,), 1/s² (Λ stands before it, so it is not N/m); 0 lets a direction go.
        damping: per unit task inertia, (6,), 1/s; None for critical damping 2 √stiffness, and the least where it is 0.
        posture: null-space joint reference, (n,), rad; None for the one that goes with `pose`, whatever path led there
            (`InverseKinematics.posture_near`).
    """

    pose: Pose
    stiffness: np.ndarray
    damping: np.ndarray | None = None
    posture: np.ndarray | None = None


class Contact(NamedTuple):
    """What is known of what touches the arm, or its tool.

    Attributes:
        in_contact: whether the contact-aware law is in force: for contacts of the arm.
        link: that is touched, most probably, 1 … n; the tool is part of the last one. 0 for none.
        kind: 'obstacle', with which the arm complies, or 'push', which it rejects: one on the arm counts as an
            obstacle until receding from it has shown that it pushes; 'tool' where the tool alone touches something;
            'none'.
        torque: estimated joint torque of the contact, (n,), N m (the fast residual).
        probability: of the kind's being right as to arm or tool, as far as joint torques tell.
        point: where on the surface, most probably, world, (3,), m; NaN where nothing shows in the joints. By a
            controller it may lie beside `link`, which its law goes by.
            `ContactEstimator.places()` gives the others that explain the torques.
        force: of the environment there, as far as joint torques and a sensor under the base tell it, world, (3,), N.
        bridged: measurements in a row, up to this one, that were not believed: all this is of the last one that was.
        several: whether no single contact explains the torques, so that arm or tool is touched in two places at least.
            Two contacts often do look like one: no is no proof.
    """

    in_contact: bool
    link: int
    kind: str
    torque: np.ndarray
    probability: float
    point: np.ndarray
    force: np.ndarray
    bridged: int = 0
    several: bool = False

    @property
    def touched(self) -> bool:
        """Whether anything touches arm or tool now; a law may stay in force for a while after it (`in_contact`)."""
        return self.kind != "none"


class Output(NamedTuple):
    """What one tick gives back.

    Attributes:
        torque: joint command including gravity, (n,), N m.
        contact: on the arm.
        residual: estimated external joint torque the law compensates, (n,), N m.
        error: x_d − x, position and rotation vector, (6,), m and rad; of the arm as predicted while `bridged` is not 0.
        limited_by: what took something off the task or the command: some of 'contact' (the bound on the force along
            it), 'tool force' (`tool_force_limit_n`), 'energy' (the tank), 'rate' (torque or torque rate), 'range'
            (joint range or speed), and 'load' where what takes it off is what the tool carries; () where nothing did.
        fault: 'none', or the first reason since reset why a number was refused; in its place why the arm is braked, if
            it is, or else that an unknown load keeps the tool off.
        bridged: ticks in a row, up to this one, whose measurement was missing or not believed, and predicted.
        target_late: whether no new target came for so long that the tool is brought to rest.
        braked: whether the arm is braked until `reset`, for the reason that `fault` gives.
    """

    torque: np.ndarray
    contact: Contact
    residual: np.ndarray
    error: np.ndarray
    limited_by: tuple[str, ...]
    fault: str
    bridged: int = 0
    target_late: bool = False
    braked: bool = False


_LIMITED_BY = [tuple(name for key, name in LIMITS.items() if sum_ & key) for sum_ in range(2 * max(LIMITS))]


def contact_of(out: dict[str, np.ndarray]) -> Contact:
    """Return what a tick reports of a contact, from the fields of an `output_dtype` record."""
    return Contact(
        in_contact=bool(out["mode"] != FREE),
        link=int(out["link"]) or int(out["touched"]),
        kind=KINDS[int(out["kind"])],
        torque=out["residual_fast"].copy(),
        probability=float(out["probability"]),
        point=out["point"].copy() if out["touched"] else np.full(3, np.nan),
        force=out["force"].copy(),
        bridged=int(out["bridged"]),
        several=bool(out["several"]),
    )


def output_of(out: dict[str, np.ndarray]) -> Output:
    """Return what a tick reports, from the fields of an `output_dtype` record."""
    return Output(
        torque=out["torque"].copy(),
        contact=contact_of(out),
        residual=out["residual"].copy(),
        error=out["error"].copy(),
        limited_by=_LIMITED_BY[int(out["limited_by"])],
        fault=FAULTS[int(out["fault"])],
        bridged=int(out["bridged"]),
        target_late=bool(out["target_late"]),
        braked=bool(out["braked"]),
    )
