"""Timing: every part once a round, in turns, the task's own among them."""

import pytest
from tests.experiments.fake_task import Reaching

from contactsafe.experiments import speed
from contactsafe.policy.bundle import Bundle, shipped_bundle


@pytest.fixture(scope="module")
def measured():
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(speed, "ROUNDS", 2)
        patch.setattr(speed, "_TICKS", 20)
        patch.setattr(speed, "_ENVS", 2)
        found = speed.measure_speed(Reaching(), Bundle.load(shipped_bundle("wiping")), told.append)
    return found, told


def test_bare_physics_is_what_the_others_are_compared_with(measured):
    found, told = measured
    assert told == [1, 1]
    assert found[0].name == "bare physics, one tick"
    assert found[0].ratio == 1.0
    for part in found:
        assert 0.0 < part.best_us <= part.median_us
        assert part.ratio == pytest.approx(part.median_us / found[0].median_us)


@pytest.mark.parametrize(("sees", "seen"), [(True, "image"), (False, "observation")])
def test_a_policy_without_a_camera_was_timed_from_image_to_action(sees, seen):
    episodes = {name: Reaching().episodes("safe", [0]) for name in ("one", "bare", "many")}
    names = [part.name for part in speed._parts(episodes, None, sees)]
    assert [name for name in names if name.startswith("policy")] == [
        f"policy, {seen} to action",
        f"policy, batch of {speed._ENVS}, per {seen}",
    ]


def test_the_tasks_own_parts_are_timed_too(measured):
    names = [part.name for part in measured[0]]
    assert "nothing" in names
    assert len(set(names)) == len(names) == 8
    assert sum(name.startswith("environment") for name in names) == 1
