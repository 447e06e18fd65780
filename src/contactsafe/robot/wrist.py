"""The wrench on the tool from MuJoCo's sensors at the wrist: what is left without the tool's weight and inertia."""

from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.names import JOINT, SENSOR, SITE, find, label, listed

_FORCE, _TORQUE = mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE
_ACCELEROMETER = mujoco.mjtSensor.mjSENS_ACCELEROMETER


class WristNames(NamedTuple):
    """Names of the sensors at the wrist; None for the only one between the last joint and the tool.

    Attributes:
        force, torque: sensors at one and the same site.
        accelerometer: anywhere on what the sensors carry, best at its centre of mass.
    """

    force: str | None = None
    torque: str | None = None
    accelerometer: str | None = None


class Wrist(NamedTuple):
    """Where the sensors at the wrist are, and what they carry.

    Attributes:
        force, torque: first of three readings in `data.sensordata`.
        accelerometer: likewise, −1 without one.
        site: that force and torque are measured at.
        accelerometer_site: that acceleration is measured at.
        body: root of what they carry.
        mass: of it, kg.
        gravity: world, (3,), m/s².
        tool: site of the tool point.
    """

    force: int
    torque: int
    accelerometer: int
    site: int
    accelerometer_site: int
    body: int
    mass: float
    gravity: np.ndarray
    tool: int

    def wrench(self, data: mujoco.MjData) -> np.ndarray:
        """Return the environment's wrench on the tool about the tool point, world axes, (6,), N and N m.

        The sensors read what the arm exerts on what it carries. With the specific force a of the centre of mass c,
        f_env = m a − f_read and t_env = (c − s) × m a − t_read about the sensors' site s. Without an accelerometer
        a = −g: right at rest, and off by the tool's inertia in motion. That of turning is left in.
        """
        R = data.site_xmat[self.site].reshape(3, 3)
        a = -self.gravity
        if self.accelerometer >= 0:
            a = data.site_xmat[self.accelerometer_site].reshape(3, 3) @ self._read(data, self.accelerometer)
        origin = data.site_xpos[self.site]
        force = self.mass * a - R @ self._read(data, self.force)
        moment = np.cross(data.subtree_com[self.body] - origin, self.mass * a) - R @ self._read(data, self.torque)
        return np.concatenate([force, moment - np.cross(data.site_xpos[self.tool] - origin, force)])

    @staticmethod
    def _read(data: mujoco.MjData, address: int) -> np.ndarray:
        return data.sensordata[address : address + 3]


def find_wrist(model: mujoco.MjModel, last_joint: str, tool: str, names: WristNames) -> Wrist:
    """Find the sensors at the wrist.

    Args:
        model: of the scene.
        last_joint: of the arm.
        tool: site of the tool point.
        names: of the sensors.

    Raises:
        InvalidInputError: there are none, or several and none is named; force and torque are measured at different
            sites; or a sensor is not on what the last joint moves.
    """
    point, last = find(model, SITE, tool), int(model.jnt_bodyid[find(model, JOINT, last_joint)])
    carriers = _path(model, int(model.site_bodyid[point]), last)
    force = _sensor(model, "force", _FORCE, names.force, carriers)
    torque = _sensor(model, "torque", _TORQUE, names.torque, carriers)
    site = int(model.sensor_objid[force])
    if model.sensor_objid[torque] != site:
        raise InvalidInputError(
            f"sensors {label(model, SENSOR, force)} and {label(model, SENSOR, torque)} are at different sites; "
            "give force and torque of one"
        )
    body = int(model.site_bodyid[site])
    if last not in _path(model, body, 0):
        raise InvalidInputError(
            f"sensor {label(model, SENSOR, force)} is not on what joint '{last_joint}' moves; give one that is"
        )
    accelerometer = _accelerometer(model, names.accelerometer, body)
    weightless = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    return Wrist(
        force=int(model.sensor_adr[force]),
        torque=int(model.sensor_adr[torque]),
        accelerometer=-1 if accelerometer < 0 else int(model.sensor_adr[accelerometer]),
        site=site,
        accelerometer_site=-1 if accelerometer < 0 else int(model.sensor_objid[accelerometer]),
        body=body,
        mass=float(model.body_subtreemass[body]),
        gravity=np.zeros(3) if weightless else model.opt.gravity.copy(),
        tool=point,
    )


def _path(model: mujoco.MjModel, body: int, root: int) -> list[int]:
    """Return the bodies from one up to another above it, both included; the world where that is not above it."""
    path = [body]
    while path[-1] not in (root, 0):
        path.append(int(model.body_parentid[path[-1]]))
    return path


def _sensor(model: mujoco.MjModel, word: str, kind, name: str | None, bodies: list[int]) -> int:
    """Return the sensor of a kind and a name, or the only one of that kind on some bodies."""
    if name is not None:
        sensor = find(model, SENSOR, name)
        if model.sensor_type[sensor] != kind:
            raise InvalidInputError(f"sensor '{name}' measures no {word}; give the name of one that does")
        return sensor
    found = [i for i in _sensors(model, kind) if model.site_bodyid[model.sensor_objid[i]] in bodies]
    if len(found) != 1:
        names = listed(label(model, SENSOR, i) for i in found)
        raise InvalidInputError(
            f"{len(found)} {word} sensors between the last joint and the tool ({names}), one is needed; "
            f'add <{word} site="..."/>, or name one: arm.bind(model, wrist=WristNames({word}="..."))'
        )
    return found[0]


def _accelerometer(model: mujoco.MjModel, name: str | None, body: int) -> int:
    """Return the accelerometer of a name, or the only one that moves with a body; −1 without one."""
    if name is not None:
        return _sensor(model, "acceleration", _ACCELEROMETER, name, [])
    sites = {i: int(model.site_bodyid[model.sensor_objid[i]]) for i in _sensors(model, _ACCELEROMETER)}
    found = [i for i, of in sites.items() if model.body_weldid[of] == model.body_weldid[body]]
    return found[0] if len(found) == 1 else -1


def _sensors(model: mujoco.MjModel, kind) -> list[int]:
    return [int(i) for i in np.flatnonzero(model.sensor_type == int(kind))]
