"""The controller for Python callers: checked at the door, then one compiled tick."""

from typing import NamedTuple

import numpy as np

from contactsafe.control.codes import FAULTS, FREE, KINDS, LIMITS
from contactsafe.control.config import ControllerConfig
from contactsafe.control.params import OUTSIDE_RAD, fill_params, mass_variance
from contactsafe.control.payload import payload_weight_into
from contactsafe.control.payload_change import take_up
from contactsafe.control.presets import safe
from contactsafe.control.records import controller_dtype
from contactsafe.control.tick import tick_at
from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm, Pose, finite_array
from contactsafe.robot.ik import InverseKinematics
from contactsafe.robot.payload import Payload, carrying, checked_payload
from contactsafe.robot.soundness import array_of

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


class Measurement(NamedTuple):
    """What the sensors say at one tick.

    Attributes:
        q: joint positions, (n,), rad.
        qd: joint velocities, (n,), rad/s.
        wrench_ee: wrench of the environment on the end effector at the tool point, world axes, (6,), N and N m;
            None without a force sensor.
        time: when it was measured, s, by any clock that only goes forward; None where it is not known: then a tick
            counts as one tick of time, unless the joints went further than that.
    """

    q: np.ndarray
    qd: np.ndarray
    wrench_ee: np.ndarray | None = None
    time: float | None = None


class Target(NamedTuple):
    """What a policy asks for; held until the next.

    Attributes:
        pose: desired tool pose, world.
        stiffness: per unit task inertia, (6,), 1/s² (Λ stands before it, so it is not N/m).
        damping: per unit task inertia, (6,), 1/s; None for critical damping 2 √stiffness.
        posture: null-space joint reference, (n,), rad; None for the one that goes with `pose`, whatever path led there
            (`InverseKinematics.posture_near`).
    """

    pose: Pose
    stiffness: np.ndarray
    damping: np.ndarray | None = None
    posture: np.ndarray | None = None


class Contact(NamedTuple):
    """What is known of a contact on the arm.

    Attributes:
        in_contact: whether the contact-aware law is in force.
        link: found in contact on the arm's surface, or without one the furthest whose joint residual exceeds the
            threshold, 1 … n; 0 for none.
        kind: 'obstacle', with which the arm complies, or 'push', which it rejects: one on the arm counts as an
            obstacle until receding from it has shown that it pushes; 'tool' where the tool alone touches something;
            'none'.
        torque: estimated joint torque of the contact, (n,), N m (the fast residual).
    """

    in_contact: bool
    link: int
    kind: str
    torque: np.ndarray


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
        fault: 'none', or the first reason since reset why a number was refused; why the arm is braked, if it is.
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


class Controller(Independent):
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

    _bound = ("record", "_ticked", "_measured", "_reported", "_kept")

    def __init__(
        self, arm: Arm, config: ControllerConfig | None = None, records: np.ndarray | None = None, index: int = 0
    ):
        if not isinstance(arm, Arm):
            raise InvalidInputError(f"arm is {type(arm).__name__}; give an Arm such as contactsafe.robots.panda()")
        config = safe() if config is None else config
        if not isinstance(config, ControllerConfig):
            raise InvalidInputError(
                f"config is {type(config).__name__}; give a ControllerConfig such as contactsafe.presets.safe()"
            )
        _warm_up(arm, config)
        self.arm = arm
        self.config = config
        self._loaded = arm
        self._nominal = arm.nominal()
        self._ik = InverseKinematics(arm)
        self._records, self._index = _slot(arm, records, index)
        self._bind()
        fill_params(self.record["params"], config, arm)
        self._last_numbers: list = []
        self._is_reset = False

    def _bind(self) -> None:
        self.record = self._records[self._index]
        self._ticked = self._records.view(controller_dtype(self.arm.n))  # what was pickled has an equal type of its own
        self._measured = _views(self._records["measurement"], self._index)
        self._reported = _views(self._records["output"], self._index)
        self._kept = _views(self._records["target"], self._index)["kept"]
        self.record["handle"] = self._nominal.handle

    def reset(self, q, qd=None, torque=None) -> None:
        """Forget everything and hold the present pose, taking the arm over as it is: at rest, moving, or held against.

        The command goes on from the torque last sent, within the torque rate limit; whoever knows it says so. Else it
        is this controller's own last one, or, where it has sent none and where a joint is over 0.5 rad from where it
        was measured last (another episode, an arm led by hand), gravity, which keeps an untouched arm at rest.

        Args:
            q: measured joint positions, (n,), rad; up to `RANGE_TOLERANCE` past a joint's limit.
            qd: measured joint velocities, (n,), rad/s; None for an arm at rest.
            torque: joint torque last sent, gravity included, (n,), N m; None where it is not known.

        Raises:
            InvalidInputError: a wrong shape, a number that is not finite, joints outside their range, or more torque
                than the arm's limit.
        """
        q = self._in_range(self.arm.joint_vector(q, "q"), "q", RANGE_TOLERANCE)
        qd = np.zeros(self.arm.n) if qd is None else self._believable(self.arm.joint_vector(qd, "qd"))
        dynamics = self._loaded.dynamics(q, qd)
        tau = self._last_torque(q, dynamics) if torque is None else self._within_limit(torque)
        for part in ("state", "output", "measurement"):
            self.record[part] = np.zeros((), dtype=self.record[part].dtype)
        self.record["dynamics"] = dynamics
        state = self.record["state"]
        state["command"]["tau"], state["clock"]["q_good"] = tau, q
        self.record["measurement"]["q"], self.record["measurement"]["qd"] = q, qd
        pose = self.arm.tool_pose(q)
        held = state["target"]
        held["position"], held["quat"], held["q_posture"] = pose.position, pose.quat, q
        held["K_task"] = np.clip(_HELD_STIFFNESS, *self.config.impedance.stiffness_range)
        held["D_task"] = np.clip(2.0 * np.sqrt(held["K_task"]), *self.config.impedance.damping_range)
        self.record["target"] = held
        self._last_numbers = []
        self._is_reset = True

    @property
    def payload(self) -> Payload:
        """What the tool is known to carry."""
        known = self.record["payload"]
        return Payload(float(known["mass"]), known["com"].copy(), known["inertia"].copy())

    def set_payload(self, mass, com=None, inertia=None, in_wrench: bool | None = None) -> None:
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
        self._refuse_overload(load, loaded)
        gravity, rotation = self.record["handle"]["gravity"], self.record["dynamics"]["rotation"]
        weight = payload_weight_into(self._records["payload"][self._index], rotation, gravity, np.zeros(6))
        self._loaded, self._nominal = loaded, loaded.nominal()
        known = self.record["payload"]
        known["mass"], known["com"], known["inertia"] = load
        known["in_wrench"] = self._shows(load, gravity) if in_wrench is None else bool(in_wrench)
        self.record["handle"] = self._nominal.handle
        self.record["params"]["identification"]["mass_variance"] = mass_variance(self.config, loaded)
        if self.record["state"]["started"]:
            take_up(self._ticked, self._index, weight)

    def _refuse_overload(self, load: Payload, loaded: Arm) -> None:
        """Refuse what the motors do not hold where the arm is, unless it is less than they are said to hold already."""
        q, still = self.record["state"]["clock"]["q_good"] if self._is_reset else self.arm.home, np.zeros(self.arm.n)
        need, before = (np.abs(arm.dynamics(q, still)["g"]) / self.arm.tau_max for arm in (loaded, self._loaded))
        over = (need > 1.0) & (need > before)
        if over.any():
            i = int(np.argmax(need * over))
            raise InvalidInputError(
                f"mass = {load.mass:g} kg, {1000 * np.linalg.norm(load.com):.0f} mm from the tool point, asks "
                f"{need[i] * self.arm.tau_max[i]:.4g} N m of joint '{self.arm.model.joint(i).name}' here, which has "
                f"{self.arm.tau_max[i]:g}; give what the arm can carry"
            )

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

    def _believable(self, qd: np.ndarray) -> np.ndarray:
        most = self.record["params"]["arm"]["qd_most"]
        if (np.abs(qd) <= most).all():
            return qd
        i = int(np.argmax(np.abs(qd) > most))
        raise InvalidInputError(f"qd[{i}] = {qd[i]:.4g} rad/s is faster than this arm gets, {most[i]:.4g}; give rad/s")

    def _in_range(self, q: np.ndarray, name: str, tolerance: float) -> np.ndarray:
        past = self._past_limits(q)
        if (past <= tolerance).all():
            return q
        i = int(np.argmax(past > tolerance))
        low, high = self.arm.q_min[i], self.arm.q_max[i]
        remedy = "move the joint back by hand or in the robot's own mode, or correct the arm's range"
        if name != "q":
            remedy = "give one within the range"
        if np.abs(q).max() > 2.0 * np.pi and (self._past_limits(np.radians(q)) <= 0.0).all():
            remedy = "these are degrees, give radians"
        limit = f"above its limit {high:.4f}" if q[i] > high else f"below its limit {low:.4f}"
        raise InvalidInputError(
            f"{name}[{i}] = {q[i]:.4f} rad, joint '{self.arm.model.joint(i).name}', is {past[i]:.4f} rad {limit}; "
            f"{tolerance} is tolerated: {remedy}"
        )

    def _past_limits(self, q: np.ndarray) -> np.ndarray:
        return np.maximum(self.arm.q_min - q, q - self.arm.q_max)

    def _last_torque(self, q: np.ndarray, dynamics) -> np.ndarray:
        """Return the torque that the arm is under, as far as this controller can know, (n,), N m."""
        state = self.record["state"]
        elsewhere = np.abs(q - state["clock"]["q_good"]) > _SAME_PLACE
        if self._is_reset and not elsewhere.any():
            return state["command"]["tau"].copy()
        return dynamics["g"].copy()

    def _within_limit(self, torque) -> np.ndarray:
        torque = self.arm.joint_vector(torque, "torque")
        over = np.abs(torque) > self.arm.tau_max
        if over.any():
            i = int(np.argmax(over))
            raise InvalidInputError(
                f"torque[{i}] = {torque[i]:.4g} N m is outside [{-self.arm.tau_max[i]:g}, {self.arm.tau_max[i]:g}]; "
                "give the joint torque last sent, in N m"
            )
        return torque

    def step(self, measurement: Measurement, target: Target | None = None) -> Output:
        """Run one tick of 1 ms.

        A target of the same numbers as the last is not checked again. None says that no new one came: the last one
        holds, for `target_timeout_s` at most. What is raised here leaves the tick undone: whoever drives an arm then
        calls `step(measurement)` at once, which gives the torque under the last good target.

        Raises:
            InvalidInputError: wrong shapes, numbers that are not finite, gains out of range.
            UnreachableError: no posture was given and none was found for the pose.
        """
        if not isinstance(measurement, Measurement):
            raise InvalidInputError(f"measurement is {type(measurement).__name__}; give a contactsafe.Measurement")
        if not self._is_reset:
            raise InvalidInputError(
                "the controller was not reset; call reset(q) with the measured joint positions first"
            )
        self._kept[...] = target is None
        if target is not None:
            self.set_target(target)
        self._set_measurement(measurement)
        tick_at(self._ticked, self._index)
        return self._output()

    def set_target(self, target: Target) -> None:
        """Check a target and make it the one in force; on error the last one stays."""
        if not isinstance(target, Target):
            raise InvalidInputError(f"target is {type(target).__name__}; give a contactsafe.Target")
        if not isinstance(target.pose, Pose):
            raise InvalidInputError(f"target.pose is {type(target.pose).__name__}; give a contactsafe.Pose")
        numbers = _numbers(target)  # before they are checked: others may change them
        if numbers == self._last_numbers:
            return
        record = self.record["target"]
        position = finite_array(target.pose.position, (3,), "pose.position")
        quat = unit_quaternion(target.pose.quat, "pose.quat")
        stiffness = self._gain(target.stiffness, "stiffness", "1/s²", self.config.impedance.stiffness_range)
        damping = 2.0 * np.sqrt(stiffness) if target.damping is None else target.damping
        damping = self._gain(damping, "damping", "1/s", self.config.impedance.damping_range)
        if target.posture is None:
            posture = self._ik.posture_near(Pose(position, quat), record["q_posture"].copy())
        else:
            posture = self._in_range(self.arm.joint_vector(target.posture, "posture"), "posture", OUTSIDE_RAD)
        record["position"], record["quat"], record["q_posture"] = position, quat, posture
        record["K_task"], record["D_task"] = stiffness, damping
        self._last_numbers = numbers

    def _gain(self, value, name: str, unit: str, allowed: tuple[float, float]) -> np.ndarray:
        gain = finite_array(value, (6,), name)
        low, high = allowed
        outside = (gain < low) | (gain > high)
        if outside.any():
            i = int(np.argmax(outside))
            raise InvalidInputError(
                f"{name}[{i}] = {gain[i]:g} {unit} is outside [{low:g}, {high:g}]; "
                f"scale it or widen {name}_range of the ControllerConfig"
            )
        return gain

    def _set_measurement(self, measurement: Measurement) -> None:
        seen = self._measured
        seen["q"][:] = _shaped(measurement.q, self.arm.n, "q")
        seen["qd"][:] = _shaped(measurement.qd, self.arm.n, "qd")
        seen["has_wrench"][...] = measurement.wrench_ee is not None
        if measurement.wrench_ee is not None:
            seen["wrench_ee"][:] = _shaped(measurement.wrench_ee, 6, "wrench_ee")
        seen["has_time"][...] = measurement.time is not None
        if measurement.time is not None:
            seen["time"][...] = _seconds(measurement.time)

    def _output(self) -> Output:
        out = self._reported
        contact = Contact(
            in_contact=bool(out["mode"] != FREE),
            link=int(out["link"]),
            kind=KINDS[int(out["kind"])],
            torque=out["residual_fast"].copy(),
        )
        return Output(
            torque=out["torque"].copy(),
            contact=contact,
            residual=out["residual"].copy(),
            error=out["error"].copy(),
            limited_by=_LIMITED_BY[int(out["limited_by"])],
            fault=FAULTS[int(out["fault"])],
            bridged=int(out["bridged"]),
            target_late=bool(out["target_late"]),
            braked=bool(out["braked"]),
        )


_LIMITED_BY = [tuple(name for key, name in LIMITS.items() if sum_ & key) for sum_ in range(2 * max(LIMITS))]


def _views(records: np.ndarray, index: int) -> dict[str, np.ndarray]:
    """Return each field of one record as an array that shares its memory: reading and writing it is quick."""
    return {
        name: records[name][index : index + 1].reshape(records.dtype[name].shape) for name in records.dtype.names or ()
    }


def _slot(arm: Arm, records: np.ndarray | None, index: int) -> tuple[np.ndarray, int]:
    """Check where a controller is to live: an array of records, and the place in it."""
    if records is None:
        records = np.zeros(1, dtype=controller_dtype(arm.n))
    fits = isinstance(records, np.ndarray) and records.ndim == 1 and records.dtype == controller_dtype(arm.n)
    if not fits or not records.flags.writeable:
        raise InvalidInputError(
            f"records are no writable array of controllers for {arm.n} joints; "
            f"give numpy.zeros(how_many, dtype=controller_dtype({arm.n}))"
        )
    if not isinstance(index, int | np.integer) or not 0 <= index < len(records):
        raise InvalidInputError(f"index = {index!r} is no place in {len(records)} records; count from 0")
    return records, int(index)


def _numbers(target: Target) -> list:
    """Take down a target's numbers in whatever form is quickly compared: they may be changed in place."""
    pose = target.pose
    given = (pose.position, pose.quat, target.stiffness, target.damping, target.posture)
    return [value.tobytes() if type(value) is np.ndarray else _taken_down(value) for value in given]


def _taken_down(value):
    if value is None:
        return None
    return tuple(value) if isinstance(value, list | tuple) else np.asarray(value).tobytes()


def _shaped(value, n: int, name: str) -> np.ndarray:
    """Check a measurement's shape only: numbers that are not finite are the tick's to refuse, the arm must not drop."""
    if type(value) is np.ndarray and value.dtype == float and value.shape == (n,):
        return value
    return array_of(value, (n,), name)


def _seconds(value) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInputError(f"time is {type(value).__name__}, not a number; give seconds") from None


def unit_quaternion(value, name: str) -> np.ndarray:
    """Check a quaternion w x y z to 1e-3 of unit length and normalise it, (4,).

    Raises:
        InvalidInputError: not four finite numbers, or not of unit length.
    """
    quat = finite_array(value, (4,), name)
    norm = float(np.linalg.norm(quat))
    if abs(norm - 1.0) > 1e-3:
        raise InvalidInputError(f"{name} has length {norm:.4g}; give a unit quaternion w x y z (divide by its length)")
    return quat / norm


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
