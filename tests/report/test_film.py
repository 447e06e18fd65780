"""The film's coding of runs: no peak is lost, and pictures come back cell by cell."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from contactsafe.report import film
from contactsafe.report.film import FORCE_UNIT, film_json, first_contact, force, picture_runs
from contactsafe.results.experiment import Experiment, Trial


def decoded(runs, shape):
    """As film.js does it: every picture goes over the one before it."""
    codes = np.repeat(runs[0::2].astype(int), runs[1::2]).reshape(shape)
    for k in range(1, len(codes)):
        codes[k] = np.where(codes[k] == 0, codes[k - 1], codes[k])
    return codes - 1


@given(arrays(np.uint8, st.tuples(*(st.integers(1, 5),) * 3), elements=st.integers(0, 254)))
def test_pictures_come_back_as_they_were(pictures):
    runs = picture_runs(pictures)
    assert runs.dtype == np.dtype("<u2")
    assert (runs[1::2] > 0).all()
    np.testing.assert_array_equal(decoded(runs, pictures.shape), pictures)


def test_a_row_of_cells_longer_than_a_number_is_split(monkeypatch):
    monkeypatch.setattr(film, "_LONGEST", 7)
    pictures = np.zeros((2, 4, 5), np.uint8)
    runs = picture_runs(pictures)
    assert runs[1::2].max() == 7
    np.testing.assert_array_equal(decoded(runs, pictures.shape), pictures)


def test_what_does_not_change_takes_no_room():
    still = np.repeat(np.random.default_rng(0).integers(0, 2, (1, 50, 60), np.uint8), 40, axis=0)
    assert len(picture_runs(still)) == len(picture_runs(still[:1])) + 2 * 39


@pytest.fixture
def run(fakes):
    return fakes.record("bottle", "safe", 1.0, ((0.3, -0.2, 0.4), 2e3), (0.03, 0.0))


@given(tick=st.integers(0, 990), peak=st.floats(20.0, 1000.0))
def test_no_peak_of_a_tick_is_lost(fakes, tick, peak):
    run = fakes.record("bottle", "safe", 1.0, ((0.3, -0.2, 0.4), 2e3), (0.03, 0.0))
    run.trace["obstacle_force"][tick] = peak
    values = film._run(run, of_obstacle=True)
    channels = np.frombuffer(film.base64.b64decode(values["channels"]), "<i2").reshape(values["frames"], -1)
    assert channels[:, 10].max() * FORCE_UNIT == pytest.approx(peak, abs=FORCE_UNIT)


def test_the_last_joint_was_taken_for_the_obstacle_when_a_channel_went():
    """film.js finds what it draws by the names that the film declares, and knows no number of channels."""
    code = (Path(film.__file__).parent / "film.js").read_text(encoding="utf-8")
    read = set(re.findall(r"\b(?:at|place)\.(\w+)", code))
    assert read == set(film.CHANNELS)
    assert not re.search(r"\.mode\s*[=!<>]", code)
    assert not re.search(r"joints\s*[+]\s*\d|width\s*-\s*\d+;", code)


def experiment(*runs):
    trials = tuple(Trial(run.scenario, run.controller, run.seed, {}) for run in runs)
    return Experiment("x", "X", "?", trials, recordings=runs)


def test_contact_begins_above_half_a_newton(run):
    run.trace["obstacle_force"] = 0.0
    assert first_contact(run) is None
    run.trace["obstacle_force"][100:] = 0.5
    assert first_contact(run) is None
    run.trace["obstacle_force"][300:] = 0.6
    assert first_contact(run) == 300


def test_force_is_the_obstacles_or_the_tools(run):
    run.trace["tool_force"][5] = (3.0, 0.0, 4.0)
    assert force(run, of_obstacle=False)[5] == 5.0
    np.testing.assert_array_equal(force(run, of_obstacle=True), run.trace["obstacle_force"])


def test_a_film_begins_shortly_after_the_first_contact(fakes, run):
    run.trace["obstacle_force"][:] = 0.0
    run.trace["obstacle_force"][400:] = 9.0
    found = json.loads(film_json(experiment(run), fakes.Wiping().stage))
    (scene,) = found["scenes"]
    assert scene["start"] == pytest.approx(0.7)
    assert scene["force"] == "contact force"
    assert scene["limit"] == 9.0


def test_a_film_of_nothing_is_none(fakes, run):
    stage = fakes.Wiping().stage
    assert film_json(experiment(), stage) is None
    assert film_json(experiment(replace(run, trace=run.trace[:0])), stage) is None


def test_runs_without_pictures_are_filmed_too(fakes, run):
    found = json.loads(film_json(experiment(replace(run, pictures=None)), fakes.Wiping().stage))
    assert found["scenes"][0]["runs"][0]["pictures"] is None
    assert found["scenes"][0]["runs"][0]["cells"] == [1, 1]
    assert "<" not in json.dumps(found)
