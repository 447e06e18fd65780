"""Whatever a policy sends, in whatever order: the controller is only ever told what is sound, and states go one way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.hardware.test_gate import Door

from contactsafe.hardware import states
from contactsafe.hardware.gate import OLD_TICKS, SILENT_TICKS

KINDS = ("good", "nan", "stale", "ahead", "repeated", "short", "stiff", "none")


@pytest.fixture(scope="module")
def shared():
    return Door()


def sent(door, kind, tick, rng):
    """Hand in a message of a kind at a tick; return whether it should be accepted."""
    if kind == "none":
        return False
    changes = {
        "number": door.gate["number"] if kind == "repeated" else int(door.message["number"][0]) + 1,
        "of_tick": {"stale": tick - OLD_TICKS - 1, "ahead": tick + 3}.get(kind, tick - 1),
        "joints": 6 if kind == "short" else 7,
        "K_task": 1e7 if kind == "stiff" else rng.uniform(50.0, 300.0, 6),
        "position": np.full(3, np.nan) if kind == "nan" else rng.uniform(-0.5, 0.5, 3),
    }
    door.hand_in(tick, **changes)
    return kind == "good"


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.lists(st.tuples(st.sampled_from(KINDS), st.integers(1, 40)), min_size=5, max_size=60))
def test_only_sound_targets_of_now_reach_the_controller(shared, seed, course):
    door, rng, tick = Door(), np.random.default_rng(seed), 100
    del shared
    last, ended = tick, False
    door.hand_in(tick, number=1, of_tick=tick)
    before = door.target.copy()
    for kind, gap in course:
        tick += gap
        position = door.target["position"].copy()
        good = sent(door, kind, tick, rng)
        if good and not ended:
            last = tick - 1
        if not good and kind != "none":
            assert door.gate["refusal"] != states.NONE
            assert (door.target["position"] == position).all()
        state, reason = door.follow(tick)
        assert np.isfinite(door.target["position"]).all()
        assert np.isfinite(door.target["K_task"]).all()
        assert door.target["K_task"].max() < 1e4
        ended = ended or tick - int(door.gate["of_tick"]) > SILENT_TICKS
        expected = states.STOPPING if ended else states.HELD if tick - last > OLD_TICKS else states.RUNNING
        assert state == expected
        assert (reason == states.NONE) == (state == states.RUNNING)
        assert reason in states.REASONS
    assert before["q_posture"].shape == (7,)


@settings(max_examples=30)
@given(st.integers(1, 3000), st.integers(0, len(states.REASONS) - 1))
def test_once_it_ends_it_ends_for_the_first_reason(shared, later, reason):
    door = Door()
    del shared
    door.hand_in(100, number=1, of_tick=100)
    door.follow(101, stop=states.ASKED)
    assert door.follow(101 + later, stop=reason) == (states.STOPPING, states.ASKED)
