"""The chain's kinematics are the nominal model's."""

import numpy as np
from numpy.testing import assert_allclose

from contactsafe.robot.chain import chain_kinematics, chain_of


def test_places_the_tool_and_its_jacobian_as_mujoco_does(states):
    for arm, q, qd in states:
        there = arm.dynamics(q, qd)
        position, rotation, J = np.empty(3), np.empty((3, 3)), np.empty((6, arm.n))
        chain_kinematics(chain_of(arm), q, position, rotation, J)
        assert_allclose(position, there["position"], rtol=0, atol=1e-12)
        assert_allclose(rotation, there["rotation"], rtol=0, atol=1e-12)
        assert_allclose(J, there["J"], rtol=0, atol=1e-12)
