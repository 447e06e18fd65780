"""A simulated world as NumPy records: where its plant lies in memory, its sensors' errors, what a step measured."""

import functools
import math

import mujoco
import numpy as np

from contactsafe.control.laws import filter_gain
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm
from contactsafe.robot.mjcf import TOOL_SITE
from contactsafe.sim.config import MAX_OBSTACLES, WorldConfig, per_joint

_f = np.float64
_i = np.int64

VIEWED = (
    "ctrl", "qfrc_applied", "qfrc_constraint", "qpos", "qvel", "sensordata", "xpos", "xmat", "geom_xpos", "geom_xmat",
    "site_xpos", "site_xmat",
)  # fmt: skip
"""Arrays of MjData that compiled code reads or writes."""

_SENSORS = (
    "wrist_force", "wrist_torque", "wrist_accelerometer", "pad_board", "pad_table", "arm_board", "arm_table",
)  # fmt: skip


def noise_channels(n: int) -> int:
    """Count the random numbers one tick needs: q, q̇ and torque of n joints, force, moment, accelerometer."""
    return 3 * n + 9


@functools.cache  # as for `controller_dtype`
def plant_dtype(n: int) -> np.dtype:
    """Describe one plant: addresses for compiled code, sensor errors, the push that disturbs it."""
    return np.dtype(
        [(name, np.uintp) for name in ("model", "data", *VIEWED, "qpos_spring")]
        + [
            (name, _i)
            for name in ("nq", "nv", "nbody", "ngeom", "nsensordata", "tcp_site", "n_obstacles", "delay_ticks", "tick")
        ]
        + [(f"adr_{name}", _i) for name in _SENSORS]
        + [
            ("adr_obstacles", _i, (MAX_OBSTACLES,)),
            ("obstacle_bodies", _i, (MAX_OBSTACLES,)),
            ("obstacle_springs", _i, (MAX_OBSTACLES,)),  # address of the first spring's rest length; −1 for none
            ("obstacle_travel", _f, (MAX_OBSTACLES, 3)),  # m
            ("obstacle_travel_ticks", _f, (MAX_OBSTACLES, 2)),  # departure and arrival
            ("obstacle_travel_n", _f, (MAX_OBSTACLES,)),  # force on the arm that ends the travel
            ("obstacle_stopped", _i, (MAX_OBSTACLES,)),  # 1 once that was reached
            ("friction", _f, (n, 3)),  # N m, s/rad, rad/s; already scaled
            ("q_sigma", _f),
            ("qd_sigma", _f),
            ("encoder_step", _f),  # rad; 0 for none
            ("velocity_filter_gain", _f),  # of the difference quotient, a tick; 0 for the plant's own velocity
            ("q_seen", _f, (n,)),  # last measured positions, rad
            ("qd_seen", _f, (n,)),  # last measured velocities, rad/s
            ("torque_sigma", _f),
            ("force_sigma", _f),
            ("moment_sigma", _f),
            ("accelerometer_sigma", _f),
            ("wrench_bias", _f, (6,)),  # sensor axes, N and N m
            ("tool_mass", _f),  # as the sensor's compensation believes, kg
            ("tool_com", _f, (3,)),  # mount frame, m
            ("tcp", _f, (3,)),  # mount frame, m
            ("tau_delayed", _f, (n,)),  # command waiting for its turn, N m
            ("push_body", _i),  # body that is pushed; 0 for none
            ("push_point", _f, (3,)),  # in that body's frame, m
            ("push_force", _f, (3,)),  # world axes, N
            ("push_start", _i),  # tick
            ("push_stop", _i),  # tick
            ("push_ramp", _i),  # ticks from nothing to full
            ("origin", _f, (2,)),  # world corner of the board's first cell, m
            ("cell", _f),  # m
            ("pad_half", _f, (2,)),  # m; 0 without a pad
            ("press_n", _f),
            ("camera", _i),  # number of the camera that looks at this world
        ]
    )


def plant_bounds(bodies: int, cameras: int) -> dict[str, tuple[float, float]]:
    """Give the fields of a plant that change, and what they may be; the others are what the plant was made with."""
    ticks, measure = (-1, 2**53), (-1e9, 1e9)
    return {
        **dict.fromkeys(("tick", "push_start", "push_stop", "push_ramp", "delay_ticks"), ticks),
        **dict.fromkeys(("q_seen", "qd_seen", "tau_delayed", "wrench_bias", "push_point", "push_force"), measure),
        **dict.fromkeys(("friction", "pad_half"), measure),
        "obstacle_stopped": (0, 1),
        "push_body": (0, bodies - 1),
        "camera": (0, cameras - 1),
    }


step_metrics_dtype = np.dtype(
    [
        ("tool_force_mean", _f),  # of the ticks, |pad force| by the simulator, N
        ("tool_force_peak", _f),  # N
        ("contact_ticks", _i),  # ticks with the pad on the board
        ("obstacle_force_peak", _f),  # N
        ("arm_touched", _i),  # 1 where any part but the pad met board or table
        ("erased", _i),  # ink cells erased
        ("ticks", _i),
    ]
)
"""What one policy step measured in the simulator: for rewards, metrics and tests, never for a controller."""


@functools.cache
def trace_dtype(n: int) -> np.dtype:
    """Describe one tick as recorded for experiments."""
    return np.dtype(
        [
            ("time", _f),  # s
            ("q", _f, (n,)),  # plant, rad
            ("torque", _f, (n,)),  # command, N m
            ("position", _f, (3,)),  # tool, m
            ("error", _f, (6,)),  # x_d − x, m and rad
            ("K_task", _f, (6,)),  # in force, 1/s²
            ("D_task", _f, (6,)),  # in force, 1/s
            ("tool_force", _f, (3,)),  # board on pad by the simulator, world axes, N
            ("wrench_ee", _f, (6,)),  # as measured
            ("obstacle_force", _f),  # largest |force| of one obstacle on the arm by the simulator, N
            ("obstacle_position", _f, (MAX_OBSTACLES, 3)),  # m
            ("tau_arm", _f, (n,)),  # true external torque less the pad's, N m
            ("residual", _f, (n,)),  # N m
            ("residual_fast", _f, (n,)),  # N m
            ("mode", _i),  # of the controller: FREE, COMPLY or REJECT
            ("link", _i),
            ("ink_left", _f),  # share; filled once a policy step
        ]
    )


def point_plant(plant, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Tell a `plant_dtype` record where model and data lie; the caller keeps them alive."""
    plant["model"], plant["data"] = model._address, data._address
    for name in VIEWED:
        plant[name] = getattr(data, name).ctypes.data
    plant["qpos_spring"] = model.qpos_spring.ctypes.data


def fill_plant(plant, model: mujoco.MjModel, arm: Arm, config: WorldConfig) -> None:
    """Fill a `plant_dtype` record but for what `point_plant` does."""
    for name in ("nq", "nv", "nbody", "ngeom", "nsensordata"):
        plant[name] = getattr(model, name)
    plant["tcp_site"] = model.site(TOOL_SITE).id
    plant["delay_ticks"] = config.plant.torque_delay_ticks
    names = {model.sensor(i).name: model.sensor_adr[i] for i in range(model.nsensor)}
    for name in _SENSORS:
        plant[f"adr_{name}"] = names.get(name, -1)
    plant["n_obstacles"] = len(config.obstacles)
    for index, obstacle in enumerate(config.obstacles):
        plant["adr_obstacles"][index] = names[f"arm_obstacle{index}"]
        plant["obstacle_bodies"][index] = model.body(f"obstacle{index}").id
        plant["obstacle_springs"][index] = -1 if obstacle.fixed else model.joint(f"obstacle{index}_x").qposadr[0]
        plant["obstacle_travel"][index] = obstacle.travel
        plant["obstacle_travel_n"][index] = obstacle.travel_until_n
        plant["obstacle_travel_ticks"][index] = np.array(obstacle.travel_s) / model.opt.timestep
    plant["friction"] = arm.friction
    plant["friction"][:, 0] *= per_joint(config.plant.friction_scale, arm.n, "friction_scale")
    sensors = config.sensors
    plant["encoder_step"] = sensors.encoder_step_rad
    if math.isfinite(sensors.velocity_filter_hz):
        plant["velocity_filter_gain"] = filter_gain(2 * math.pi * sensors.velocity_filter_hz, model.opt.timestep)
    for field, value in (
        ("q_sigma", sensors.q_rad), ("qd_sigma", sensors.qd_rad_s), ("torque_sigma", sensors.torque_nm),
        ("force_sigma", sensors.force_n), ("moment_sigma", sensors.moment_nm),
        ("accelerometer_sigma", sensors.accelerometer_m_s2),
    ):  # fmt: skip
        plant[field] = value
    if arm.tool is None:
        raise InvalidInputError(f"arm '{arm.name}' has no tool; a simulated world needs one, such as robots.WIPING_PAD")
    plant["tool_mass"], plant["tool_com"] = arm.tool.inertia.mass, arm.tool.inertia.com
    plant["tcp"] = arm.tool.tcp
    if arm.tool.pad_half_size is not None:
        plant["pad_half"] = arm.tool.pad_half_size[:2]
    plant["cell"], plant["press_n"] = config.board.cell, config.board.press_n
