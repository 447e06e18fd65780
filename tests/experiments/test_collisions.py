"""The collision battery: a trial is its seed's alone, and the page can be told what is asked of it."""

import numpy as np
import pytest

from contactsafe import presets
from contactsafe.control.codes import COMPLY, REJECT
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.collision_metrics import collision_metrics
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.collision_scenes import met_links
from contactsafe.experiments.collisions import collisions, run_battery
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.motions import record
from contactsafe.experiments.registry import ENTRIES
from contactsafe.robot import robots
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import Worlds

TWO = {"vices": presets.vices(), "safe": presets.safe()}


@pytest.fixture(scope="module")
def battery():
    """Seeds of sweeps and holds, in the air and on a surface, one and two obstacles."""
    return run_battery(TWO, range(6))


def test_every_seed_plant_and_controller_is_there_once(battery):
    found = [(trial.seed, trial.plant, trial.controller) for trial in battery.trials]
    assert sorted(found) == sorted(
        (seed, plant, name) for seed in range(6) for plant in ("real", "clean") for name in TWO
    )
    assert all(trial.metrics["link"] in met_links(robots.panda()) for trial in battery.trials)


@pytest.mark.parametrize("seed", [2, 5])
def test_a_seed_alone_does_what_it_does_among_others(battery, seed):
    """Bit for bit: `--seed N --trials 1` replays trial N."""
    alone = run_battery(TWO, [seed])
    assert repr(alone.trials) == repr(tuple(trial for trial in battery.trials if trial.seed == seed))


def test_the_other_controllers_of_a_run_do_not_matter(battery):
    alone = run_battery({"safe": presets.safe()}, range(2), ["clean"])
    those = [t for t in battery.trials if t.seed < 2 and (t.controller, t.plant) == ("safe", "clean")]
    assert repr(list(alone.trials)) == repr(those)


def test_first_seed_is_recorded_for_each_controller_and_plant(battery):
    assert {(r.controller, r.seed) for r in battery.recordings} == {("vices", 0), ("safe", 0)}
    assert len({r.scenario for r in battery.recordings}) == 2
    for recording in battery.recordings:
        trial = next(
            t for t in battery.trials
            if (t.seed, t.controller, t.heading) == (0, recording.controller, recording.scenario)
        )  # fmt: skip
        assert recording.trace["obstacle_force"].max() == trial.metrics["contact_peak_n"]
        away = 1000 * np.linalg.norm(recording.trace["error"][:, :3], axis=1)
        assert away.max() == pytest.approx(trial.metrics["tool_error_mm"])


def test_what_replays_a_trial_is_a_command_for_presets_and_python_for_others(battery):
    worst = battery.tables[1].as_records()[0]
    seed = worst["seed"]
    assert worst["replay"] == (
        f"contactsafe experiment collisions --controllers vices,safe --trials 1 --out trial-{seed} --seed {seed}"
    )
    own = {"vices": presets.vices(), "softer": presets.safe().with_(contact_force_limit_comply_n=8.0)}
    (row,) = run_battery(own, [3], ["clean"]).tables[1].as_records()
    assert row["replay"] == "run_battery(controllers, [3])"
    (row,) = run_battery(own, [3], ["clean"], arm=robots.fr3()).tables[1].as_records()
    assert row["replay"] == "run_battery(controllers, [3], arm=arm)"


@pytest.mark.parametrize("case", [({}, [0], ["real"]), (TWO, [], ["real"]), (TWO, [0], []), (TWO, [0], ["wet"])])
def test_a_battery_of_nothing_is_refused(case):
    with pytest.raises(InvalidInputError, match="give one or more of each, plants from real, clean"):
        run_battery(*case)


def test_seeds_of_several_batches_come_in_order(monkeypatch):
    monkeypatch.setattr("contactsafe.experiments.collisions.BATCH", 2)
    result = run_battery({"safe": presets.safe()}, range(5), ["clean"])
    assert [trial.seed for trial in result.trials] == [0, 1, 2, 3, 4]
    assert [recording.seed for recording in result.recordings] == [0]


def test_progress_adds_up_to_what_was_announced():
    config = ExperimentConfig(("safe",), trials=2, plants=("clean",))
    done = []
    collisions(config, done.append)
    assert sum(done) == ENTRIES["collisions"].count(config) == 2


def test_worlds_lent_from_controller_to_controller_do_what_new_ones_do():
    """An obstacle whose hold travels was left where the run before had pushed it."""
    arm = robots.panda()
    motion = sample_motion(arm, 2)
    assert motion.holds
    thing = Obstacle((0.3, 0.1, 0.7), 0.05, 3e3, 1.0, travel=(0.1, 0.0, 0.0), travel_s=(0.2, 0.6))
    config = motion.world((thing,), REAL_SENSORS)
    new = Worlds(arm, [config], presets.safe(), 1, [7])
    (expected,) = record(new, [motion])
    lent = Worlds(arm, [config], presets.paper(), 1, [7])
    record(lent, [motion])
    lent.use(presets.safe())
    lent.seed([7])
    (found,) = record(lent, [motion])
    assert found.tobytes() == expected.tobytes()


def trace(n):
    rows = np.zeros(n, dtype=trace_dtype(7))
    rows["time"] = np.arange(n) / 1000
    rows["q"] = robots.panda().home
    return rows


def test_metrics_are_what_they_say():
    arm, rows, free = robots.panda(), trace(1000), trace(1000)
    rows["obstacle_force"][100:200] = 40.0
    rows["obstacle_force"][800:] = 10.0
    rows["tau_arm"][150, 3] = -7.0
    rows["link"][112:] = 5
    rows["mode"][112:212], rows["mode"][212:312] = COMPLY, REJECT
    rows["position"][:, 0] = np.linspace(0.0, 0.03, 1000)
    rows["q"][300:400, 3] = arm.q_max[3]
    found = collision_metrics(rows, free, arm)
    expected = {
        "met": 1.0, "contact_peak_n": 40.0, "contact_steady_n": 4.0, "impulse_ns": 6.0, "tau_peak_nm": 7.0,
        "tau_steady_nm": 0.0, "detect_ms": 12.0, "tool_error_mm": 30.0, "tool_error_end_mm": 30.0,
        "tool_force_peak_n": 0.0, "comply_fraction": 0.1, "reject_fraction": 0.1, "mode_switches": 2.0,
        "limit_touches": 1.0,
    }  # fmt: skip
    assert found == pytest.approx(expected)
