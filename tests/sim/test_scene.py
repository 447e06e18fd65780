"""What a world needs of MuJoCo."""

import mujoco
import pytest

from contactsafe import robots
from contactsafe.core.errors import UnsupportedVersionError
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant


def test_mujoco_without_contact_sensors_is_named(monkeypatch):
    monkeypatch.setattr(mujoco, "mjtSensor", object())
    with pytest.raises(UnsupportedVersionError, match=r"has no contact sensors, .* pip install 'mujoco>=3\.3\.5'"):
        build_plant(robots.panda(), WorldConfig())
