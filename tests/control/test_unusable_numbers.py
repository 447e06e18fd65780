"""A tick never raises and never sends a number that is not finite, whatever it is fed."""

import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import Plant, controller_at, hold, reach

from contactsafe import Measurement, presets
from contactsafe.control.codes import FAULTS
from contactsafe.control.controller import Controller
from contactsafe.control.tick import tick_at

CONFIG = presets.safe().with_(friction_compensation=False)
UNUSABLE = [np.nan, np.inf, -np.inf, 1e6, -1e200]


@pytest.fixture
def running(panda):
    """A controller at home after one good tick of a target that is not where it stands, and its records."""
    records = np.zeros(1, dtype=Controller(panda, CONFIG).record.dtype)
    controller = controller_at(panda, CONFIG, records=records)
    controller.set_target(reach(panda, [0.01, 0.01, 0.01]))
    records[0]["measurement"]["q"] = panda.home
    tick_at(records, 0)
    assert records[0]["output"]["fault"] == 0
    return controller, records


@pytest.mark.parametrize("value", UNUSABLE)
@pytest.mark.parametrize("field", ["q", "qd", "wrench_ee"])
def test_unusable_measurement_is_bridged(running, field, value):
    """The law goes on with what it should have been: here, with what a good measurement of an arm at rest brings."""
    _, records = running
    good = copy.deepcopy(records)
    records[0]["measurement"]["has_wrench"] = 1
    records[0]["measurement"][field][3] = value
    tick_at(records, 0)
    tick_at(good, 0)
    assert np.abs(records[0]["output"]["torque"] - good[0]["output"]["torque"]).max() < 0.2
    assert records[0]["output"]["bridged"] == 1
    assert FAULTS[int(records[0]["output"]["fault"])] == (
        "a measurement is not finite or beyond what the arm can do; it was bridged by a prediction"
    )


def test_a_broken_force_sensor_made_the_arm_blind_to_its_joints(panda):
    """It is braked, and by its joints: without stiction a blind brake drifted by a metre."""
    plant, controller = Plant(panda), controller_at(panda, CONFIG)
    target, broken = reach(panda, [0.1, 0.0, 0.0]), np.full(6, np.nan)
    plant.run(controller, target, 300, np.zeros(6))
    out = plant.run(controller, target, 1500, broken)
    assert out.braked
    assert out.fault == FAULTS[5]
    assert out.bridged == 0
    assert np.abs(plant.qd).max() < 0.01
    assert np.linalg.norm(plant.tool_position() - panda.tool_pose(panda.home).position) < 0.15


def test_a_wrench_that_is_not_measured_is_not_looked_at(running):
    _, records = running
    records[0]["measurement"]["wrench_ee"] = np.nan
    tick_at(records, 0)
    assert records[0]["output"]["fault"] == 0


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [(field, value, FAULTS[2]) for field in ("position", "quat", "K_task", "D_task", "q_posture") for value in UNUSABLE]
    + [
        ("quat", 0.9, "target quaternion is not of unit length; the last good target holds"),
        ("K_task", 9.99, "target stiffness or damping is out of range; the last good target holds"),
        ("K_task", 1500.1, "target stiffness or damping is out of range; the last good target holds"),
        ("D_task", 1.99, "target stiffness or damping is out of range; the last good target holds"),
        ("D_task", 120.1, "target stiffness or damping is out of range; the last good target holds"),
    ],
)
def test_unusable_target_leaves_the_last_good_one_in_force(running, field, value, text):
    _, records = running
    good = copy.deepcopy(records)
    records[0]["target"][field][2] = value
    for k in range(3):
        tick_at(records, 0)
        tick_at(good, 0)
        assert_array_equal(records[0]["output"]["torque"], good[0]["output"]["torque"], err_msg=f"tick {k}")
    assert FAULTS[2] == "target is not finite or absurdly large; the last good target holds"
    assert FAULTS[int(records[0]["output"]["fault"])] == text


def test_fault_stays_until_reset_and_is_the_first(running, panda):
    controller, records = running
    records[0]["target"]["K_task"] = 5.0
    tick_at(records, 0)
    records[0]["target"]["K_task"] = 150.0
    records[0]["target"]["quat"] = 2.0
    for _ in range(3):
        tick_at(records, 0)
    assert records[0]["output"]["fault"] == 4
    controller.reset(panda.home)
    assert controller.step(Measurement(panda.home, np.zeros(7)), hold(panda)).fault == "none"


def test_after_twenty_unusable_measurements_the_arm_is_braked(panda):
    """It gets there by at most 1 N m a tick, says so, and ends with the gravity of the posture that it believes in."""
    plant, controller = Plant(panda), controller_at(panda, CONFIG)
    target = reach(panda, [0.05, 0.05, 0.05])
    out = plant.run(controller, target, 30)
    blind = Measurement(np.full(7, np.nan), np.zeros(7))
    for k in range(600):
        assert (out.fault == FAULTS[5]) == (k > 20)
        before, out = out.torque, controller.step(blind, target)
        assert np.abs(out.torque - before).max() <= 1.0
    g = panda.dynamics(controller.record["state"]["arm"]["q"], np.zeros(7))["g"]
    assert_allclose(out.torque, g, rtol=0, atol=0.05)
    assert FAULTS[5] == "measurements stayed unusable for over 20 ticks; the arm was braked until reset"


def test_reset_forgets_what_was_reported(panda):
    """A contact of before the reset was reported again when the first measurement after it was unusable."""
    plant, controller = Plant(panda), controller_at(panda, CONFIG)
    plant.push("link5", (0.0, 40.0, 0.0))
    assert plant.run(controller, hold(panda), 300).contact.in_contact
    controller.reset(panda.home)
    assert not controller.step(Measurement(np.full(7, np.nan), np.zeros(7)), hold(panda)).contact.in_contact


def test_arm_dropped_when_the_very_first_measurement_was_unusable(panda):
    controller = controller_at(panda, CONFIG)
    g = panda.dynamics(panda.home, np.zeros(7))["g"]
    for _ in range(30):
        out = controller.step(Measurement(np.full(7, np.nan), np.zeros(7)), hold(panda))
        assert_allclose(out.torque, g, rtol=0, atol=1e-12)


@pytest.mark.parametrize("gap", [1, 10, 19, 40])
def test_gap_in_the_measurements_was_taken_for_a_contact(panda, gap):
    """The momentum gained during the gap was divided by one tick."""
    plant, controller = Plant(panda), controller_at(panda, CONFIG)
    target = reach(panda, [0.1, 0.1, 0.0])
    plant.run(controller, target, 100)
    for _ in range(gap):
        plant.step(controller.step(Measurement(plant.q, np.full(7, np.nan)), target).torque)
    seen = []
    plant.run(controller, target, 50, each=lambda out: seen.append(np.abs(out.contact.torque).max()))
    assert max(seen) < 0.05


def test_random_nonsense_never_gives_a_torque_that_is_not_finite(panda):
    rng = np.random.default_rng(11)
    records = np.zeros(1, dtype=Controller(panda, CONFIG).record.dtype)
    controller = controller_at(panda, CONFIG, records=records)
    good = Measurement(panda.home, np.zeros(7))
    g = before = controller.step(good, hold(panda)).torque
    for _ in range(3000):
        c = records[0]
        for group in ("measurement", "target"):
            for name in c[group].dtype.names:
                if name not in ("has_wrench", "has_torque", "has_base", "has_time", "kept") and rng.random() < 0.3:
                    scale = 10.0 ** rng.integers(-300, 300)
                    c[group][name] = rng.choice([0.0, 1.0, scale, np.nan, np.inf], c[group][name].shape)
        c["measurement"]["has_wrench"] = rng.integers(2)
        tick_at(records, 0)
        torque = c["output"]["torque"].copy()
        assert np.isfinite(torque).all()
        assert (np.abs(torque) <= panda.tau_max).all()
        assert np.abs(torque - before).max() <= 1.0
        before = torque
        if rng.random() < 0.3:
            c["measurement"]["q"], c["measurement"]["qd"] = panda.home, rng.normal(size=7)
    controller.reset(panda.home, torque=g)
    assert_allclose(controller.step(good, hold(panda)).torque, g, rtol=0, atol=1e-9)
