"""Link masses are identified while nothing touches the arm; that comes off the residual and the threshold."""

import copy

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold, reach

from contactsafe import presets
from contactsafe.control.laws import identify_masses
from contactsafe.robot.dynamics import dynamics_dtype, mass_regressor, update_dynamics

SAFE = presets.safe().with_(friction_compensation=False)
PATH = ([0.05, 0.1, 0.05], [-0.1, 0.1, 0.05], [-0.1, -0.15, 0.1], [0.05, -0.1, -0.1])

ANY = np.full(8, np.inf)
"""No bound on the mass of a link."""


def psd(A):
    return np.linalg.eigvalsh(0.5 * (A + A.T))[0] > -1e-12 * max(np.abs(A).max(), 1.0)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_readings_only_ever_narrow_what_is_believed(seed, m):
    """P_before − P_after and P_after are positive semi-definite whatever is read."""
    rng = np.random.default_rng(seed)
    error, P = np.zeros(m), np.diag(rng.uniform(1e-4, 1.0, m))
    for _ in range(30):
        before = P.copy()
        row = rng.normal(size=m) * 10.0 ** rng.uniform(-2, 2)
        identify_masses(error, P, row, rng.normal() * 5.0, rng.uniform(0.01, 2.0), ANY)
        assert psd(P)
        assert psd(before - P)
        assert np.isfinite(error).all()


@given(st.integers(0, 2**32 - 1))
def test_masses_are_found_from_readings_of_an_arm_at_rest(seed):
    rng = np.random.default_rng(seed)
    truth, error, P = rng.uniform(-0.1, 0.1, 8), np.zeros(8), 0.01 * np.eye(8)
    for _ in range(400):
        row = rng.normal(size=8) * 5.0
        identify_masses(error, P, row, row @ (truth - error), 0.01, ANY)
    assert_allclose(error, truth, rtol=0, atol=2e-3)


def test_gravity_of_an_arm_is_found_from_a_few_postures(panda):
    """Not every link's mass shows by itself in joint torques; what they come to at other postures does."""
    rng, nominal = np.random.default_rng(2), panda.nominal()
    truth, error, P = rng.choice([-0.1, 0.1], 8), np.zeros(8), 0.01 * np.eye(8)

    def regressor():
        rows = np.zeros((7, 8))
        q = rng.uniform(panda.q_min, panda.q_max)
        update_dynamics(nominal.handle, q, np.zeros(7), np.zeros(1, dtype=dynamics_dtype(7))[0])
        mass_regressor(nominal.handle, rows)
        return rows

    for _ in range(60):
        for row in regressor():
            identify_masses(error, P, row, row @ (truth - error), 0.01, ANY)
    rows = np.concatenate([regressor() for _ in range(50)])
    assert np.abs(rows @ truth).max() > 1.0
    assert np.abs(rows @ (truth - error)).max() < 0.05 * np.abs(rows @ truth).max()


def heavier(arm, scale):
    """Give the arm's model with the masses and inertias of its links scaled, the tool's left."""
    model = copy.deepcopy(arm.model)
    links = slice(int(model.jnt_bodyid[0]), int(model.jnt_bodyid[0]) + arm.n)
    model.body_mass[links] *= scale
    model.body_inertia[links] *= scale
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def moved(arm, config, model=None):
    """Move about for 2 s; give the controller, its plant, the mean residual of the last 0.25 s and contact ticks."""
    plant, controller, seen, contacts = Plant(arm, model=model), controller_at(arm, config), [], 0
    for offset in PATH:
        target = reach(arm, offset)
        for _ in range(500):
            out = plant.run(controller, target, 1, UNTOUCHED)
            seen.append(out.residual)
            contacts += out.contact.in_contact
    return controller, plant, np.mean(seen[-250:], axis=0), contacts


@pytest.mark.parametrize("scale", [1.1, 0.9])
def test_links_that_weigh_ten_percent_more_or_less_do_not_show_after_two_seconds(panda, scale):
    """Bias of the residual 0.31 to 0.35 N m; 2.1 N m where the model is trusted."""
    *_, correction, contacts = moved(panda, SAFE, heavier(panda, scale))
    trusting = SAFE.with_(mass_uncertainty=0.0, contact_aware=False)  # or what it takes for contact moves the arm
    *_, trusted, _ = moved(panda, trusting, heavier(panda, scale))
    assert np.abs(correction).max() < 0.5
    assert np.abs(trusted).max() > 1.5
    assert contacts == 0


def test_arm_as_modelled_is_found_to_weigh_what_its_model_says(panda):
    controller, *_ = moved(panda, SAFE)
    assert np.abs(controller.record["state"]["link_masses"]["mass_error"]).max() < 0.01


def test_threshold_falls_as_the_weight_becomes_known(panda):
    """From the fraction of the unknown weight down to δ and little more, at rest in the posture it was found in."""
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 1, UNTOUCHED)
    first = controller.record["state"]["detection"]["threshold"].copy()
    plant.run(controller, hold(panda), 2000, UNTOUCHED)
    last = controller.record["state"]["detection"]["threshold"]
    assert first.max() > SAFE.detection.residual_threshold + 1.5
    assert (last <= first + 1e-12).all()
    assert last.max() < SAFE.detection.residual_threshold + 0.5


def test_nothing_is_learned_in_contact(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 500, UNTOUCHED)
    plant.push("link5", (0.0, 25.0, 0.0))
    while not plant.run(controller, hold(panda), 1, UNTOUCHED).contact.in_contact:
        pass
    before = controller.record["state"]["link_masses"].copy()
    out = plant.run(controller, hold(panda), 1000, UNTOUCHED)
    assert out.contact.in_contact
    assert_array_equal(controller.record["state"]["link_masses"]["mass_error"], before["mass_error"])


def test_thresholds_do_not_grow_while_touches_follow_each_other(panda):
    """What was identified was forgotten in contact: joint 2 went from 2.2 to 4 N m in 5 s, and touches were missed."""
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 1500, UNTOUCHED)
    before = controller.record["state"]["link_masses"]["covariance"].copy()
    plant.push("link5", (0.0, 25.0, 0.0))
    plant.run(controller, hold(panda), 5000, UNTOUCHED)
    after = controller.record["state"]["link_masses"]["covariance"]
    assert (np.diag(after) <= 1.05 * np.diag(before)).all()


def test_nothing_is_learned_where_a_hand_could_hold_the_tool_unseen(panda):
    """Without a force sensor what hangs on the tool would be taken for weight of the links."""
    plant, controller = Plant(panda, model=heavier(panda, 1.1)), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 1000)
    assert not controller.record["state"]["link_masses"]["mass_error"].any()


def test_model_that_is_trusted_is_not_weighed(panda):
    controller, *_ = moved(panda, presets.paper(), heavier(panda, 1.05))
    assert not controller.record["state"]["link_masses"]["mass_error"].any()


def test_lasting_push_below_the_threshold_is_not_taken_for_a_weight_that_cannot_be(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 300, UNTOUCHED)
    plant.push("link4", (0.0, 0.0, -22.0))
    plant.run(controller, hold(panda), 5000, UNTOUCHED)
    assert (
        np.abs(controller.record["state"]["link_masses"]["mass_error"]).max() < 5 * SAFE.identification.mass_uncertainty
    )


def test_what_is_learned_does_not_move_the_arm(panda):
    """In free motion the command is that of an arm which learns nothing, but for what joint stops make of it."""
    commands = []
    for config in (SAFE, SAFE.with_(mass_uncertainty=0.0, payload_uncertainty_kg=0.0)):
        plant, controller = Plant(panda, model=heavier(panda, 1.03)), controller_at(panda, config)
        seen = []
        for offset in PATH:
            for _ in range(300):
                seen.append(plant.run(controller, reach(panda, offset), 1, UNTOUCHED).torque)
        assert not controller.record["output"]["mode"]
        commands.append(seen)
        if config is SAFE:
            assert np.abs(controller.record["state"]["link_masses"]["gravity_correction"]).max() > 0.3
    assert_allclose(commands[0], commands[1], rtol=0, atol=0.06)


@pytest.mark.parametrize("wrench", [None, UNTOUCHED])
def test_not_knowing_does_not_grow_beyond_what_it_was_at_first(panda, wrench):
    """Without a force sensor no mass is identified; thresholds would otherwise rise until nothing is detected."""
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    plant.run(controller, hold(panda), 1, wrench)
    first = controller.record["state"]["link_masses"]["gravity_sigma"].copy()
    plant.run(controller, hold(panda), 3000, wrench)
    assert (controller.record["state"]["link_masses"]["gravity_sigma"] <= first + 1e-9).all()


def test_a_threshold_without_end_keeps_the_torque_finite(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE.with_(residual_threshold=np.inf))
    out = plant.run(controller, reach(panda, PATH[0]), 300, UNTOUCHED)
    assert np.isfinite(out.torque).all()
    assert out.fault == "none"
