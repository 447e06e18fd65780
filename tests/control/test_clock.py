"""Ticks late, measurements lost, frozen, repeated or impossible: bridged within bounds, then braked, and it is said."""

import copy
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold, reach, wrist_meets_sphere

from contactsafe import Measurement, presets
from contactsafe.control.codes import FAULTS
from contactsafe.control.controller import Controller
from contactsafe.control.tick import tick_at
from contactsafe.core.errors import InvalidInputError

CONFIG = presets.safe().with_(friction_compensation=False)
NAN = np.full(7, np.nan)
AT = 150
"""Tick at which something happens to the clock; the tool then moves at 0.2 m/s."""


@dataclass
class Run:
    """What became of a run: tool positions, torques, outputs of the ticks in which the controller was called."""

    plant: Plant
    controller: Controller
    positions: np.ndarray
    torques: np.ndarray
    outputs: list

    @property
    def contacts(self):
        return sum(out.contact.in_contact for out in self.outputs)

    @property
    def fault(self):
        return self.outputs[-1].fault

    def away(self, other):
        return np.linalg.norm(self.positions - other.positions, axis=1).max()

    def step(self):
        return np.abs(np.diff(self.torques, axis=0)).max()


def sweep(panda):
    """Give the targets of a tool that goes 11 cm in half a second and stays there."""

    def target(k):
        fraction = min(k / 500, 1.0)
        return reach(panda, [0.0, 0.1 * fraction, 0.05 * fraction])

    return target


def run(panda, seen=lambda k, m, past: m, ticks=700, timed=False, wrench=UNTOUCHED, target=None, plant=None):
    """Drive the arm; `seen` makes of the measurement at tick k what the controller sees, None where it is not called.

    A controller that is not called leaves its torque in force. `past` has the measurements as they were seen.
    """
    plant = plant or Plant(panda)
    controller, target = controller_at(panda, CONFIG), target or sweep(panda)
    past, positions, torques, outputs = [], [], [], []
    for k in range(ticks):
        measurement = seen(k, Measurement(plant.q, plant.qd, wrench, 0.001 * k if timed else None), past)
        if measurement is not None:
            past.append(measurement)
            outputs.append(controller.step(measurement, target(k)))
            torques.append(outputs[-1].torque)
        plant.step(torques[-1])
        positions.append(plant.tool_position())
    return Run(plant, controller, np.array(positions), np.array(torques), outputs)


@pytest.fixture(scope="module")
def calm(panda):
    """The same sweep with nothing wrong."""
    return run(panda)


def late(n, at=AT):
    return lambda k, m, past: None if at <= k < at + n else m


def lost(n, at=AT):
    return lambda k, m, past: m._replace(qd=NAN) if at <= k < at + n else m


def frozen(n, at=AT):
    return lambda k, m, past: past[at - 1] if at <= k < at + n else m


def off(field, joint, by, n=1):
    def seen(k, m, past):
        value = getattr(m, field).copy()
        if AT <= k < AT + n:
            value[joint] += by
        return m._replace(**{field: value})

    return seen


def every(period):
    return lambda k, m, past: m if k % period == 0 else None


@pytest.mark.parametrize("timed", [False, True], ids=["untimed", "timed"])
@pytest.mark.parametrize(
    "seen",
    [
        pytest.param(late(2), id="tick 2 ms late"),
        pytest.param(late(19), id="tick 19 ms late"),
        pytest.param(late(20), id="tick 20 ms late"),
        pytest.param(late(19, 20), id="tick 19 ms late, setting off"),
        pytest.param(lost(20), id="20 measurements lost"),
        pytest.param(frozen(20), id="frozen for 20 ms"),
        pytest.param(lambda k, m, past: past[k - 1] if k % 2 else m, id="every measurement twice"),
        pytest.param(every(2), id="500 Hz with dt = 1 ms"),
        pytest.param(off("qd", 1, 0.2), id="one sample of qd + 0.2 rad/s"),
        pytest.param(off("qd", 0, -0.05), id="one sample of qd - 0.05 rad/s"),
        pytest.param(off("qd", 5, 3.0), id="one sample of qd + 3 rad/s"),
        pytest.param(off("q", 3, 0.05), id="one sample of q + 0.05 rad"),
        pytest.param(off("q", 2, -2.0, 10), id="ten samples of q - 2 rad"),
        pytest.param(off("q", 0, 9e5), id="q of 9e5 rad counted as usable"),
    ],
)
def test_a_clock_out_of_step_was_a_second_of_false_contact(panda, calm, seen, timed):
    """And the tool went astray by up to 20 cm."""
    found = run(panda, seen, timed=timed)
    assert found.contacts == 0
    assert found.step() <= 1.0
    assert found.away(calm) < 0.002
    assert found.fault in (FAULTS[0], FAULTS[1])


def test_250_hz_with_dt_of_1_ms_was_a_contact(panda, calm):
    found = run(panda, every(4), timed=True)
    assert found.contacts == 0
    assert found.away(calm) < 0.002


def test_ticks_at_random_times_were_contacts(panda, calm):
    """One to five milliseconds between two ticks, their time given."""
    called = np.random.default_rng(5).random(700) < 0.4
    found = run(panda, lambda k, m, past: m if called[k] or k == 0 else None, timed=True)
    assert found.contacts == 0
    assert found.away(calm) < 0.002


def test_sub_tick_jitter_leaves_no_residual(panda):
    """The plant steps at 20 kHz, and ticks come 0.5 to 1.5 ms after each other: with their time, nothing is felt."""
    plant, rng = Plant(panda), np.random.default_rng(3)
    plant.model.opt.timestep = 5e-5
    try:
        controller, seen, time = controller_at(panda, CONFIG), [], 0.0
        for _ in range(500):
            target = sweep(panda)(1000 * time)
            out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED, time), target)
            seen.append(np.abs(out.contact.torque).max())
            steps = int(rng.integers(10, 31))
            time += steps * 5e-5
            for _ in range(steps):
                plant.step(out.torque)
    finally:
        plant.model.opt.timestep = 0.001
    assert max(seen) < 0.1


@pytest.mark.parametrize("timed", [False, True], ids=["untimed", "timed"])
@pytest.mark.parametrize("times", [2, 5, 10])
def test_a_source_slower_than_the_loop_was_taken_for_a_slow_loop(panda, calm, times, timed):
    """Each measurement so many times: of ten a call was believed to be ten ticks, and a moving arm was braked."""
    found = run(panda, lambda k, m, past: past[-1] if k % times else m, timed=timed)
    assert found.contacts == 0
    assert found.away(calm) < 0.002
    assert found.step() <= 1.0
    assert found.fault == "none"
    assert max(out.bridged for out in found.outputs) <= times - 1


def test_bridged_ticks_are_counted_and_only_bad_numbers_are_a_fault(panda):
    found = run(panda, frozen(5), 200)
    assert [out.bridged for out in found.outputs[AT - 1 : AT + 6]] == [0, 1, 2, 3, 4, 5, 0]
    assert found.fault == "none"
    assert run(panda, lost(1), 200).fault == FAULTS[1]


def meets_sphere(panda, seen, timed):
    """Run the wrist into a sphere on a spring; give the run and the spring's force at each tick, N."""
    plant, forces = wrist_meets_sphere(panda, 0.02, 5000.0), []

    def watched(k, m, past):
        forces.append(5000.0 * np.linalg.norm(plant.data.qpos[7:10]))
        return seen(k, m, past)

    found = run(panda, watched, 300, timed, target=lambda k: reach(panda, [0.0, 0.12, 0.0]), plant=plant)
    return found, np.array(forces)


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("at", [90, 110])
def test_arm_in_contact_is_held_through_twenty_lost_measurements(panda, at, timed):
    """It presses with 30 N and yields; prediction goes on with the contact as it was.

    The contact stays known and pressed alike, within a tenth; where the tool goes afterwards hangs on last bits.
    """
    _, calm = meets_sphere(panda, lambda k, m, past: m, timed)
    found, forces = meets_sphere(panda, lost(20, at), timed)
    assert calm[at] > 30.0
    assert all(out.contact.in_contact for out in found.outputs[at:])
    assert found.outputs[at + 19].bridged == 20
    assert np.abs(forces - calm).max() < 3.0
    assert found.step() <= 1.0


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize(
    ("seen", "fault"),
    [
        pytest.param(lost(500), 5, id="lost"),
        pytest.param(frozen(300), 7, id="frozen"),
        pytest.param(late(40), 8, id="late"),
        pytest.param(off("q", 3, 0.05, 100), 9, id="contradiction"),
    ],
)
def test_beyond_twenty_ticks_the_arm_flew_and_nothing_was_said(panda, seen, fault, timed):
    """12.8 rad/s after 300 ms of a frozen measurement. Now it stops within 0.15 s of its motion, and says why."""
    found = run(panda, seen, timed=timed)
    assert found.fault == FAULTS[9 if fault == 8 and not timed else fault]
    assert found.step() <= 1.0
    assert np.abs(found.plant.qd).max() < 0.01
    speed = np.linalg.norm(found.positions[AT] - found.positions[AT - 1]) / 0.001
    travelled = np.linalg.norm(found.positions[AT:] - found.positions[AT], axis=1).max()
    assert travelled < (0.2 if fault == 8 else 0.15) * speed


@pytest.mark.parametrize("seed", range(4))
def test_a_second_of_nan_at_any_usual_speed(panda, seed):
    """It was gravity compensation without damping: 29 rad/s, the tool 1.1 m away.

    Gears have some stiction, here 0.3 N m. Without any, an arm that nobody sees is a pendulum upside down: see below.
    """
    speeds, travelled, speed = blind_second(panda, seed, 0.3)
    assert speeds.max() < 1.5
    assert speeds[300:].max() < 0.06
    assert travelled[-1] < 0.15 * speed


@pytest.mark.parametrize("seed", range(2))
def test_blind_arm_without_friction_stops_and_then_drifts(panda, seed):
    """Any error grows as a pendulum's does that stands on its head, tenfold in half a second; nothing can see it."""
    speeds, _, _ = blind_second(panda, seed, 0.0)
    assert speeds[250:350].max() < 0.05
    assert speeds.max() < 1.5


def blind_second(panda, seed, stiction):
    """Let an arm at up to 1 rad/s go blind; give its largest joint speeds, how far it turned, its speed at first."""
    rng, model = np.random.default_rng(seed), copy.copy(panda.model)
    model.dof_frictionloss[:] = stiction
    q = panda.home + rng.uniform(-0.4, 0.4, 7)
    plant, controller = Plant(panda, q, model), Controller(panda, CONFIG)
    plant.data.qvel[:] = rng.uniform(-1.0, 1.0, 7)
    controller.reset(q)
    plant.run(controller, hold(panda, q), 20)
    start, speeds, travelled = plant.q, [np.abs(plant.qd).max()], []
    for _ in range(1000):
        out = controller.step(Measurement(NAN, NAN), hold(panda, q))
        plant.step(out.torque)
        speeds.append(np.abs(plant.qd).max())
        travelled.append(np.abs(plant.q - start).max())
    assert out.fault == FAULTS[5]
    return np.array(speeds), np.array(travelled), speeds[0]


def test_braked_arm_holds_where_it_stopped_and_gives_way_no_further_than_it_should(panda):
    """Measurements are back, and are believed for that; the target is not followed until reset."""
    found = run(panda, lost(100), 1500)
    assert found.fault == FAULTS[5]
    assert found.outputs[-1].bridged == 0
    assert np.linalg.norm(found.positions[-1] - found.positions[600]) < 0.001


def test_way_back_from_a_brake_is_a_reset_without_a_jump(panda):
    found = run(panda, lost(100), 1000)
    controller, plant = found.controller, found.plant
    before = found.torques[-1]
    controller.reset(plant.q)
    target, torques = hold(panda, plant.q), [before]
    for _ in range(300):
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED), target)
        torques.append(out.torque)
        plant.step(out.torque)
    assert out.fault == "none"
    assert np.abs(np.diff(torques, axis=0)).max() <= 1.0
    assert plant.run(controller, reach(panda, [0.0, 0.1, 0.05]), 1500).fault == "none"
    assert np.linalg.norm(plant.tool_position() - found.positions[0] - [0.0, 0.1, 0.05]) < 0.002


def test_first_measurement_bad_let_the_first_good_tick_jump_by_2_nm(panda):
    """The torque started anew from gravity where the arm was by then, whatever had been sent before."""
    controller, plant = controller_at(panda, CONFIG), Plant(panda, panda.home + 0.05)
    torques = [controller.step(Measurement(NAN, NAN), hold(panda)).torque for _ in range(5)]
    assert_allclose(torques[0], panda.dynamics(panda.home, np.zeros(7))["g"], rtol=0, atol=1e-12)
    torques += [controller.step(Measurement(plant.q, plant.qd), hold(panda)).torque for _ in range(20)]
    assert np.abs(np.diff(torques, axis=0)).max() <= 1.0


@pytest.mark.parametrize("hz", [10, 25, 100])
def test_a_joint_that_shakes_was_a_change_of_pace(panda, hz):
    """What a velocity does between two ticks is not known: up to 30 good measurements in a row were not believed."""
    controller, rng = controller_at(panda, CONFIG), np.random.default_rng(0)
    q, qd, target = panda.home.copy(), np.zeros(7), hold(panda, panda.home)
    for k in range(400):
        qd[0], qd[6] = 0.1 * np.sin(0.01 * k), 4.0 * np.sin(0.002 * np.pi * hz * k) * (1.0 + 0.3 * rng.normal())
        q = q + 0.001 * qd
        out = controller.step(Measurement(q, qd, UNTOUCHED), target)
        assert out.bridged == 0
    assert out.fault == "none"


def test_simulator_at_exact_rest_is_not_frozen(panda):
    controller = controller_at(panda, CONFIG)
    for _ in range(100):
        out = controller.step(Measurement(panda.home, np.zeros(7)), hold(panda))
    assert out.fault == "none"
    assert out.bridged == 0


def test_clock_in_milliseconds_is_a_fault_and_not_a_flight(panda):
    found = run(panda, lambda k, m, past: m._replace(time=float(k)), 300)
    assert found.fault == FAULTS[8]
    assert np.abs(found.plant.qd).max() < 0.1


def test_clock_that_goes_back_once_does_no_harm_and_is_said(panda, calm):
    found = run(panda, lambda k, m, past: m._replace(time=0.001 * (k - 5 * (k == AT))))
    assert found.away(calm) < 0.002
    assert found.contacts == 0
    assert found.fault == FAULTS[12]


WRONG = [
    pytest.param(lambda k: 0.0, id="stands from the start"),
    pytest.param(lambda k: 0.001 * min(k, AT), id="stands amid the motion"),
    pytest.param(lambda k: 0.001 * k - 3600.0 * (k >= AT), id="set back an hour"),
    pytest.param(lambda k: 0.001 * k - 3600.0 * (k == AT), id="an hour back, once"),
    pytest.param(lambda k: float(np.float32(1.76e9 + 0.001 * k)), id="Unix time in single precision"),
    pytest.param(lambda k: 0.01 * (k // 10), id="in steps of 10 ms"),
    pytest.param(lambda k: -0.001 * k, id="runs backwards"),
]


@pytest.mark.parametrize("stamp", WRONG)
def test_joints_tell_the_time_where_the_clock_does_not(panda, calm, stamp):
    """Every measurement was the same one again, whatever the joints said."""
    found = run(panda, lambda k, m, past: m._replace(time=stamp(k)))
    assert found.fault == FAULTS[12]
    assert found.contacts == 0
    assert found.step() <= 1.0
    assert found.away(calm) < 0.002
    assert max(out.bridged for out in found.outputs) <= 1  # the first of all is the same one again


@pytest.mark.parametrize("stamp", WRONG)
def test_a_clock_that_stands_blinded_an_arm_at_rest(panda, stamp):
    """No contact was found of a push of 30 N, and 0.5 s later the joints went at 3.9 rad/s."""
    plant, noise, found = Plant(panda), np.random.default_rng(0), []

    def seen(k, m, past):
        if k == 300:
            plant.push("link5", (0.0, 30.0, 0.0))
        found.append(np.abs(plant.qd).max())
        return m._replace(qd=m.qd + 1e-4 * noise.standard_normal(7), time=stamp(k))

    outputs = run(panda, seen, 800, target=lambda k: hold(panda), plant=plant).outputs
    assert outputs[-1].fault == FAULTS[12]
    assert not any(out.contact.in_contact for out in outputs[:300])
    assert any(out.contact.in_contact for out in outputs[300:340])
    assert max(out.bridged for out in outputs) <= 1
    assert max(found) < 1.0


def test_same_measurement_with_its_time_again_and_again_was_nothing_at_rest(panda):
    """It said `bridged`, counted up for ever, and no more."""
    controller, outputs = controller_at(panda, CONFIG), []
    for _ in range(40):
        outputs.append(controller.step(Measurement(panda.home, np.zeros(7), UNTOUCHED, 5.0), hold(panda)))
    assert outputs[20].fault == "none"
    assert outputs[21].fault == FAULTS[7]


@pytest.mark.parametrize("late_s", [0.03, 1000.0, 1e15])
def test_one_time_far_in_the_future_blinded_the_arm_until_reset(panda, late_s):
    """It brakes the arm; the times after it, earlier all of them, were not believed any more."""
    found = run(panda, lambda k, m, past: m._replace(time=0.001 * k + late_s * (k == AT)), 1500)
    assert found.fault == FAULTS[8]
    assert found.step() <= 1.0
    assert max(out.bridged for out in found.outputs) == 0
    assert found.controller.record["state"]["clock"]["time"] == pytest.approx(1.499)
    assert np.linalg.norm(found.positions[-1] - found.positions[600]) < 0.001


def test_time_that_is_no_time_is_refused_at_the_door(panda):
    with pytest.raises(InvalidInputError, match="time is str, not a number; give seconds"):
        controller_at(panda, CONFIG).step(Measurement(panda.home, np.zeros(7), None, "now"), hold(panda))


def test_time_that_is_no_number_is_a_bad_measurement(panda):
    out = controller_at(panda, CONFIG).step(Measurement(panda.home, np.zeros(7), None, np.nan), hold(panda))
    assert out.fault == FAULTS[1]


def test_late_tick_takes_no_more_than_one_ticks_step(panda):
    """Whatever was missed: the robot held the last torque meanwhile, and a jump is what a gearbox feels."""
    found = run(panda, late(20, 60))
    assert found.step() <= 1.0


def test_silent_policy_brings_the_tool_to_rest_and_is_told(panda):
    """It went on to a target half a metre away."""
    plant, controller = Plant(panda), controller_at(panda, CONFIG)
    target = reach(panda, [0.1, 0.4, 0.1])
    plant.run(controller, target, 200, UNTOUCHED)
    start, told, torques = plant.tool_position(), [], []
    for _ in range(1500):
        out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED))
        told.append(out.target_late)
        torques.append(out.torque)
        plant.step(out.torque)
    assert told.index(True) == 100
    assert all(told[100:])
    assert np.abs(np.diff(torques, axis=0)).max() <= 1.0
    assert np.abs(plant.qd).max() < 0.005
    assert np.linalg.norm(plant.tool_position() - start) < 0.25
    assert out.fault == "none"
    out = plant.run(controller, target, 3000, UNTOUCHED)
    assert not out.target_late
    assert np.linalg.norm(out.error[:3]) < 0.005


def test_policy_that_repeats_its_target_is_not_silent(panda):
    plant, controller = Plant(panda), controller_at(panda, CONFIG)
    assert not plant.run(controller, reach(panda, [0.0, 0.05, 0.0]), 300).target_late


def test_policy_may_be_silent_for_ever_where_that_is_allowed(panda):
    plant = Plant(panda)
    controller = controller_at(panda, CONFIG.with_(target_timeout_s=np.inf))
    target = reach(panda, [0.0, 0.05, 0.0])
    plant.run(controller, target, 1)
    assert not plant.run(controller, None, 2000).target_late
    assert np.linalg.norm(plant.tool_position() - target.pose.position) < 0.002


def test_one_late_tick_filters_as_many_ticks_in_time_do(panda):
    """A residual that decays on its own decays alike whether 15 ms are one tick or fifteen."""
    residuals = []
    for times in (np.arange(16), np.array([0, 15])):
        controller = controller_at(panda, CONFIG.with_(residual_noise_nm=np.inf))
        controller.step(Measurement(panda.home, np.zeros(7), UNTOUCHED, 0.0), hold(panda))
        for name in ("residual_unfiltered", "residual_fast_unfiltered", "residual", "residual_fast"):
            controller.record["state"]["observer"][name] = 1.0
        for k in times[1:]:
            controller.step(Measurement(panda.home, np.zeros(7), UNTOUCHED, 0.001 * k), hold(panda))
        residuals.append(controller.record["state"]["observer"]["residual_fast_unfiltered"].copy())
    assert_allclose(residuals[0], residuals[1], rtol=0, atol=0.02)


NUMBERS = st.one_of(
    st.sampled_from([0.0, -0.0, 5e-324, -1e-310, 1e-200, 1e-160, 1e300, -1e300, np.inf, -np.inf, np.nan, 9e5]),
    st.floats(-3.0, 3.0),
)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_no_number_in_any_field_raises_or_gives_more_torque_than_allowed(panda, data):
    """Joints at 1e-200 rad in contact divided by zero."""
    records = np.zeros(1, dtype=Controller(panda, CONFIG).record.dtype)
    controller, plant = controller_at(panda, presets.safe(), records=records), Plant(panda)
    if data.draw(st.booleans()):
        plant.push("link5", (0.0, 40.0, 0.0))
    before = plant.run(controller, hold(panda), 60, UNTOUCHED).torque
    for _ in range(8):
        for group in ("measurement", "target"):
            for name in records.dtype[group].names:
                field = records[0][group][name]
                if data.draw(st.integers(0, 3)) > 0:
                    continue
                if name in ("has_wrench", "has_torque", "has_base", "has_time", "kept"):
                    records[0][group][name] = data.draw(st.integers(0, 1))
                elif np.ndim(field) == 0 or data.draw(st.booleans()):
                    records[0][group][name] = data.draw(NUMBERS)
                else:
                    field[data.draw(st.integers(0, len(field) - 1))] = data.draw(NUMBERS)
        for _ in range(data.draw(st.sampled_from([1, 3, 25]))):
            tick_at(records, 0)
            torque = records[0]["output"]["torque"].copy()
            assert np.isfinite(torque).all()
            assert (np.abs(torque) <= panda.tau_max).all()
            assert np.abs(torque - before).max() <= 1.0
            before = torque
    for stage in ("arm", "observer", "base", "detection", "tool_wrench", "link_masses", "impedance", "limits"):
        for name in records[0]["state"][stage].dtype.names:
            field = records[0]["state"][stage][name]
            assert field.dtype.names or np.isfinite(field).all()


def test_copy_of_a_record_bridges_alike(panda):
    found = run(panda, lost(3), AT + 2)
    controller = found.controller
    twin = controller_at(panda, CONFIG)
    twin.record["state"], twin.record["dynamics"] = controller.record["state"], controller.record["dynamics"]
    blind = Measurement(NAN, NAN, UNTOUCHED)
    target = sweep(panda)(AT)
    assert_array_equal(controller.step(blind, target).torque, twin.step(blind, target).torque)
