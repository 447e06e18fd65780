"""The controller for Python callers: checked at the door, then one compiled tick."""

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.control.checks import (
    believable,
    checked_damping,
    checked_stiffness,
    in_range,
    numbers_of,
    refuse_overload,
    within_limit,
)
from contactsafe.control.config import ControllerConfig
from contactsafe.control.instance import Instance, checked_config, views
from contactsafe.control.moving_base import MovingBase
from contactsafe.control.params import OUTSIDE_RAD, mass_variance
from contactsafe.control.payload import payload_weight_into
from contactsafe.control.payload_change import take_up
from contactsafe.control.signals import Measurement, Output, Target, output_of
from contactsafe.control.tick import tick_at
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import matrix_to_quat
from contactsafe.robot.arm import Arm, Pose, finite_array, require_arm, unit_quaternion
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics
from contactsafe.robot.ik import InverseKinematics
from contactsafe.robot.ik_few_joints import FEW
from contactsafe.robot.nominal import NominalModel
from contactsafe.robot.payload import Payload, carrying, checked_payload

RANGE_TOLERANCE = 0.02
"""Joints may be measured this far past their limit at reset, rad: simulators' limits are soft, and encoders are off."""

_HELD_STIFFNESS = 150.0
"""With which the present pose is held from a reset until a target is given, 1/s²."""

_STILL_RAD_S = 0.15
"""Joints that are faster show friction and inertia as well as weight."""

_LEAST_KG = 0.01
"""A lighter load is none."""

_SAME_PLACE = 0.5
"""An arm that is less than this away from where it was last measured, rad, may have got there by itself."""


class Controller(Instance):
    """A contact-safe Cartesian variable impedance controller for one arm.

    The first one for arms of so many joints compiles what a step needs, or loads it, which is said when it takes long.
    A copy, pickled or not, goes on by itself from where this one is.

    Args:
        arm: `contactsafe.robots.panda()` or another.
        config: a preset such as `contactsafe.presets.safe()`, the default.
        records: `controller_dtype` records to live in, such as those of many controllers; its own where None.
        index: which of them.

    Attributes:
        record: everything the controller is made of; copy its `state` to save it.
    """

    _bound = (*Instance._bound, "_kept")

    def __init__(
        self, arm: Arm, config: ControllerConfig | None = None, records: np.ndarray | None = None, index: int = 0
    ) -> None:
        require_arm(arm)
        config = checked_config(config)
        _warm_up(arm, config)
        self._ik = InverseKinematics(arm)
        self._base = MovingBase()
        super().__init__(arm, config, records, index)
        self._last_numbers: list = []

    def _bind(self) -> None:
        super()._bind()
        self._kept = views(self._records["target"], self._index)["kept"]

    def reset(
        self,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
    ) -> None:
        """Forget everything and hold the present pose, taking the arm over as it is: at rest, moving, or held against.

        The command goes on from the torque last sent, within the torque rate limit; whoever knows it says so. Else it
        is this controller's own last one, or, where it has sent none and where a joint is over 0.5 rad from where it
        was measured last (another episode, an arm led by hand), gravity, which keeps an untouched arm at rest.

        Args:
            q: measured joint positions, (n,), rad; up to `RANGE_TOLERANCE` past a joint's limit.
            qd: measured joint velocities, (n,), rad/s; None for an arm at rest.
            torque: joint torque last sent, gravity included, (n,), N m; None where it is not known.
            stiffness: K1 with which the pose is held until a target is given, (6,), 1/s²; None for 150.

        Raises:
            InvalidInputError: a wrong shape, a number that is not finite, joints or stiffness outside their range, or
                more torque than the arm's limit.
        """
        q = in_range(self.arm, self.arm.joint_vector(q, "q"), "q", RANGE_TOLERANCE)
        qd = self.arm.joint_vector(np.zeros(self.arm.n) if qd is None else qd, "qd")
        qd = believable(qd, self.record["params"]["arm"]["qd_most"])
        self._base.forget_motion()
        self._place()
        dynamics = _dynamics(self._nominal, q, qd)
        tau = self._last_torque(q, dynamics) if torque is None else within_limit(self.arm, torque)
        allowed = self.config.impedance.stiffness_range
        held_by = np.clip(np.full(6, _HELD_STIFFNESS), *allowed)
        if stiffness is not None:
            held_by = checked_stiffness(stiffness, allowed)
        self.forget()
        self.record["dynamics"] = dynamics
        state = self.record["state"]
        state["command"]["tau"], state["clock"]["q_good"] = tau, q
        self.record["measurement"]["q"], self.record["measurement"]["qd"] = q, qd
        held = state["target"]
        held["position"], held["quat"] = dynamics["position"], matrix_to_quat(dynamics["rotation"])
        held["q_posture"] = q
        held["K_task"] = held_by
        held["D_task"] = np.clip(2.0 * np.sqrt(held_by), *self.config.impedance.damping_range)
        self.record["target"] = held
        for name in ("position", "rotation"):
            self.record["output"][name] = dynamics[name]
        self._last_numbers = []
        self._is_reset = True

    @property
    def payload(self) -> Payload:
        """What the tool is known to carry."""
        known = self.record["payload"]
        return Payload(float(known["mass"]), known["com"].copy(), known["inertia"].copy())

    def set_payload(
        self,
        mass: float,
        com: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
        in_wrench: bool | None = None,
    ) -> None:
        """Say what the tool carries from now on, beside what the arm's model has: all of it, at rest or amid a motion.

        It is held until the next call, a reset included. The command follows within the torque rate; a load that the
        observer has felt so far is no longer a contact.

        Args:
            mass: kg; 0 for nothing.
            com: its centre of mass in the tool's frame, (3,), m; None for the tool point.
            inertia: about that, in the tool's axes, (3, 3), kg m²; None for a point.
            in_wrench: whether `wrench_ee` has its weight in it, as that of a sensor in the wrist that was told nothing;
                then it is taken off. None to look: whether more than half of it shows now. Whoever calls before the
                load hangs free says so.

        Raises:
            InvalidInputError: what no body has, or more than the motors hold where the arm is.
        """
        load = checked_payload(mass, com, inertia)
        if not (in_wrench is None or isinstance(in_wrench, bool | np.bool_)):
            raise InvalidInputError(f"in_wrench = {in_wrench!r} is no answer; give True, False or None")
        loaded = carrying(self.arm, load)
        q = self.record["state"]["clock"]["q_good"] if self._is_reset else self.arm.home
        nominal = loaded.nominal()
        self._base.place(nominal)
        still = np.zeros(self.arm.n)
        refuse_overload(load, loaded, *(_dynamics(known, q, still)["g"] for known in (nominal, self._nominal)))
        gravity, rotation = self.record["handle"]["gravity"], self.record["dynamics"]["rotation"]
        weight = payload_weight_into(self._records["payload"][self._index], rotation, gravity, np.zeros(6))
        self._nominal = nominal
        self._place()
        known = self.record["payload"]
        known["mass"], known["com"], known["inertia"] = load
        known["in_wrench"] = self._shows(load, gravity) if in_wrench is None else bool(in_wrench)
        self.record["params"]["identification"]["mass_variance"] = mass_variance(self.config, loaded)
        if self.record["state"]["started"]:
            take_up(self._ticked, self._index, weight)

    def set_base(self, pose: Pose, velocity: ArrayLike | None = None, acceleration: ArrayLike | None = None) -> None:
        """Say where the arm's base is from now on: on a lift, a gantry or a mobile platform once a tick, or once.

        Targets, wrenches and outputs stay in world axes: a target that holds is held while the base moves under it.
        Tilting turns gravity with it. What is not told is felt as a contact; the accelerations of a base that turns
        fast (from about 1 rad/s or 1 rad/s²) are. What was told holds until the next call, a reset included: once the
        base has stopped, say so. Where a target cannot be reached from there, the next `step` with it raises
        UnreachableError.

        Args:
            pose: of the body in which the first joint's axis is fixed, world; position (3,) m, unit quaternion
                w x y z (4,).
            velocity: of its origin, world axes, (6,), m/s and rad/s; None for a base that stands.
            acceleration: of its origin, (3,), m/s²; None for that of the velocities told so far, smoothed.

        Raises:
            InvalidInputError: a wrong shape, a number that is not finite, or a quaternion that is not of unit length.
        """
        self._base.tell(pose, velocity, acceleration)
        self._place()
        if self._base.is_elsewhere():
            self._last_numbers = []

    def _place(self) -> None:
        self._base.place(self._nominal)
        self.record["handle"] = self._nominal.handle

    def _shows(self, load: Payload, gravity: np.ndarray) -> bool:
        measured = self.record["measurement"]
        shown = float(measured["wrench_ee"][:3] @ gravity)
        return bool(measured["has_wrench"] and load.mass > 0.0 and shown > 0.5 * load.mass * float(gravity @ gravity))

    def payload_estimate(self) -> Payload | None:
        """Return all that the tool seems to carry, as identified while the arm hardly moved; `set_payload` takes it.

        The torques of one posture say nothing of how far above or below the tool point the load is: there its centre
        stays at the point, until another posture tells. What presses down on the tool is not told from a load.

        Returns:
            Without inertia, which weight does not tell; None where nothing is heavier or lighter than what is known, or
            the arm moves.
        """
        state, known, found = self.record["state"], self.payload, self.record["state"]["payload"]
        if not found["is_load"] or np.abs(state["arm"]["qd"]).max() > _STILL_RAD_S:
            return None
        mass = max(known.mass + float(found["load"][0]), 0.0)
        if mass < _LEAST_KG:
            return checked_payload(0.0)
        return Payload(mass, (known.mass * known.com + found["load"][1:]) / mass, np.zeros((3, 3)))

    def _last_torque(self, q: np.ndarray, dynamics: np.void) -> np.ndarray:
        """Return the torque that the arm is under, as far as this controller can know, (n,), N m."""
        state = self.record["state"]
        elsewhere = np.abs(q - state["clock"]["q_good"]) > _SAME_PLACE
        if self._is_reset and not elsewhere.any():
            return state["command"]["tau"].copy()
        return dynamics["g"].copy()

    def step(self, measurement: Measurement, target: Target | None = None) -> Output:
        """Run one tick of 1 ms.

        A target of the same numbers as the last is not checked again. None says that no new one came: the last one
        holds, for `target_timeout_s` at most. What is raised here leaves the tick undone: whoever drives an arm then
        calls `step(measurement)` at once, which gives the torque under the last good target.

        Raises:
            InvalidInputError: wrong shapes, numbers that are not finite, gains out of range.
            UnreachableError: no posture was given and none was found for the pose; of fewer than six joints, none that
                puts the tool there.
        """
        self.require_reset(measurement)
        self._kept[...] = target is None
        if target is not None:
            self.set_target(target)
        self.set_measurement(measurement)
        tick_at(self._ticked, self._index)
        if self._base.is_told:
            self._base.pass_time(float(self.record["state"]["clock"]["elapsed"]) * self.config.clock.dt)
        return output_of(self._reported)

    def set_measurement(self, measurement: Measurement) -> None:
        """Check a measurement and write it into the record; no wrench under a base that was moved."""
        if self._base.is_told and measurement.wrench_base is not None:
            raise InvalidInputError("wrench_base is known for a base that stands where the model has it; give None")
        super().set_measurement(measurement)

    def set_target(self, target: Target) -> None:
        """Check a target and make it the one in force; on error the last one stays."""
        if not isinstance(target, Target):
            raise InvalidInputError(f"target is {type(target).__name__}; give a contactsafe.Target")
        if not isinstance(target.pose, Pose):
            raise InvalidInputError(f"target.pose is {type(target.pose).__name__}; give a contactsafe.Pose")
        numbers = numbers_of(target)  # before they are checked: others may change them
        if numbers == self._last_numbers:
            return
        record = self.record["target"]
        position = finite_array(target.pose.position, (3,), "pose.position")
        quat = unit_quaternion(target.pose.quat, "pose.quat")
        gains = self.config.impedance
        stiffness = checked_stiffness(target.stiffness, gains.stiffness_range)
        critical = np.maximum(2.0 * np.sqrt(stiffness), gains.damping_range[0])
        damping = checked_damping(critical if target.damping is None else target.damping, gains.damping_range)
        wanted = self._base.in_model(Pose(position, quat))
        if target.posture is None:
            posture = self._ik.posture_near(wanted, record["q_posture"].copy())
        else:
            posture = in_range(self.arm, self.arm.joint_vector(target.posture, "posture"), "posture", OUTSIDE_RAD)
        if self.arm.n < FEW:  # it is asked for no rotation that it cannot have there; a posture is where to look
            posture = posture if target.posture is None else self._ik.posture_near(wanted, posture)
            quat = matrix_to_quat(_dynamics(self._nominal, posture, np.zeros(self.arm.n))["rotation"])
        record["position"], record["quat"], record["q_posture"] = position, quat, posture
        record["K_task"], record["D_task"] = stiffness, damping
        self._last_numbers = numbers


def _dynamics(nominal: NominalModel, q: np.ndarray, qd: np.ndarray) -> np.void:
    """Return the `dynamics_dtype` record of a model where its base is."""
    out = np.zeros(1, dtype=dynamics_dtype(len(q)))
    update_dynamics(nominal.handle, q, qd, out[0])
    return out[0]


_WARM: set[int] = set()
"""Numbers of joints for which this process has compiled a step, or loaded it: records of other arms are other types."""


def _warm_up(arm: Arm, config: ControllerConfig) -> None:
    """Run a step of a controller that drives nothing: the first one in a process compiles or loads for a long time."""
    if arm.n in _WARM:
        return
    _WARM.add(arm.n)
    controller, q, still = Controller(arm, config), np.clip(arm.home, arm.q_min, arm.q_max), np.zeros(arm.n)
    controller.reset(q)
    gains = np.full(6, config.impedance.stiffness_range[0]), np.full(6, config.impedance.damping_range[0])
    controller.step(Measurement(q, still, np.zeros(6)), Target(arm.tool_pose(q), *gains))
