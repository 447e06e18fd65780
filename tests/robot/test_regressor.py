"""Momentum and β from inertial parameters are those of the compiled dynamics, for every arm there is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.robot.worlds import BALL_SHOULDER, ELBOW, SIX

from contactsafe import Payload, robots
from contactsafe.robot.description import Inertia
from contactsafe.robot.payload import carrying
from contactsafe.robot.regressor import (
    inertia_of,
    link_regressor,
    motion_of,
    nominal_terms,
    parameters_of,
    site_in_link,
)

SCENES = {"six": (SIX, "tip"), "elbow": (ELBOW, "tip"), "ball": (BALL_SHOULDER, "tip")}


def arms(tmp_path, name):
    if name in SCENES:
        text, site = SCENES[name]
        (tmp_path / "arm.xml").write_text(text, encoding="utf-8")
        return robots.from_mjcf(str(tmp_path / "arm.xml"), site)
    return {"panda": robots.panda, "fr3": robots.fr3}[name]("hand")


def moving(arm, rows=4):
    rng = np.random.default_rng(0)
    return arm.home + 0.4 * rng.normal(size=(rows, arm.n)), rng.normal(size=(rows, arm.n))


@pytest.mark.parametrize("name", ["panda", "fr3", *SCENES])
def test_they_are_those_of_the_dynamics(tmp_path, name):
    arm = arms(tmp_path, name)
    q, qd = moving(arm)
    p, beta = nominal_terms(arm, motion_of(arm, q, qd), qd, rotors=True)
    for k in range(len(q)):
        now = arm.dynamics(q[k], qd[k])
        assert_allclose(p[k], now["M"] @ qd[k], atol=1e-9)
        assert_allclose(beta[k], now["g"] - now["CT_qd"], atol=1e-9)


@pytest.mark.parametrize("mass", [1.3, -0.4])
def test_parameters_are_those_of_one_body(mass):
    body = Inertia(mass, (0.02, -0.03, 0.05), (2e-3, 3e-3, 4e-3, 1e-4, 2e-4, -3e-4))
    found = inertia_of(parameters_of(body))
    assert found.mass == mass
    assert_allclose(found.com, body.com)
    assert_allclose(found.tensor, body.tensor, atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "six"])
def test_a_payload_adds_what_its_parameters_say(tmp_path, name):
    arm = arms(tmp_path, name)
    load = Payload(1.3, np.array([0.02, -0.03, 0.05]), np.diag([2e-3, 3e-3, 4e-3]))
    loaded = carrying(arm, load)
    q, qd = moving(arm)
    motion = motion_of(arm, q, qd)
    R, origin = site_in_link(arm)
    at_link = Inertia.of(load.mass, origin + R @ load.com, R @ load.inertia @ R.T)
    p, beta = link_regressor(arm, motion, arm.n)
    with_load, without = (nominal_terms(one, motion, qd, rotors=False) for one in (loaded, arm))
    assert_allclose(p @ parameters_of(at_link), with_load[0] - without[0], atol=1e-9)
    assert_allclose(beta @ parameters_of(at_link), with_load[1] - without[1], atol=1e-9)
