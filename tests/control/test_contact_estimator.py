"""The estimator alone: it feels what touches an arm that somebody else drives, at any rate, and drives nothing."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.control.plant import Plant, controller_at, hold

from contactsafe import ContactEstimator, Measurement, presets, robots
from contactsafe.core.errors import InvalidInputError

UNTOUCHED = np.zeros(6)


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


@pytest.fixture(scope="module")
def fresh(arm):
    return ContactEstimator(arm)


@pytest.fixture
def estimator(arm, fresh):
    one = copy.copy(fresh)
    one.reset(arm.home)
    return one


def still(arm, torque=0.0, wrench=UNTOUCHED, q=None):
    """Measure an arm that stands although something puts a torque on it: its motors hold against it."""
    q = arm.home if q is None else q
    return Measurement(q, np.zeros(7), wrench, torque=arm.dynamics(q, np.zeros(7))["g"] - torque)


def feel(estimator, measurement, ticks=300):
    for _ in range(ticks):
        contact = estimator.step(measurement)
    return contact


def push_on(arm, link, force, q=None):
    """Give the joint torque of a force at the middle of a link's surface, and a point near it, (n,) and (3,)."""
    plant = Plant(arm, q)
    plant.push(f"link{link}", force)
    return plant.push_torque(), plant.data.body(f"link{link}").xipos


def test_an_arm_that_nothing_touches_feels_nothing(arm, estimator):
    contact = feel(estimator, still(arm))
    assert (contact.touched, contact.kind, contact.link, contact.in_contact) == (False, "none", 0, False)
    assert np.isnan(contact.point).all()
    assert not contact.force.any()
    assert estimator.places() == []


@pytest.mark.parametrize("wrench", [UNTOUCHED, None], ids=["with a wrench", "without"])
@pytest.mark.parametrize("link", [4, 5])
def test_a_push_is_felt_with_its_link_its_force_and_its_place(arm, estimator, link, wrench):
    force = np.array([0.0, 30.0, 0.0])
    torque, centre = push_on(arm, link, force)
    feel(estimator, still(arm, wrench=wrench), 1000)
    contact = feel(estimator, still(arm, torque, wrench), 200)
    assert contact.touched
    assert contact.kind in ("obstacle", "push")
    assert abs(contact.link - link) <= 1
    assert_allclose(contact.torque, torque, atol=0.05)
    assert np.linalg.norm(contact.point - centre) < 0.12
    assert_allclose(contact.force @ force / 30.0, 30.0, rtol=0.35)


@pytest.mark.parametrize(
    ("pushes", "several"),
    [
        ({5: (0.0, 30.0, 0.0)}, False),
        ({3: (0.0, 25.0, 0.0)}, False),
        ({3: (0.0, 30.0, 0.0), 6: (0.0, -30.0, 0.0)}, True),
        ({4: (0.0, 30.0, 0.0), 7: (0.0, -25.0, 0.0)}, True),
    ],
    ids=["link 5", "link 3", "links 3 and 6", "links 4 and 7"],
)
def test_two_contacts_that_no_single_one_explains_are_told_from_one(arm, estimator, pushes, several):
    torque = sum(push_on(arm, link, force)[0] for link, force in pushes.items())
    feel(estimator, still(arm), 500)
    assert not estimator.step(still(arm)).several
    contact = feel(estimator, still(arm, torque), 300)
    assert contact.touched
    assert contact.several is several
    assert not feel(estimator, still(arm), 500).several


def test_places_are_likeliest_first_and_sum_up_to_the_fraction(arm, estimator):
    torque, _ = push_on(arm, 5, (0.0, 30.0, 0.0))
    feel(estimator, still(arm), 500)
    feel(estimator, still(arm, torque))
    places = estimator.places(0.9)
    probabilities = [place.probability for place in places]
    assert probabilities == sorted(probabilities, reverse=True)
    assert 0.9 <= sum(probabilities) <= 1.0 + 1e-9
    assert sum(probabilities[:-1]) < 0.9
    assert len(estimator.places(0.5)) <= len(places) <= len(estimator.places(0.99))
    assert {place.link for place in places} >= {feel(estimator, still(arm, torque), 1).link}
    for place in places:
        assert 1 <= place.link <= 7
        assert np.isfinite(place.point).all()
        assert np.isfinite(place.force).all()


@pytest.mark.parametrize("fraction", [0.0, 1.5, -1.0, "all"])
def test_no_fraction_of_a_probability_is_refused(estimator, fraction):
    with pytest.raises(InvalidInputError, match="more than 0 and at most 1"):
        estimator.places(fraction)


def test_without_a_wrench_a_press_of_the_tool_is_the_tools(arm, estimator):
    J = arm.dynamics(arm.home, np.zeros(7))["J"]
    feel(estimator, still(arm, wrench=None), 1000)
    contact = feel(estimator, still(arm, J.T @ [5.0, 4.0, 20.0, 0.0, 0.0, 0.0], None))
    assert contact.kind == "tool"
    assert contact.probability > 0.5
    assert not contact.in_contact


def test_a_load_that_nobody_told_of_is_no_touch_where_it_always_was(arm, estimator):
    """It is part of the baseline of a posture; what comes on top of it shows at once."""
    J = arm.dynamics(arm.home, np.zeros(7))["J"]
    load = J.T @ [0.0, 0.0, -2.0, 0.0, 0.0, 0.0]
    feel(estimator, still(arm, load, None), 3000)
    torque, _ = push_on(arm, 4, (0.0, 12.0, 0.0))
    assert not feel(estimator, still(arm, load, None), 1).touched
    assert feel(estimator, still(arm, load + torque, None), 40).touched


@pytest.mark.parametrize("rate_hz", [90.0, 250.0, 1000.0, 2000.0])
def test_any_rate_feels_the_same_torque(arm, rate_hz):
    estimator = ContactEstimator(arm, dt=1.0 / rate_hz)
    estimator.reset(arm.home)
    torque, _ = push_on(arm, 5, (0.0, 25.0, 0.0))
    feel(estimator, still(arm), round(rate_hz))
    contact = feel(estimator, still(arm, torque), round(0.2 * rate_hz))
    assert contact.in_contact
    assert_allclose(contact.torque, torque, atol=0.02 * np.abs(torque).max())


@pytest.mark.parametrize("dt", [0.0, 1.0, -0.001, "fast", 1e-5])
def test_another_rate_is_refused(arm, dt):
    with pytest.raises(InvalidInputError, match="90 to 2000 Hz"):
        ContactEstimator(arm, dt=dt)


def test_a_command_stands_for_a_torque_that_is_not_measured(arm, estimator):
    torque, _ = push_on(arm, 4, (0.0, 25.0, 0.0))
    sent = arm.dynamics(arm.home, np.zeros(7))["g"] - torque
    measured = Measurement(arm.home, np.zeros(7), UNTOUCHED)
    for _ in range(300):
        contact = estimator.step(measured, sent)
    assert_allclose(contact.torque, torque, atol=0.05)


def test_it_feels_what_the_controller_feels(arm):
    """The same stages: a pushed arm under a controller, and an estimator that is told what the controller is told."""
    config = presets.safe()
    plant, controller, estimator = Plant(arm), controller_at(arm, config), ContactEstimator(arm, config)
    estimator.reset(arm.home)
    plant.push("link5", (0.0, 20.0, 0.0))
    for _ in range(400):
        measured = Measurement(plant.q, plant.qd, UNTOUCHED)
        out = controller.step(measured, hold(arm))
        contact = estimator.step(measured, out.torque)
        assert_allclose(contact.torque, out.contact.torque, atol=1e-6)
        assert contact.in_contact == out.contact.in_contact
        plant.step(out.torque)


def test_without_torque_and_command_nothing_can_be_felt(arm, estimator):
    with pytest.raises(InvalidInputError, match="one of them must say what drives the joints"):
        estimator.step(Measurement(arm.home, np.zeros(7)))


def test_before_a_reset_it_is_refused(arm, fresh):
    with pytest.raises(InvalidInputError, match="the estimator was not reset"):
        copy.copy(fresh).step(still(arm))


def test_after_a_gap_it_begins_anew_by_itself(arm, estimator):
    measured, elsewhere = still(arm), arm.home + 0.3
    for k in range(100):
        estimator.step(measured._replace(time=0.001 * k))
    there = still(arm, q=elsewhere)
    for k in range(500):
        contact = estimator.step(there._replace(time=5.0 + 0.001 * k))
    assert not contact.touched
    torque, _ = push_on(arm, 4, (0.0, 25.0, 0.0), elsewhere)
    for k in range(500, 800):
        contact = estimator.step(still(arm, torque, q=elsewhere)._replace(time=5.0 + 0.001 * k))
    assert contact.touched


def test_broken_numbers_raise_nothing_and_are_said(arm, estimator):
    feel(estimator, still(arm), 50)
    broken = still(arm)._replace(q=np.full(7, np.nan))
    assert [estimator.step(broken).bridged for _ in range(5)] == [1, 2, 3, 4, 5]
    assert estimator.fault.startswith("a measurement is not finite")
    contact = feel(estimator, still(arm), 50)
    assert not contact.touched
    assert contact.bridged == 0


def test_a_broken_force_sensor_does_not_blind_it(arm, estimator):
    """A column of NaN for 300 rows: nothing was felt, and nothing said so."""
    torque, _ = push_on(arm, 5, (0.0, 25.0, 0.0))
    feel(estimator, still(arm, wrench=np.full(6, np.nan)), 300)
    assert feel(estimator, still(arm, torque, np.full(6, np.nan)), 100).touched


def test_a_broken_torque_sensor_leaves_the_command(arm, estimator):
    torque, _ = push_on(arm, 4, (0.0, 25.0, 0.0))
    sent = arm.dynamics(arm.home, np.zeros(7))["g"]
    broken = Measurement(arm.home, np.zeros(7), UNTOUCHED, torque=np.full(7, np.nan))
    for _ in range(100):
        estimator.step(broken, sent)
    for _ in range(100):
        contact = estimator.step(broken, sent - torque)
    assert_allclose(contact.torque, torque, atol=0.05)


@pytest.mark.parametrize("value", [9e5, 1e200, -1e5])
def test_a_torque_that_no_joint_has_is_not_believed(arm, estimator, value):
    feel(estimator, still(arm), 100)
    absurd = still(arm)._replace(torque=np.where(np.arange(7) == 2, value, still(arm).torque))
    contact = estimator.step(absurd)
    assert contact.bridged == 1
    assert not feel(estimator, still(arm), 20).touched
    estimator.step(Measurement(arm.home, np.zeros(7), UNTOUCHED), absurd.torque)
    assert np.isfinite(feel(estimator, still(arm), 20).torque).all()


def swung(arm, k, rate_hz, hz=1.0, size=0.3):
    """Measure an arm that swings all its joints in air at a tick."""
    t, w = k / rate_hz, 2.0 * np.pi * hz
    phase = np.arange(7.0)
    q = arm.home + size * (np.sin(w * t + phase) - np.sin(phase))
    qd, qdd = size * w * np.cos(w * t + phase), -size * w * w * np.sin(w * t + phase)
    known = arm.dynamics(q, qd)
    M = known["M"] - np.diag(arm.model.dof_armature)
    return Measurement(q, qd, UNTOUCHED, t, M @ qdd + known["c"] + known["g"])


@pytest.mark.parametrize(
    ("rate_hz", "lost"),
    [(91.0, 4), (91.0, 1), (1000.0, 10), (1000.0, 1)],
    ids=["91 Hz, 4", "91 Hz, 1", "1 kHz, 10", "1"],
)
@pytest.mark.parametrize("source", ["positions", "quieter", "robot"])
def test_measurements_lost_while_the_arm_accelerates_are_no_contact(arm, rate_hz, lost, source):
    """A difference of positions is the velocity in the middle between them: after a gap that is long ago."""
    estimator = ContactEstimator(arm, presets.safe().with_(velocity_source=source), 1.0 / rate_hz)
    first = swung(arm, 0, rate_hz)
    estimator.reset(first.q, first.qd)
    for k in range(round(2.0 * rate_hz)):
        if k % 30 >= lost or k < 30:
            contact = estimator.step(swung(arm, k, rate_hz))
            assert not contact.touched
            assert not contact.in_contact


@pytest.mark.parametrize("rate_hz", [91.0, 1000.0])
def test_a_log_that_begins_amid_a_motion_begins_without_a_contact(arm, rate_hz):
    estimator = ContactEstimator(arm, dt=1.0 / rate_hz)
    start = round(0.2 * rate_hz)
    first = swung(arm, start, rate_hz)
    estimator.reset(first.q, first.qd)
    for k in range(start, start + round(rate_hz)):
        contact = estimator.step(swung(arm, k, rate_hz))
        assert not contact.touched
    assert np.abs(contact.torque).max() < 1.0


def test_time_that_was_bridged_counts_once(arm, estimator):
    feel(estimator, still(arm), 100)
    before = float(estimator.record["state"]["baseline"]["seconds"])
    for _ in range(15):
        estimator.step(still(arm)._replace(q=np.full(7, np.nan)))
    feel(estimator, still(arm), 1)
    passed = float(estimator.record["state"]["baseline"]["seconds"]) - before
    assert passed == pytest.approx(0.016, abs=0.002)


def test_an_arm_whose_surface_nobody_knows_has_a_link_and_no_place(arm):
    bare = replace(arm, surface=np.zeros((0, 7)), places=np.zeros((0, 7)), tool=None)
    estimator = ContactEstimator(bare)
    estimator.reset(bare.home)
    feel(estimator, still(bare), 300)
    contact = feel(estimator, still(bare, np.array([4.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0])), 100)
    assert contact.touched
    assert contact.link == 2
    assert np.isnan(contact.point).all()


def test_a_copy_goes_on_by_itself(arm, estimator):
    torque, _ = push_on(arm, 5, (0.0, 25.0, 0.0))
    feel(estimator, still(arm), 200)
    others = copy.deepcopy(estimator), pickle.loads(pickle.dumps(estimator))
    touched = feel(estimator, still(arm, torque), 150)
    for other in others:
        assert not feel(other, still(arm), 1).touched
        contact = feel(other, still(arm, torque), 150)
        assert contact.touched
        assert contact.link == touched.link
