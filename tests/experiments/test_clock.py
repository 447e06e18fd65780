"""The clock experiment: what its worlds do to a controller's clock, and the figures of a few of its cases."""

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.experiments import clock, clock_tables
from contactsafe.experiments.clock import clock_metrics
from contactsafe.experiments.clock_cases import CASES, SITUATIONS, Case, Scene, sample_scene
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.late_worlds import FROZEN, LOST, NO_CALL, SEEN, LateWorlds
from contactsafe.robot import robots
from contactsafe.sim.config import REAL_SENSORS, WorldConfig
from contactsafe.sim.truth import trace_dtype


@pytest.fixture(scope="module")
def panda():
    return robots.panda()


def worlds(panda, codes, timed=True):
    made = LateWorlds(panda, [WorldConfig(sensors=REAL_SENSORS)], presets.safe(), [0], [codes], timed)
    made.reset(0, panda.home)
    return made


def test_a_controller_that_is_not_called_leaves_its_torque_in_force(panda):
    late = worlds(panda, [SEEN] * 4 + [NO_CALL] * 3 + [SEEN])
    trace = np.zeros((1, 8), dtype=trace_dtype(7))
    late.run(8, trace)
    torque = trace[0]["torque"]
    assert (torque[4:7] == torque[3]).all()
    assert late.controllers[0]["state"]["clock"]["elapsed"] == pytest.approx(4.0)


def test_a_frozen_measurement_is_the_last_one_with_its_time(panda):
    frozen = worlds(panda, [SEEN] * 3 + [FROZEN] * 3)
    frozen.run(3)
    before = frozen.controllers["measurement"].copy()
    frozen.run(3)
    assert (frozen.controllers["measurement"] == before).all()
    assert before[0]["time"] == pytest.approx(0.002)
    assert frozen.controllers[0]["output"]["bridged"] == 3


def test_a_lost_measurement_has_no_numbers(panda):
    lost = worlds(panda, [SEEN, SEEN, LOST], timed=False)
    lost.run(3)
    assert np.isnan(lost.controllers[0]["measurement"]["q"]).all()
    assert lost.controllers[0]["output"]["bridged"] == 1


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_codes_say_what_happens_at_each_tick(case):
    codes = case.codes(1000, 400, np.random.default_rng(0))
    assert codes.shape == (1000,)
    assert ((codes >= SEEN) & (codes <= 6)).all()
    assert (codes != SEEN).any() or case.silent_s > 0.0


def test_deviation_is_that_from_the_run_left_alone(panda):
    calm = np.zeros(100, dtype=trace_dtype(7))
    trace = calm.copy()
    trace["position"][60:, 1] = 0.003
    trace["mode"][70:80] = 1
    trace["torque"][50:, 2] = 0.5
    scene = Scene(None, (), 0, 40)
    found = clock_metrics(trace, calm, scene, CASES[0])
    assert found["tool_away_mm"] == pytest.approx(3.0)
    assert found["false_contact_ms"] == 10
    assert found["torque_step_nm"] == pytest.approx(0.5)
    assert np.isnan(found["tool_travel_mm"])
    stopped = clock_metrics(trace, calm, scene, Case("stopped", CASES[0].codes, stops=True))
    assert stopped["tool_travel_mm"] == pytest.approx(3.0)
    assert np.isnan(stopped["tool_away_mm"])


@pytest.mark.slow
def test_arms_that_move_and_rest_are_bridged_and_braked(panda, monkeypatch):
    chosen = [case for case in CASES if case.name in ("tick 20 ms late", "frozen for 20 ms", "frozen for 300 ms")]
    monkeypatch.setattr(clock, "CASES", chosen)
    for module in (clock, clock_tables):
        monkeypatch.setattr(module, "SITUATIONS", SITUATIONS[:2])
    told: list[int] = []
    config = ExperimentConfig(("safe",), trials=2, seed=3)
    found = clock.clock(config, told.append)
    assert sum(told) == len(found.trials) == clock.count(config)
    assert [len(table.rows) for table in found.tables] == [4, 2]
    for trial in found.trials:
        assert trial.metrics["false_contact_ms"] == 0
        assert trial.metrics["torque_step_nm"] <= 1.0
        assert not trial.metrics["tool_away_mm"] > 2.0
        assert trial.metrics["fault"] == (7 if "300" in trial.scenario else 0)


def test_a_scene_depends_on_its_seed_alone(panda):
    scenes = [sample_scene(panda, "moving", seed) for seed in (4, 5, 4)]
    assert scenes[0].motion.seed == scenes[2].motion.seed != scenes[1].motion.seed
    assert not scenes[0].motion.holds
