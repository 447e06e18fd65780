"""What is told of an identification: tables with confidence, curves of both halves, and what is not known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.logs.plants import logged

from contactsafe import Payload, robots
from contactsafe.logs.excitation import excitation
from contactsafe.logs.identification import identify
from contactsafe.logs.identified import AFTER, BEFORE, results_of
from contactsafe.logs.stiction import breakaway_torque
from contactsafe.logs.unknowns import problem_of, shapes_of, unknowns_of
from contactsafe.robot.payload import carrying

DRY = np.array([1.0, 1.2, 0.8, 0.9, 0.4, 0.3, 0.3])


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


@pytest.fixture(scope="module")
def log(arm):
    plant = carrying(arm, Payload(0.6, np.array([0.0, 0.0, 0.04]), np.eye(3) * 1e-3)).model
    return logged(arm, excitation(arm, 8.0, 1000.0), plant, lambda qd: DRY * np.sign(qd))


@pytest.fixture(scope="module")
def found(arm, log):
    return identify(log, arm)


def tables(found):
    return {table.name: table for table in results_of(found).tables}


def test_there_is_a_table_for_each_thing(found):
    assert list(tables(found)) == ["check", "sensor", "losses", "payload", "noise"]
    json.dumps(results_of(found).as_dict(), allow_nan=False)


def test_only_what_was_logged_has_a_table(arm, log):
    assert "losses" not in tables(identify(replace(log, command=None), arm))
    assert "sensor" not in tables(identify(replace(log, torque=None), arm))


def test_the_check_is_of_the_second_half(found):
    *joints, total = tables(found)["check"].as_records()
    for row, before, after in zip(joints, found.before, found.after, strict=True):
        assert row["by the description, rms (N m)"] == pytest.approx(before)
        assert row["identified, rms (N m)"] == pytest.approx(after)
    assert total["smaller by (%)"] == pytest.approx(100.0 * found.reduction)


def test_intervals_hold_what_was_planted(found):
    rows = tables(found)["losses"].as_records()
    for row, dry in zip(rows, DRY, strict=True):
        assert row["coulomb (N m)"] == pytest.approx(dry, rel=0.05)
        assert 0.0 < row["± coulomb"] < 0.2
        assert row["stiction (N m)"] == pytest.approx(dry, rel=0.15) or np.isnan(row["stiction (N m)"])
    (load,) = tables(found)["payload"].as_records()
    assert load["mass (kg)"] == pytest.approx(0.6, rel=0.05)
    assert load["com z (m)"] == pytest.approx(0.04, abs=0.005)


def test_curves_are_drawn_before_and_after(found):
    results = results_of(found)
    assert [recording.controller for recording in results.recordings] == [BEFORE, AFTER]
    before, after = results.recordings
    half = len(before.curves["1"]) // 2
    assert np.abs(after.curves["1"][half:]).max() < 0.2 * np.abs(before.curves["1"][half:]).max()
    assert len(results.figures[0].plots) == 7


def test_stiction_is_told_only_of_joints_that_rested(arm, log, found):
    fit = found.fits["losses"]
    shown = breakaway_torque(arm, found.signals, fit)
    always = found.signals._replace(qd=found.signals.qd + 0.1)  # never at rest
    assert np.isfinite(shown).any()
    assert np.isnan(breakaway_torque(arm, always, fit)).all()


@pytest.mark.parametrize(("behind_gears", "load"), [(True, False), (True, True), (False, False), (False, True)])
def test_unknowns_stand_one_after_the_other(arm, found, behind_gears, load):
    unknowns = unknowns_of(arm, behind_gears, load)
    parts = [unknowns.of(name) for name in (*unknowns.joints, *(("load",) if load else ()))]
    assert [part.start for part in parts] == [0, *(part.stop for part in parts[:-1])]
    assert ("rotor" in unknowns.joints) != behind_gears
    fit = found.fits["sensor" if behind_gears else "losses"]
    problem = problem_of(arm, unknowns, fit.impulses, np.ones(7, dtype=int))
    assert problem.columns.shape == (len(fit.impulses.time), 7, parts[-1].stop)
    assert (problem.spread > 0.0).all()


def test_what_is_published_is_believed_beforehand(arm, found):
    unknowns = unknowns_of(arm, behind_gears=False, load=False)
    problem = problem_of(arm, unknowns, found.fits["losses"].impulses, np.ones(7, dtype=int))
    np.testing.assert_allclose(problem.mean[unknowns.of("smooth")], 0.5 * arm.friction[:, 0])
    np.testing.assert_allclose(problem.mean[unknowns.of("rotor")], arm.model.dof_armature)
    np.testing.assert_array_equal(shapes_of(arm, behind_gears=False)[0], arm.friction[:, 1:])
