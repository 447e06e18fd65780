"""Errors of sensors and motors, between any backend and the controller; compiled.

What a controller is told of a plant passes through `sense`, and nothing else does; what it asks for passes through
`actuate`.
"""

import functools
import math

import numpy as np

from contactsafe.control.laws import filter_gain
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.linalg import cross_into, matvec_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.arm import Arm
from contactsafe.robot.friction import joint_drag_into
from contactsafe.sim.base_sensor import CHANNELS, base_sensor_dtype, fill_base_sensor, sense_base
from contactsafe.sim.config import SensorConfig, WorldConfig, per_joint
from contactsafe.sim.joint_sensors import band_gain, joint_sensors_dtype, sense_torque, velocity_noise
from contactsafe.sim.stiction import add_stiction

_f = np.float64
_i = np.int64


def noise_channels(n: int, sensors: SensorConfig | None = None) -> int:
    """Count the random numbers one tick needs: q, q̇ and torque of n joints, force, moment, accelerometer.

    Sensors at the joints need 2 n more, which come next: of torque, and of velocity in its band. One under the base
    needs its own, which come last.
    """
    more = sensors is not None and (sensors.joint_torque or sensors.velocity_band_rad_s > 0.0)
    base = sensors is not None and sensors.base
    return 3 * n + 9 + (2 * n if more else 0) + (CHANNELS if base else 0)


@functools.cache
def errors_dtype(n: int) -> np.dtype:
    """Describe the errors of one world's sensors and motors, and what they remember."""
    return np.dtype(
        [
            ("q_sigma", _f),
            ("qd_sigma", _f),
            ("torque_sigma", _f),
            ("force_sigma", _f),
            ("moment_sigma", _f),
            ("accelerometer_sigma", _f),
            ("encoder_step", _f),  # rad; 0 for none
            ("velocity_filter_gain", _f),  # of the difference quotient, a tick; 0 for the plant's own velocity
            ("has_wrist", _i),  # 0 where no force sensor is there
            ("wrench_bias", _f, (6,)),  # sensor axes, N and N m
            ("tool_mass", _f),  # as the sensor's compensation believes, kg
            ("tool_com", _f, (3,)),  # mount frame, m
            ("tcp", _f, (3,)),  # mount frame, m
            ("friction", _f, (n, 3)),  # N m, s/rad, rad/s; already scaled
            ("drag", _f, (n, 3)),  # viscous, constant and dry beside it, N m s/rad, N m; already scaled
            ("stiction", _f, (n,)),  # dry friction, N m
            ("bristle", _f, (n,)),  # how far it is taken up, −1 … 1
            ("joints", joint_sensors_dtype(n)),
            ("base", base_sensor_dtype),
            ("delay_ticks", _i),  # 0 or 1, between a command and its effect
            ("q_seen", _f, (n,)),  # last measured positions, rad
            ("qd_seen", _f, (n,)),  # last measured velocities, rad/s
            ("tau_delayed", _f, (n,)),  # command that waits for its turn, N m
        ]
    )


def fill_errors(errors: Record, arm: Arm, config: WorldConfig, tick_s: float) -> None:
    """Fill an `errors_dtype` record.

    Raises:
        InvalidInputError: the arm has no tool, or friction is scaled for another number of joints.
    """
    if arm.tool is None:
        raise InvalidInputError(f"arm '{arm.name}' has no tool; a simulated world needs one, such as robots.WIPER")
    sensors = config.sensors
    errors["q_sigma"], errors["qd_sigma"] = sensors.q_rad, sensors.qd_rad_s
    errors["torque_sigma"], errors["force_sigma"] = sensors.torque_nm, sensors.force_n
    errors["moment_sigma"], errors["accelerometer_sigma"] = sensors.moment_nm, sensors.accelerometer_m_s2
    errors["encoder_step"] = sensors.encoder_step_rad
    if math.isfinite(sensors.velocity_filter_hz):
        errors["velocity_filter_gain"] = filter_gain(2 * math.pi * sensors.velocity_filter_hz, tick_s)
    errors["has_wrist"] = sensors.wrist
    errors["tool_mass"], errors["tool_com"] = arm.tool.inertia.mass, arm.tool.inertia.com
    errors["tcp"] = arm.tool.tcp
    fill_friction(errors, arm.friction, arm.drag, per_joint(config.plant.friction_scale, arm.n, "friction_scale"))
    errors["drag"][:, 0] = np.minimum(errors["drag"][:, 0], _stable_damping(arm, tick_s))
    errors["stiction"] = per_joint(config.plant.stiction_nm, arm.n, "stiction_nm")
    joints = errors["joints"]
    joints["band_sigma"] = sensors.velocity_band_rad_s * band_gain(tick_s)
    joints["has_torque"], joints["torque_sigma"] = sensors.joint_torque, sensors.joint_torque_nm
    joints["play"], joints["rotor"] = sensors.joint_torque_play_nm, arm.model.dof_armature
    joints["friction"], joints["drag"] = arm.sensor_friction, arm.sensor_drag
    fill_base_sensor(errors["base"], sensors, noise_channels(arm.n, sensors) - CHANNELS)
    errors["delay_ticks"] = config.plant.torque_delay_ticks


def _stable_damping(arm: Arm, tick_s: float) -> np.ndarray:
    """Return how much viscous friction the plant's joints take, which is applied a tick late, (n,), N m s/rad."""
    if not arm.drag[:, 0].any():
        return np.full(arm.n, np.inf)
    return 0.25 / (tick_s * np.diag(arm.dynamics(arm.home, np.zeros(arm.n))["M_inv"]))


def fill_friction(errors: Record, friction: np.ndarray, drag: np.ndarray, scale: np.ndarray | float) -> None:
    """Fill friction and drag of an `errors_dtype` record, scaled but for the constant torque, which is no friction.

    Args:
        errors: to fill.
        friction, drag: as of `Arm`, (n, 3) each.
        scale: of both, (n,) or one number.
    """
    errors["friction"], errors["drag"] = friction, drag
    errors["friction"][:, 0] *= scale
    errors["drag"][:, 0] *= scale
    errors["drag"][:, 2] *= scale


@compiled
def sense(world: Record, controller: Record, noise: Vector) -> None:
    """Fill the controller's measurement from the truth, with errors.

    Args:
        world: `world_dtype` record.
        controller: `controller_dtype` record.
        noise: standard normal numbers, (`noise_channels`,).
    """
    errors, truth, measurement = world.errors, world.truth, controller.measurement
    n = measurement.q.shape[0]
    for i in range(n):
        q = truth.q[i] + errors.q_sigma * noise[i]
        if errors.encoder_step > 0.0:
            q = errors.encoder_step * math.floor(q / errors.encoder_step + 0.5)
        qd = truth.qd[i] + errors.qd_sigma * noise[n + i]
        if errors.velocity_filter_gain > 0.0:
            rate = 0.0 if world.tick == 0 else (q - errors.q_seen[i]) / controller.params.clock.dt
            qd = errors.qd_seen[i] + errors.velocity_filter_gain * (rate - errors.qd_seen[i])
        errors.q_seen[i], errors.qd_seen[i] = q, qd
        if errors.joints.band_sigma > 0.0:
            qd += velocity_noise(errors.joints, i, noise[4 * n + 9 + i], controller.params.clock.dt)
        measurement.q[i], measurement.qd[i] = q, qd
    measurement.has_wrench = errors.has_wrist
    if errors.has_wrist != 0:
        _sense_wrench(errors, truth, controller.dynamics.rotation, measurement, noise[3 * n :])
    if errors.joints.has_torque != 0:
        sense_torque(world, measurement, noise[3 * n + 9 :], controller.params.clock.dt)
    if errors.base.present != 0:
        sense_base(errors.base, truth.base_wrench, measurement, noise)


@compiled
def _sense_wrench(errors, truth, rotation, measurement, noise):
    """Wrist sensor with its inertial unit: what is left after the tool's weight and inertia are taken out.

    A sensor reads what the arm exerts on the tool. With the specific force a of the tool's centre of mass,
    f_env = m a − f_read and t_env = com × m a − t_read about the flange; then moved to the tool point. The axes are
    those of the last tick's measured posture.
    """
    ma, force, moment, lever_moment = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    for k in range(3):
        accelerometer = truth.wrist_acceleration[k] + errors.accelerometer_sigma * noise[6 + k]
        ma[k] = errors.tool_mass * accelerometer
        force[k] = ma[k] - truth.wrist_force[k] + errors.wrench_bias[k] + errors.force_sigma * noise[k]
    cross_into(errors.tool_com, ma, lever_moment)
    for k in range(3):
        read = truth.wrist_torque[k]
        moment[k] = lever_moment[k] - read + errors.wrench_bias[3 + k] + errors.moment_sigma * noise[3 + k]
    moment -= cross_into(errors.tcp, force, lever_moment)
    matvec_into(rotation, force, measurement.wrench_ee[:3])
    matvec_into(rotation, moment, measurement.wrench_ee[3:])


@compiled
def actuate(world: Record, controller: Record, noise: Vector) -> None:
    """Fill what motors and friction put on the joints for a command: delay, torque noise, friction, stiction.

    Args:
        world: `world_dtype` record; its `motor` and `drag`, (n,), N m, are filled.
        controller: `controller_dtype` record.
        noise: standard normal numbers, (`noise_channels`,).
    """
    errors, tau = world.errors, controller.output.torque
    n = tau.shape[0]
    joint_drag_into(errors.friction, errors.drag, world.truth.qd, world.drag)
    for i in range(n):
        command = errors.tau_delayed[i] if errors.delay_ticks > 0 else tau[i]
        errors.tau_delayed[i] = tau[i]
        world.motor[i] = command + errors.torque_sigma * noise[2 * n + i]
    add_stiction(errors, world.truth.qd, world.drag, controller.params.clock.dt)
