"""Where a MuJoCo plant lies in memory, for compiled code."""

import mujoco
import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.robot.mjcf import TOOL_SITE
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.fixtures import MAX_FIXTURES
from contactsafe.sim.obstacles import MAX_OBSTACLES

_f = np.float64
_i = np.int64

VIEWED = (
    "ctrl", "qfrc_applied", "qfrc_constraint", "qpos", "qvel", "sensordata", "xpos", "xmat", "geom_xpos", "geom_xmat",
    "site_xpos", "site_xmat",
)  # fmt: skip
"""Arrays of MjData that compiled code reads or writes."""

_COUNTS = ("nq", "nv", "nbody", "ngeom", "nsensordata")
_BASE = ("base_force", "base_torque")
_WRIST = ("wrist_force", "wrist_torque", "wrist_accelerometer")

mujoco_dtype = np.dtype(
    [(name, np.uintp) for name in ("model", "data", *VIEWED, "qpos_spring")]
    + [(name, _i) for name in (*_COUNTS, "tcp_site", "n_fixtures", "n_obstacles")]
    + [(f"adr_{name}", _i) for name in (*_WRIST, *_BASE)]  # −1 without a sensor under the base
    + [
        ("adr_tip", _i, (MAX_FIXTURES,)),  # tip on each fixture; −1 without a tip
        ("adr_arm", _i, (MAX_FIXTURES,)),  # any part of the arm on each fixture
        ("adr_obstacles", _i, (MAX_OBSTACLES,)),
        ("obstacle_bodies", _i, (MAX_OBSTACLES,)),
        ("obstacle_springs", _i, (MAX_OBSTACLES,)),  # address of the first spring's rest length; −1 for none
        ("obstacle_travel", _f, (MAX_OBSTACLES, 3)),  # m
        ("obstacle_travel_ticks", _f, (MAX_OBSTACLES, 2)),  # departure and arrival
        ("obstacle_travel_n", _f, (MAX_OBSTACLES,)),  # force on the arm that ends the travel
        ("obstacle_stopped", _i, (MAX_OBSTACLES,)),  # 1 once that was reached
    ]
)
"""Addresses of one plant, and how its obstacles travel."""


def point_plant(plant: Record, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Tell a `mujoco_dtype` record where model and data lie; the caller keeps them alive."""
    plant["model"], plant["data"] = model._address, data._address
    for name in VIEWED:
        plant[name] = getattr(data, name).ctypes.data
    plant["qpos_spring"] = model.qpos_spring.ctypes.data


def fill_plant(plant: Record, model: mujoco.MjModel, config: WorldConfig) -> None:
    """Fill a `mujoco_dtype` record but for what `point_plant` does."""
    for name in _COUNTS:
        plant[name] = getattr(model, name)
    plant["tcp_site"] = model.site(TOOL_SITE).id
    addresses = {model.sensor(i).name: model.sensor_adr[i] for i in range(model.nsensor)}
    for name in _WRIST:
        plant[f"adr_{name}"] = addresses[name]
    for name in _BASE:
        plant[f"adr_{name}"] = addresses.get(name, -1)
    plant["n_fixtures"], plant["n_obstacles"] = len(config.fixtures), len(config.obstacles)
    for index in range(len(config.fixtures)):
        plant["adr_tip"][index] = addresses.get(f"tip_fixture{index}", -1)
        plant["adr_arm"][index] = addresses[f"arm_fixture{index}"]
    for index, obstacle in enumerate(config.obstacles):
        plant["adr_obstacles"][index] = addresses[f"arm_obstacle{index}"]
        plant["obstacle_bodies"][index] = model.body(f"obstacle{index}").id
        plant["obstacle_springs"][index] = -1 if obstacle.fixed else model.joint(f"obstacle{index}_x").qposadr[0]
        plant["obstacle_travel"][index] = obstacle.travel
        plant["obstacle_travel_n"][index] = obstacle.travel_until_n
        plant["obstacle_travel_ticks"][index] = np.array(obstacle.travel_s) / model.opt.timestep
