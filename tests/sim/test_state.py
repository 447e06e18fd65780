"""Worlds given a state they had go on as they did, to the bit, in the same process or in new memory."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.sim.scenes import aim, panda, posture, run

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.config import REAL_SENSORS, PlantConfig, WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.worlds import Worlds

PRESSED, ABOVE = (0.5, 0.0, 0.004), (0.55, 0.05, 0.06)
TRAVELLER = Obstacle((0.45, 0.3, 0.25), 0.05, 3000.0, travel=(0.0, -0.2, 0.0), travel_s=(0.02, 0.2), travel_until_n=8.0)


def busy_worlds(seed):
    """One world presses and is pushed, one has a payload, a delay and an obstacle that comes nearer."""
    plants = WorldConfig(sensors=REAL_SENSORS), WorldConfig(PlantConfig(0.8, 1.1, 0.3, 1), obstacles=(TRAVELLER,))
    return Worlds(panda(), plants, presets.safe(), 2, seed)


def begin(worlds):
    """Start both and run them into the thick of it."""
    for i in range(2):
        worlds.reset(i, posture((0.5, 0.0, 0.0105)))
        aim(worlds, (PRESSED, ABOVE)[i], i)
    worlds.push(0, "link4", (0.0, 0.0, 0.0), (0.0, 30.0, 0.0), 0.03, 0.3)
    run(worlds, 70)


def assert_same(a, b):
    for name in a.dtype.names:
        assert_array_equal(a[name], b[name], err_msg=name)


@pytest.fixture(scope="module")
def course():
    """A state amidst a course of events, and how it went on."""
    worlds = busy_worlds(3)
    begin(worlds)
    state = worlds.state_dict()
    trace = run(worlds, 120)
    yield worlds, state, trace
    worlds.close()


def test_the_course_has_what_could_be_forgotten(course):
    worlds, _, trace = course
    assert trace["tool_force"][0].any()
    assert trace["mode"][0].any()
    assert np.ptp(trace["obstacle_position"][1, :, 0, 1]) > 0.01
    assert worlds.metrics["ticks"].all()


def test_the_same_worlds_go_on_alike(course):
    worlds, state, trace = course
    run(worlds, 30)
    worlds.load_state_dict(state)
    assert_same(run(worlds, 120), trace)


def test_new_worlds_go_on_alike(course):
    _, state, trace = course
    fresh = busy_worlds(99)
    addresses = fresh.records["plant"]["data"].copy(), fresh.controllers["handle"].copy()
    fresh.load_state_dict(state)
    assert_same(run(fresh, 120), trace)
    assert_array_equal(fresh.records["plant"]["data"], addresses[0])
    assert_same(fresh.controllers["handle"], addresses[1])
    fresh.close()


def test_new_worlds_draw_the_same_bias_at_their_next_reset(course):
    _, state, _ = course
    biases = []
    for _ in range(2):
        worlds = busy_worlds(None)
        worlds.load_state_dict(state)
        worlds.reset(1, panda().home)
        biases.append(worlds.records["errors"]["wrench_bias"][1].copy())
        worlds.close()
    assert biases[0].any()
    assert_array_equal(*biases)


def test_a_snapshot_is_plain_and_does_not_change(course):
    worlds, state, _ = course

    def assert_plain(value):
        if isinstance(value, dict | list):
            for inner in value.values() if isinstance(value, dict) else value:
                assert_plain(inner)
        elif isinstance(value, np.ndarray):
            assert value.dtype in (np.float64, np.int64, np.uint8)
        else:
            assert isinstance(value, int | str)

    assert_plain(state)
    assert not any(f"plant.{name}" in state["records"] for name in ("data", "model", "qpos", "qpos_spring"))
    assert "handle.data" not in state["controllers"]
    ticks = state["records"]["tick"].copy()
    run(worlds, 5)
    assert_array_equal(state["records"]["tick"], ticks)


def test_a_snapshot_of_something_else_is_refused(course):
    worlds, state, _ = course
    with pytest.raises(
        InvalidInputError, match=r"^the state holds noise, not controllers, metrics, noise, .*; start anew$"
    ):
        worlds.load_state_dict({"noise": state["noise"]})
    with pytest.raises(InvalidInputError) as error:
        worlds.load_state_dict({**state, "metrics": {**state["metrics"], "ticks": np.zeros(3, dtype=np.int64)}})
    assert str(error.value) == "the state holds an array (3,) for one of (2,); start anew"


@pytest.mark.parametrize(
    ("part", "field", "value"),
    [
        ("records", "push.body", 10**9),
        ("records", "plant.tcp_site", 10**9),
        ("controllers", "state.isolation.search_at", 10**9),
        ("controllers", "state.turn", 7),
        ("controllers", "handle.surface_points", 10**9),
        ("controllers", "state.command.tau", np.nan),
    ],
)
def test_an_index_of_1e9_in_a_snapshot_is_refused_and_nothing_changed(course, part, field, value):
    worlds, state, _ = course
    corrupt = {**state, part: {name: array.copy() for name, array in state[part].items()}}
    corrupt["metrics"] = {name: np.zeros_like(array) for name, array in state["metrics"].items()}
    corrupt[part][field].reshape(-1)[-1] = value
    before = worlds.state_dict()
    with pytest.raises(InvalidInputError, match=r"^the state holds .* start anew$") as error:
        worlds.load_state_dict(corrupt)
    assert f"({part}.{field})" in str(error.value)
    after = worlds.state_dict()
    assert_array_equal(after["metrics"]["ticks"], before["metrics"]["ticks"])
    assert_array_equal(after["records"]["tick"], before["records"]["tick"])


def test_a_random_generator_whose_state_is_an_index_is_refused(course):
    worlds, state, _ = course
    twister = {"bit_generator": "MT19937", "state": {"key": [0] * 624, "pos": 10**9}}
    for spoilt in (twister, {"bit_generator": "seed"}, {}, {**state["noise"][0], "state": {"state": ["x"]}}):
        with pytest.raises(InvalidInputError, match="which is not the state of a random generator"):
            worlds.load_state_dict({**state, "noise": [spoilt, spoilt]})
