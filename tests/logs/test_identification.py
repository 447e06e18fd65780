"""What was planted in a simulated robot is identified from its log; logs that do not show it are refused."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.logs.plants import logged
from tests.robot.worlds import SIX

from contactsafe import Payload, robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.logs import carried
from contactsafe.logs.excitation import excitation
from contactsafe.logs.fitting import _solve
from contactsafe.logs.identification import Identification, identify
from contactsafe.logs.identified import results_of
from contactsafe.logs.least_squares import Problem
from contactsafe.logs.log import Log
from contactsafe.logs.unknowns import Unknowns
from contactsafe.robot.friction import joint_friction
from contactsafe.robot.payload import carrying

VISCOUS = np.array([2.0, 1.5, 1.0, 1.0, 0.3, 0.2, 0.2])
COULOMB = np.array([1.0, 1.2, 0.8, 0.9, 0.4, 0.3, 0.3])
BIAS = np.array([0.5, -0.4, 0.3, -0.6, 0.1, 0.15, -0.1])
LOAD = Payload(0.8, np.array([0.03, 0.0, 0.05]), np.eye(3) * 1e-3)


def dry_and_viscous(qd):
    return VISCOUS[: len(qd)] * qd + COULOMB[: len(qd)] * np.sign(qd)


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


@pytest.fixture(scope="module")
def motion(arm):
    return excitation(arm, 12.0, 1000.0, seed=1, floor_m=0.0)


@pytest.fixture(scope="module")
def log(arm, motion):
    return logged(arm, motion, carrying(arm, LOAD).model, dry_and_viscous, torque_bias=BIAS)


def free(log, **changes):
    """Return a log with other columns."""
    return replace(log, **changes)


def assert_load(found):
    assert found.mass == pytest.approx(LOAD.mass, rel=0.05)
    assert_allclose(found.com, LOAD.com, atol=0.005)


def test_torque_behind_the_gears_shows_bias_and_payload(arm, log):
    found = identify(free(log, command=None), arm)
    assert_allclose(found.calibration.sensor.bias, BIAS, rtol=0.05, atol=0.005)
    assert found.calibration.losses is None
    assert np.isnan(found.calibration.stiction).all()
    assert_load(found.calibration.payload)
    assert found.reduction > 0.9
    assert "is 100% smaller" in found.verdict() or "is 99% smaller" in found.verdict()


def test_commands_show_friction_rotors_and_payload(arm, log):
    known = identify(free(log, torque=None), arm).calibration
    assert_allclose(known.losses.viscous, VISCOUS, rtol=0.05)
    assert_allclose(known.losses.coulomb, COULOMB, rtol=0.05)
    assert_allclose(known.rotor, arm.model.dof_armature, rtol=0.05)
    assert known.sensor is None
    assert_load(known.payload)


def test_both_show_all_of_it_and_stiction(arm, log):
    known = identify(log, arm).calibration
    assert_allclose(known.sensor.bias, BIAS, rtol=0.05, atol=0.005)
    assert_allclose(known.losses.coulomb, COULOMB, rtol=0.05)
    assert_allclose(known.losses.bias, 0.0, atol=0.02)
    shown = np.isfinite(known.stiction)
    assert shown.sum() >= 5
    assert_allclose(known.stiction[shown], COULOMB[shown], rtol=0.15)


def test_a_hundred_rows_a_second_and_no_velocity_are_enough(arm, log):
    rows = slice(None, None, 10)
    thin = Log("thin", log.time[rows], log.q[rows], None, log.torque[rows])
    known = identify(thin, arm).calibration
    assert_allclose(known.sensor.bias, BIAS, rtol=0.05, atol=0.01)
    assert_load(known.payload)


def test_friction_of_the_published_form_keeps_its_shape(arm, motion):
    """Half as much again of Gaz's friction, and a bias in the command."""
    lost = np.array([0.3, 0.5, -0.2, 0.4, 0.1, -0.1, 0.05])
    log = logged(arm, motion, friction=lambda qd: 1.5 * joint_friction(arm.friction, qd), command_bias=lost, noise=0.5)
    known = identify(free(log, torque=None), arm).calibration
    qd = np.linspace(-0.7, 0.7, 15)[:, None] * np.ones(7)
    expected = np.array([1.5 * joint_friction(arm.friction, row) for row in qd])
    found = np.array([known.losses.at(row) for row in qd]) - known.losses.bias
    assert_allclose(found, expected, atol=0.05 * expected.max())
    assert_allclose(known.losses.coulomb, 0.75 * arm.friction[:, 0], rtol=0.05, atol=0.02)
    assert_allclose(known.losses.bias, lost, rtol=0.05, atol=0.01)
    assert known.payload is None


def test_dry_friction_beside_the_published_one_is_told_apart(arm, motion):
    log = logged(arm, motion, friction=lambda qd: joint_friction(arm.friction, qd) + 0.5 * np.sign(qd))
    known = identify(free(log, torque=None), arm).calibration
    assert_allclose(known.losses.coulomb, 0.5 * arm.friction[:, 0] + 0.5, rtol=0.05)


def test_six_joints_of_a_users_own_scene(tmp_path):
    path = tmp_path / "six.xml"
    path.write_text(SIX, encoding="utf-8")
    arm = robots.from_mjcf(str(path), "tip")
    load = Payload(1.2, np.array([0.0, 0.02, 0.03]), np.eye(3) * 2e-3)
    log = logged(arm, excitation(arm, 12.0, 1000.0), carrying(arm, load).model, dry_and_viscous)
    known = identify(free(log, torque=None), arm).calibration
    assert_allclose(known.losses.viscous, VISCOUS[:6], rtol=0.05)
    assert_allclose(known.losses.coulomb, COULOMB[:6], rtol=0.05)
    assert known.payload.mass == pytest.approx(load.mass, rel=0.05)
    assert_allclose(known.payload.com, load.com, atol=0.005)


def test_a_hand_that_is_not_there_is_a_negative_payload(motion):
    bare = robots.panda(None)
    plant = mujoco.MjModel.from_xml_string(_without_hand())
    log = logged(robots.panda("hand"), motion, plant)
    known = identify(free(log, command=None), robots.panda("hand")).calibration
    assert known.payload.mass == pytest.approx(-0.73, rel=0.05)
    told = robots.calibrated(robots.panda("hand"), known)
    assert_allclose(told.dynamics(told.home, np.zeros(7))["g"], bare.dynamics(bare.home, np.zeros(7))["g"], atol=0.05)


def _without_hand():
    from contactsafe.robot.mjcf import arm_mjcf
    from contactsafe.robot.panda import PANDA
    from contactsafe.robot.robots import FLANGE

    return arm_mjcf(PANDA, FLANGE)


def test_a_description_that_fits_is_said_to(arm, motion):
    found = identify(free(logged(arm, motion, noise=0.0), command=None), arm)
    assert found.verdict().startswith("the description fits this log already")
    assert found.calibration.payload is None


def test_what_a_log_does_not_show_is_named_with_how_the_joint_moved(arm, motion):
    still = motion.q.copy(), motion.qd.copy()
    still[0][:, 4], still[1][:, 4] = arm.home[4], 0.0
    log = logged(arm, motion._replace(q=still[0], qd=still[1]), friction=dry_and_viscous)
    said = identify(free(log, torque=None), arm).not_shown("losses")
    assert any("viscous" in one and "joint 5, which moved by" in one for one in said)
    assert not any("joint 1," in one for one in said)


def test_a_payload_that_the_file_cannot_hold_is_part_of_nothing(arm, log, monkeypatch):
    """One that seems too far from the tool point: friction and check are those without it, and it is said why."""
    monkeypatch.setattr(carried, "_FAR_M", 0.001)
    found = identify(log, arm)
    assert found.calibration.payload is None
    assert all(not fit.unknowns.load and not fit.load().any() for fit in found.fits.values())
    assert found.carried.left_out == "a payload of 0.8 kg was left out: it would be 0.059 m from the tool point"
    note = results_of(found).tables[0].note
    assert note.endswith("A payload of 0.8 kg was left out: it would be 0.059 m from the tool point.")
    assert "payload" not in [table.name for table in results_of(found).tables]


def test_a_payload_without_its_tensor_is_what_all_else_is_identified_with(arm, log, monkeypatch):
    whole = identify(log, arm)
    monkeypatch.setattr(carried, "can_carry", lambda arm, load: not load.inertia.any())
    found = identify(log, arm)
    assert_load(found.calibration.payload)
    assert not found.calibration.payload.inertia.any()
    for fit in found.fits.values():
        assert_allclose(fit.load(), found.carried.parameters(arm))
    assert_allclose(found.before, whole.before)
    assert "counts as a point" in results_of(found).tables[0].note
    (row,) = next(table for table in results_of(found).tables if table.name == "payload").as_records()
    assert row["± mass"] > 0.0


def test_what_a_file_holds_is_what_was_identified_with(arm, log):
    found = identify(free(log, command=None), arm)
    assert_allclose(found.carried.parameters(arm), found.fit.load(), atol=1e-9)
    assert found.carried.left_out == ""


def test_a_sensors_errors_may_have_either_sign(arm, log):
    """Hysteresis that looks like dry friction which drives a joint."""
    shown = log.torque - 0.2 * np.tanh(20.0 * log.qd)
    known = identify(free(log, torque=shown, command=None), arm).calibration
    assert_allclose(known.sensor.dry, -0.2, rtol=0.15)
    assert (known.sensor.viscous >= 0.0).all()
    told = robots.calibrated(arm, known)
    assert (told.sensor_drag[:, 2] < 0.0).all()


def test_what_is_kept_at_zero_is_not_zero_for_sure(arm, motion):
    """It was reported as 0 ± 0: friction that drives a joint, which none does."""
    log = logged(arm, motion, friction=lambda qd: -0.3 * np.tanh(20.0 * qd))
    found = identify(free(log, torque=None), arm).fit
    at_zero = found.of("viscous") < 1e-6
    assert at_zero.any()
    assert (found.deviation("viscous") > 1e-5).all()
    assert (found.found("coulomb")[1] > 1e-5).all()


def test_what_is_kept_at_zero_and_not_shown_is_no_surer_than_before():
    """Viscous friction of a joint that hardly moves, and a log that happens to say it were negative."""
    rng, unknowns = np.random.default_rng(0), Unknowns(1, False, False, False)
    columns = rng.normal(size=(200, 1, 4)) * [1.0, 1e-3, 1.0, 1.0]
    torque = columns @ [0.0, -3.0, 1.0, 1.0] + 0.01 * rng.normal(size=(200, 1))
    problem = Problem(columns, torque, np.zeros(4), np.ones(4), np.ones((200, 1), dtype=bool))
    solution = _solve(unknowns, problem)
    assert abs(solution.value[1]) < 1e-6
    assert np.sqrt(solution.covariance[1, 1]) > 0.5
    assert np.sqrt(solution.covariance[2, 2]) < 0.01


def test_windows_in_which_a_joint_sticks_are_no_part_of_the_check(arm, motion):
    """What holds a joint at rest is whatever is asked of it: 3 N m at both ends of the motion, left by any fit."""
    held = np.where(np.abs(motion.qd) < 1e-3, 3.0, 0.0)
    log = logged(arm, motion, friction=lambda qd: 1.5 * np.sign(qd))
    found = identify(free(log, torque=None, command=log.command + held), arm)
    assert (found.after < 0.2).all()
    counts = found.fit.problem.counts[len(found.fit.check) // 2 :]
    assert not counts.all()


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (slice(0, 1500), "is 1.5 s long; record 2 s or more"),
        (slice(0, None, 40), "rows a second by its time; record 50 to 20000$"),
    ],
)
def test_too_little_is_refused(arm, log, rows, text):
    with pytest.raises(InvalidInputError, match=text):
        identify(Log("a log", log.time[rows], log.q[rows], log.qd[rows], log.torque[rows]), arm)


def test_an_arm_at_rest_is_refused(arm, log):
    with pytest.raises(InvalidInputError, match="is of an arm at rest: no joint moves by more than 0 rad"):
        identify(free(log, q=0.0 * log.q + arm.home, qd=0.0 * log.qd), arm)


def test_another_arm_is_refused(arm, log):
    with pytest.raises(InvalidInputError, match="has 6 joints, arm 'panda' has 7"):
        identify(Log("a log", log.time, log.q[:, :6], torque=log.torque[:, :6]), arm)


def test_a_contact_in_the_log_is_told_with_its_time(arm, log):
    touched = log.torque.copy()
    touched[(log.time > 5.0) & (log.time < 5.6), 1] += 9.0
    with pytest.raises(InvalidInputError, match=r"something touches the arm from 5\.0\d to 5\.5\d s.*joint 2"):
        identify(free(log, torque=touched, command=None), arm)


def test_a_second_half_that_gets_worse_is_refused(arm, motion):
    log = logged(arm, motion)
    torque = log.torque.copy()
    torque += np.where(log.time < 6.0, 1.0, -1.0)[:, None]
    with pytest.raises(InvalidInputError, match=r"the second \d+% larger; record a longer motion"):
        identify(free(log, torque=torque, command=None), arm)


def test_missing_rows_are_left_out(arm, log):
    kept = (log.time < 4.0) | (log.time > 4.4)
    kept &= np.random.default_rng(0).random(len(kept)) > 0.08
    thin = Log("gaps", *(values[kept] for values in (log.time, log.q, log.qd, log.torque)))
    known = identify(thin, arm).calibration
    assert_allclose(known.sensor.bias, BIAS, rtol=0.05, atol=0.01)


def test_a_log_that_loses_rows_in_every_window_is_refused(arm, log):
    """20 ms in every 140 are missing: smoothed into their neighbours, no window of 100 ms is without them."""
    kept = np.mod(log.time, 0.14) > 0.02
    thin = Log("lossy", *(values[kept] for values in (log.time, log.q, log.qd, log.torque)))
    with pytest.raises(InvalidInputError, match="lossy: rows are missing in all but 0 windows"):
        identify(thin, arm)


def test_a_check_that_came_to_nothing_is_none_that_was_passed(arm, log, monkeypatch):
    """It was '0% smaller: nan', and a file was saved."""
    monkeypatch.setattr(Identification, "after", property(lambda found: np.full(7, np.nan)))
    with pytest.raises(InvalidInputError, match="the second no number; record a longer motion"):
        identify(free(log, command=None), arm)


def test_two_runs_days_apart_are_identified_as_one(arm, log):
    """A year of rows at 1 kHz would not fit into any memory."""
    later = log.time + (log.time > 6.0) * 3.2e7
    known = identify(free(log, time=later, command=None), arm).calibration
    assert_allclose(known.sensor.bias, BIAS, rtol=0.05, atol=0.01)
    assert_load(known.payload)


def test_a_joint_that_sticks_is_no_contact(arm, motion):
    """At rest friction holds whatever is asked of it, up to its size: 1.5 N m at both ends of the motion."""
    held = np.where(np.abs(motion.qd) < 1e-3, 1.5, 0.0)
    log = logged(arm, motion, friction=lambda qd: 1.5 * np.sign(qd))
    known = identify(free(log, torque=None, command=log.command + held * [1, 1, 1, 1, 0, 0, 0]), arm).calibration
    assert_allclose(known.losses.coulomb, 1.5, rtol=0.05)
