"""`reset` takes an arm over as it is: moving, pushed or pressed, the command goes on from the torque last sent."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold

from contactsafe import Controller, Measurement, presets
from contactsafe.core.errors import InvalidInputError

LEAST = 1e-9


def largest_step(torques, controller):
    """Largest change from one torque to the next, in parts of what the rate limit allows."""
    return np.abs(np.diff(torques, axis=0)).max() / float(controller.record["params"]["one_tick"]["torque_step"])


def postures(arm, seed):
    """Give a posture well inside the range."""
    rng = np.random.default_rng(seed)
    return arm.q_min + (arm.q_max - arm.q_min) * rng.uniform(0.3, 0.7, arm.n)


@pytest.mark.parametrize("wrench_ee", [None, UNTOUCHED])
@pytest.mark.parametrize("seed", range(4))
def test_a_moving_arm_is_braked_without_a_jump_and_without_a_false_contact(panda, seed, wrench_ee):
    """Joint speeds of up to half the limits, the torque last sent told; the first torque of all is the told one."""
    q = postures(panda, seed)
    qd = np.random.default_rng(seed).uniform(-0.5, 0.5, panda.n) * panda.qd_max
    plant, controller = Plant(panda, q), Controller(panda)
    plant.data.qvel[: panda.n] = qd
    now = panda.dynamics(q, qd)
    torque = np.array(now["g"] + now["c"])
    controller.reset(q, qd, torque)
    torques, contacts, target = [torque], [], hold(panda, q)

    def each(out):
        torques.append(out.torque)
        contacts.append(out.contact.in_contact)

    out = plant.run(controller, target, 3000, wrench_ee, each)
    assert largest_step(torques, controller) <= 1.0 + LEAST
    assert not any(contacts)
    assert np.abs(plant.qd).max() < 0.02
    assert np.linalg.norm(out.error[:3]) < 2e-3
    assert out.fault == "none"


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("link", ["link4", "link6"])
def test_an_arm_held_against_a_push_is_taken_over_without_a_jump(panda, link, told):
    """By another controller, which is told the torque, or by the same one, which knows it."""
    plant, controller = Plant(panda), controller_at(panda, presets.safe())
    target = hold(panda)
    plant.run(controller, target, 200, UNTOUCHED)
    plant.push(link, (0.0, 25.0, 0.0))
    out = plant.run(controller, target, 1500, UNTOUCHED)
    assert out.contact.kind == "push"
    torques = [out.torque]
    if told:
        controller = Controller(panda)
        controller.reset(plant.q, plant.qd, out.torque)
    else:
        controller.reset(plant.q, plant.qd)
    out = plant.run(controller, target, 1500, UNTOUCHED, lambda out: torques.append(out.torque))
    assert largest_step(torques, controller) <= 1.0 + LEAST
    assert out.contact.kind == "push"
    assert np.linalg.norm(out.error[:3]) < 0.01


def test_before_the_first_good_measurement_the_torque_told_is_repeated(panda):
    controller, torque = Controller(panda), np.linspace(-3.0, 3.0, panda.n)
    controller.reset(panda.home, torque=torque)
    bad = Measurement(np.full(panda.n, np.nan), np.zeros(panda.n))
    assert_array_equal(controller.step(bad, hold(panda)).torque, torque)


def test_the_torque_told_outlives_bad_measurements_and_another_reset(panda):
    """Nothing was measured in between: the arm is still under the torque that was repeated."""
    controller, torque = Controller(panda), np.linspace(-3.0, 3.0, panda.n)
    controller.reset(panda.home, torque=torque)
    controller.step(Measurement(np.full(panda.n, np.nan), np.zeros(panda.n)), hold(panda))
    controller.reset(panda.home)
    assert_array_equal(controller.record["state"]["command"]["tau"], torque)


def test_a_sample_that_cannot_be_true_does_not_make_an_arm_seem_elsewhere(panda):
    plant, controller = Plant(panda), controller_at(panda, presets.safe())
    plant.push("link5", (0.0, 25.0, 0.0))
    plant.run(controller, hold(panda), 300)
    sent = controller.step(Measurement(plant.q + 0.9, plant.qd), hold(panda)).torque
    controller.reset(plant.q, plant.qd)
    assert_array_equal(controller.record["state"]["command"]["tau"], sent)


def test_an_arm_found_elsewhere_is_taken_to_be_held_by_gravity_compensation(panda):
    """A new episode of a simulation, or an arm that was led away by hand: the last command means nothing there."""
    plant, controller = Plant(panda), controller_at(panda, presets.safe())
    plant.push("link5", (0.0, 25.0, 0.0))
    plant.run(controller, hold(panda), 300)
    q = postures(panda, 0)
    controller.reset(q)
    assert_allclose(
        controller.record["state"]["command"]["tau"], panda.dynamics(q, np.zeros(panda.n))["g"], rtol=0, atol=1e-12
    )


@pytest.mark.parametrize(
    ("told", "text"),
    [
        ({"qd": np.zeros(6)}, "qd has shape (6,); give 7 finite numbers"),
        ({"qd": np.full(7, np.inf)}, "qd[0] = inf; every number must be finite"),
        ({"torque": 0.0}, "torque has shape (); give 7 finite numbers"),
        (
            {"torque": np.full(7, -90.0)},
            "torque[0] = -90 N m is outside [-87, 87]; give the joint torque last sent, in N m",
        ),
    ],
)
def test_what_is_told_of_the_arm_is_checked_and_changes_nothing_when_refused(panda, told, text):
    controller = controller_at(panda, presets.safe())
    before = controller.record.copy()
    with pytest.raises(InvalidInputError) as caught:
        controller.reset(panda.home, **told)
    assert str(caught.value) == text
    assert controller.record == before
