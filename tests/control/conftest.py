"""Arms that the tests of this room share."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from contactsafe import Arm
from contactsafe.robot import robots


@pytest.fixture(scope="session")
def panda():
    return robots.panda()


@pytest.fixture(scope="session")
def quick_panda(panda):
    """The same arm with motors that take any torque at once: what is left is the law."""
    return replace(panda, torque_rate_max=1e9, tau_max=np.full(7, 1e6))


@pytest.fixture(scope="session")
def six_joint_arm():
    """An arm of six joints as a user would bring it: MJCF, no description, nothing of the Panda in it."""
    axes = ["0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1"]
    body = '<site name="tip" pos="0 0 .25"/>'
    for axis in reversed(axes):
        body = f"""<body pos="0 0 .18"><joint axis="{axis}" range="-2.5 2.5" armature="0.05"/>
            <geom type="capsule" fromto="0 0 0 0.02 0.04 .15" size="0.03" mass="1.5"/>{body}</body>"""
    xml = f"""<mujoco><compiler angle="radian"/><option timestep="0.001"/>
        <default><geom contype="0" conaffinity="0"/></default><worldbody>{body}</worldbody></mujoco>"""
    return Arm(
        name="six",
        model=mujoco.MjModel.from_xml_string(xml),
        site="tip",
        q_min=np.full(6, -2.5),
        q_max=np.full(6, 2.5),
        qd_max=np.full(6, 3.0),
        tau_max=np.full(6, 60.0),
        torque_rate_max=1000.0,
        friction=np.zeros((6, 3)),
        home=np.array([0.1, 0.5, 0.9, 0.2, 0.8, 0.3]),
    )
