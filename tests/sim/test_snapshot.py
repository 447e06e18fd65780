"""Worlds put back where they were go on as they did, to the bit, in the same process or in new memory."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.sim.scenes import aim, panda, posture, run

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.config import REAL_SENSORS, Obstacle, PlantConfig, WorldConfig
from contactsafe.sim.world import Worlds

PRESSED, ABOVE = (0.5, 0.0, 0.004), (0.55, 0.05, 0.06)
TRAVELLER = Obstacle((0.45, 0.3, 0.25), 0.05, 3000.0, travel=(0.0, -0.2, 0.0), travel_s=(0.02, 0.2), travel_until_n=8.0)


def busy_worlds(seed):
    """One world wipes and is pushed, one has a payload, a delay and an obstacle that comes nearer."""
    plants = WorldConfig(sensors=REAL_SENSORS), WorldConfig(PlantConfig(0.8, 1.1, 0.3, 1), obstacles=(TRAVELLER,))
    return Worlds(panda(), plants, presets.safe(), 2, seed)


def begin(worlds):
    """Start both and run them into the thick of it."""
    rng = np.random.default_rng(5)
    for i in range(2):
        worlds.reset(i, posture((0.5, 0.0, 0.0105)))
        worlds.boards[i].sample_random(rng)
        aim(worlds, (PRESSED, ABOVE)[i], i)
    worlds.push(0, "link4", (0.0, 0.0, 0.0), (0.0, 30.0, 0.0), 0.03, 0.3)
    run(worlds, 70)


def assert_same(a, b):
    for name in a.dtype.names:
        assert_array_equal(a[name], b[name], err_msg=name)


@pytest.fixture(scope="module")
def course():
    """A snapshot amidst a course of events, and how it went on."""
    worlds = busy_worlds(3)
    begin(worlds)
    snapshot = worlds.snapshot()
    trace = run(worlds, 120)
    yield worlds, snapshot, trace, worlds.cells.copy(), worlds.render().copy()
    worlds.close()


def test_the_course_has_what_could_be_forgotten(course):
    worlds, _, trace, _, _ = course
    assert trace["tool_force"][0].any()
    assert trace["mode"][0].any()
    assert np.ptp(trace["obstacle_position"][1, :, 0, 1]) > 0.01
    assert worlds.reports["ticks"].all()


def test_the_same_worlds_go_on_alike(course):
    worlds, snapshot, trace, cells, masks = course
    run(worlds, 30)
    worlds.restore(snapshot)
    assert_same(run(worlds, 120), trace)
    assert_array_equal(worlds.cells, cells)
    assert_array_equal(worlds.render(), masks)


def test_new_worlds_go_on_alike(course):
    _, snapshot, trace, cells, masks = course
    fresh = busy_worlds(99)
    addresses = fresh.plants["data"].copy(), fresh.controllers["handle"].copy()
    fresh.restore(snapshot)
    assert_same(run(fresh, 120), trace)
    assert_array_equal(fresh.cells, cells)
    assert_array_equal(fresh.render(), masks)
    assert_array_equal(fresh.plants["data"], addresses[0])
    assert_same(fresh.controllers["handle"], addresses[1])
    fresh.close()


def test_new_worlds_draw_the_same_bias_at_their_next_reset(course):
    _, snapshot, _, _, _ = course
    biases = []
    for _ in range(2):
        worlds = busy_worlds(None)
        worlds.restore(snapshot)
        worlds.reset(1, panda().home)
        biases.append(worlds.plants["wrench_bias"][1].copy())
        worlds.close()
    assert biases[0].any()
    assert_array_equal(*biases)


def test_a_snapshot_is_plain_and_does_not_change(course):
    worlds, snapshot, _, _, _ = course

    def assert_plain(value):
        if isinstance(value, dict | list):
            for inner in value.values() if isinstance(value, dict) else value:
                assert_plain(inner)
        elif isinstance(value, np.ndarray):
            assert value.dtype in (np.float64, np.int64, np.uint8)
        else:
            assert isinstance(value, int | str)

    assert_plain(snapshot)
    assert not any(name in snapshot["plants"] for name in ("data", "model", "qpos", "qpos_spring"))
    assert "handle.data" not in snapshot["controllers"]
    ticks = snapshot["plants"]["tick"].copy()
    run(worlds, 5)
    assert_array_equal(snapshot["plants"]["tick"], ticks)


def test_a_snapshot_of_something_else_is_refused(course):
    worlds, snapshot, _, _, _ = course
    with pytest.raises(
        InvalidInputError, match=r"^the snapshot holds cells, not cells, controllers, masks, .*; start anew$"
    ):
        worlds.restore({"cells": snapshot["cells"]})
    with pytest.raises(InvalidInputError) as error:
        worlds.restore({**snapshot, "cells": snapshot["cells"][:, :3]})
    assert str(error.value) == "the snapshot holds an array (2, 3, 300) for one of (2, 250, 300); start anew"


@pytest.mark.parametrize(
    ("part", "field", "value"),
    [
        ("plants", "push_body", 10**9),
        ("plants", "camera", -1),
        ("plants", "tcp_site", 10**9),
        ("controllers", "state.isolation.search_at", 10**9),
        ("controllers", "state.turn", 7),
        ("controllers", "handle.surface_points", 10**9),
        ("controllers", "state.command.tau", np.nan),
    ],
)
def test_an_index_of_1e9_in_a_snapshot_is_refused_and_nothing_changed(course, part, field, value):
    worlds, snapshot, _, _, _ = course
    spoiled = {**snapshot, part: {name: array.copy() for name, array in snapshot[part].items()}}
    spoiled["cells"] = np.zeros_like(snapshot["cells"])
    spoiled[part][field].reshape(-1)[-1] = value
    before = worlds.snapshot()
    with pytest.raises(InvalidInputError, match=r"^the snapshot holds .* start anew$") as error:
        worlds.restore(spoiled)
    assert f"({part}.{field})" in str(error.value)
    after = worlds.snapshot()
    assert_array_equal(after["cells"], before["cells"])
    assert_array_equal(after["plants"]["tick"], before["plants"]["tick"])


def test_a_random_generator_whose_state_is_an_index_is_refused(course):
    worlds, snapshot, _, _, _ = course
    twister = {"bit_generator": "MT19937", "state": {"key": [0] * 624, "pos": 10**9}}
    for state in (twister, {"bit_generator": "seed"}, {}, {**snapshot["noise"][0], "state": {"state": ["x"]}}):
        with pytest.raises(InvalidInputError, match="which is not the state of a random generator"):
            worlds.restore({**snapshot, "noise": [state, state]})
