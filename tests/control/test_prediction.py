"""What stands in for a missing measurement moves as the nominal dynamics say, within what the arm can do."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe.control.codes import COMPLY, FREE
from contactsafe.control.params import arm_dtype
from contactsafe.control.prediction import net_torque, predict
from contactsafe.control.records import arm_state_dtype, params_dtype, state_dtype
from contactsafe.robot.dynamics import dynamics_dtype

N = 3
VECTORS = st.lists(st.floats(-5.0, 5.0), min_size=N, max_size=N).map(np.array)
M_INV = np.linalg.inv(np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.2], [0.1, 0.2, 0.5]]))


def bounds(q=3.0, qd=10.0):
    known = np.zeros(1, arm_dtype(N))
    known["q_least"], known["q_most"], known["qd_most"] = -q, q, qd
    return known[0]


@given(VECTORS, VECTORS)
def test_acceleration_is_that_of_the_net_torque(qd, net):
    arm = np.zeros(1, arm_state_dtype(N))
    arm["qd"] = qd
    predict(arm[0], net, M_INV, 0.001, bounds())
    assert_allclose(arm["qd"][0], qd + 0.001 * M_INV @ net, rtol=0, atol=1e-12)
    assert_allclose(arm["q"][0], 0.001 * arm["qd"][0], rtol=0, atol=1e-12)


@given(VECTORS, st.floats(0.001, 1.0))
def test_what_is_predicted_stays_within_what_the_arm_can_do(net, dt):
    arm = np.zeros(1, arm_state_dtype(N))
    for _ in range(50):
        predict(arm[0], 1e3 * net, M_INV, dt, bounds(q=0.5, qd=2.0))
        assert np.abs(arm["q"]).max() <= 0.5
        assert np.abs(arm["qd"]).max() <= 2.0


def test_a_contact_goes_on_but_not_while_the_arm_is_braked():
    state, dynamics = np.zeros(1, state_dtype(N)), np.zeros(1, dynamics_dtype(N))
    params = np.zeros(1, params_dtype(N))[0]["observer"]
    state["command"]["tau"], dynamics["g"] = 3.0, 1.0
    state["observer"]["residual"], state["observer"]["residual_fast"] = 0.5, 7.0
    for mode, braking, expected in ((FREE, 0, 2.5), (COMPLY, 0, 9.0), (FREE, 1, 2.5), (COMPLY, 1, 2.0)):
        state["mode"], state["clock"]["braking"] = mode, braking
        assert_allclose(net_torque(state[0], dynamics[0], params, np.zeros(N)), expected)
