"""MuJoCo called from compiled code gives what MuJoCo gives when called from Python."""

import pickle

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.core import native
from contactsafe.core.errors import UnsupportedVersionError
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics


def _public(arm, q, qd):
    data = mujoco.MjData(arm.model)
    data.qpos[:], data.qvel[:] = q, qd
    mujoco.mj_forward(arm.model, data)
    return data


def test_inertia_jacobian_and_tool_frame_are_bit_identical(states):
    for arm, q, qd in states:
        data, ours = _public(arm, q, qd), arm.dynamics(q, qd)
        M, J, site = np.zeros((arm.n, arm.n)), np.zeros((6, arm.n)), arm.model.site(arm.site).id
        mujoco.mj_fullM(arm.model, data, M)
        mujoco.mj_jacSite(arm.model, data, J[:3], J[3:], site)
        assert_array_equal(ours["M"], M)
        assert_array_equal(ours["J"], J)
        assert_array_equal(ours["position"], data.site_xpos[site])
        assert_array_equal(ours["rotation"].ravel(), data.site_xmat[site])


def test_bias_torque_is_gravity_and_coriolis(states):
    for arm, q, qd in states:
        ours = arm.dynamics(q, qd)
        assert_allclose(ours["c"] + ours["g"], _public(arm, q, qd).qfrc_bias, rtol=0, atol=1e-12)
        assert_allclose(ours["g"], _public(arm, q, np.zeros(arm.n)).qfrc_bias, rtol=0, atol=1e-12)


def test_a_nominal_model_survives_pickling(panda):
    copy = pickle.loads(pickle.dumps(panda.nominal()))
    out = np.zeros(1, dtype=dynamics_dtype(panda.n))
    qd = np.full(panda.n, 0.1)
    assert update_dynamics(copy.handle, panda.home, qd, out[0])
    assert out[0] == panda.dynamics(panda.home, qd)


@pytest.mark.parametrize("version", ["3.2.7", "4.1.0", "10.0.0"])
def test_another_mujoco_is_refused_by_name(monkeypatch, version):
    monkeypatch.setattr(mujoco, "mj_versionString", lambda: version)
    with pytest.raises(UnsupportedVersionError) as caught:
        native._load_library()
    assert str(caught.value) == (
        f"mujoco {version} is installed; contactsafe calls MuJoCo natively and was checked with 3.3 to 4.0; "
        "run: pip install 'mujoco>=3.3,<4.1'"
    )
    assert isinstance(caught.value, ImportError)
