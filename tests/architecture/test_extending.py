"""One of each is added from outside the package, without touching a file of it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.sim.nominal_backend import NominalBackend

from contactsafe.control import config
from contactsafe.control.config import DetectionConfig
from contactsafe.control.parameter import allowed, parameter
from contactsafe.control.params import fill_params, params_dtype
from contactsafe.control.presets import safe
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments import registry
from contactsafe.experiments.config import Entry, ExperimentConfig
from contactsafe.policy.observation import Observation
from contactsafe.report import terminal_table
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.metrics import Aim, Metric
from contactsafe.robot.arm import arm_from_description
from contactsafe.robot.franka import HAND
from contactsafe.robot.panda import PANDA
from contactsafe.robot.robots import panda
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks import TASKS, make_vec, register_task
from contactsafe.tasks.base.evaluation import evaluate_policy
from contactsafe.tasks.base.figures import EpisodeMetric, Figure, largest
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.tasks import InsertionTasks


@dataclass(frozen=True)
class WarmConfig(InsertionConfig):
    """Insertion by an arm that grows warm."""

    warmth: float = 20.0


class WarmTasks(InsertionTasks):
    """It observes its temperature: a field, and how a network takes it."""

    name = "warm"
    config_type = WarmConfig
    own_fields = (*InsertionTasks.own_fields, ("temperature", float, (1,)))
    episode_metrics = (EpisodeMetric("warmest", "temperature"),)
    figures = (Figure("warmest", "temperature at the end, °C: largest", largest("warmest")),)

    @property
    def observation_vectors(self):
        warm = Observation("temperature", centre=(20.0,), scale=(5.0,), unit="°C")
        return (*super().observation_vectors, warm)

    def finish_step(self, start, stop):
        super().finish_step(start, stop)
        tasks = self.tasks[start:stop]
        tasks["temperature"][:, 0] = self.config.warmth + 0.01 * tasks["steps"]

    def own_info(self):
        return {**super().own_info(), "temperature": self.tasks["temperature"][:, 0].copy()}


@dataclass(frozen=True)
class WarmDetection(DetectionConfig):
    """Detection by an arm that grows warm."""

    warmth_gain: float = parameter(0.5, "1/K", "threshold per kelvin", fraction=True)


@pytest.fixture
def warm_stage(monkeypatch):
    """The stage as it is after a field was added to its file."""
    monkeypatch.setitem(config.STAGES, "detection", WarmDetection)
    monkeypatch.setitem(config.STAGE_OF, "warmth_gain", "detection")


@pytest.mark.usefixtures("warm_stage")
def test_a_parameter_is_a_field_that_is_checked_recorded_and_read_from_the_command_line():
    with pytest.raises(InvalidInputError, match=r"^warmth_gain = 1\.5 is no fraction; give more than 0 and at most 1$"):
        WarmDetection(warmth_gain=1.5)
    value = config.value_from_text("warmth_gain", "0.25")
    warm = replace(safe(), detection=WarmDetection()).with_(warmth_gain=value)
    params = np.zeros((), dtype=params_dtype(7))
    fill_params(params, warm, panda())
    assert params["detection"]["warmth_gain"] == 0.25
    assert params["detection"]["residual_threshold"] == WarmDetection().residual_threshold
    assert allowed(WarmDetection.__dataclass_fields__["warmth_gain"]) == "> 0, ≤ 1"


@pytest.fixture
def warm_task():
    before = dict(TASKS)
    register_task("warm", f"{__name__}:WarmTasks")
    yield "warm"
    TASKS.clear()
    TASKS.update(before)


def test_an_observation_and_a_task_are_a_class(warm_task):
    env = make_vec(warm_task, 2, WarmConfig(warmth=30.0))
    assert env.single_observation_space["temperature"].shape == (1,)
    env.reset(seed=0)
    observation, *_ = env.step(np.zeros((2, 18), np.float32))
    np.testing.assert_allclose(observation["temperature"], 30.01, rtol=1e-6)
    assert env.unwrapped.observation_vectors[-1].name == "temperature"
    env.close()


class CoolTasks(WarmTasks):
    """The same with a scalar field."""

    own_fields = (*InsertionTasks.own_fields, ("temperature", float))

    @property
    def observation_vectors(self):
        return (*InsertionTasks.observation_vectors.fget(self), Observation("temperature", 20.0, 5.0, "°C"))

    def finish_step(self, start, stop):
        InsertionTasks.finish_step(self, start, stop)
        self.tasks["temperature"][start:stop] = 21.0

    def own_info(self):
        return InsertionTasks.own_info(self)


def test_a_scalar_that_is_observed_is_a_vector_of_one_number():
    tasks = CoolTasks(WarmConfig(), n=3)
    for i in range(3):
        tasks.reset(i, np.random.default_rng(0))
    tasks.step(np.zeros((3, 18)))
    np.testing.assert_array_equal(tasks.observation()["temperature"], np.full((3, 1), 21.0, np.float32))
    assert tasks.observation(1)["temperature"].shape == (1,)
    tasks.worlds.close()


@pytest.mark.parametrize(
    ("vector", "told"),
    [
        (Observation("heat", 20.0, 5.0), "observation 'heat' is no field of the task; declare it in own_fields"),
        (Observation("temperature", (20.0, 20.0), (5.0, 5.0)), "has 2 centres, and the field of that name 1 numbers"),
    ],
)
def test_an_observation_that_is_no_such_field_is_refused_when_the_tasks_are_made(vector, told):
    with pytest.raises(InvalidInputError, match=told):
        type("OddTasks", (CoolTasks,), {"observation_vectors": (vector,)})(WarmConfig())


def test_an_observation_whose_scale_is_no_number_is_refused():
    with pytest.raises(InvalidInputError, match="observation 'heat' has scale = 'hot'; give a number, or one for each"):
        Observation("heat", 20.0, "hot")


class Still:
    """A script."""

    def act(self, observation):
        return np.zeros((len(observation["offset"]), 18), np.float32)


def test_a_figure_and_a_script_are_a_declaration_and_a_class(warm_task):
    env = make_vec(warm_task, 1, WarmConfig(episode_s=0.1))
    found = evaluate_policy(Still(), env, 1, seed=0)
    assert found["warmest"] == pytest.approx(20.06)
    assert found["records"][0]["warmest"] == pytest.approx(20.06)
    env.close()


def warming(config, progress=None):
    """An experiment."""
    trials = tuple(
        Trial("at noon", name, seed, {"warmth_k": 20.0 + seed}) for name in config.controllers for seed in config.seeds
    )
    metrics = (Metric("warmth_k", "warmth", "K", main=True, aim=Aim(at_most=22.0)),)
    return Experiment("warming", "Warming", "How warm does it grow?", trials, metrics)


def test_an_experiment_is_a_function_and_an_entry(monkeypatch):
    entry = Entry("warming", "how warm does it grow?", warming, trials=3)
    monkeypatch.setitem(registry.ENTRIES, entry.name, entry)
    found = registry.by_name("warming")
    experiment = found.run(ExperimentConfig(("vices", "safe"), found.trials), None)
    (row,) = [line for line in terminal_table([experiment]).splitlines() if line.startswith("  warmth")]
    assert "under 22 K ok" in row
    assert experiment.as_dict()["metrics"]["warmth_k"]["unit"] == "K"


def test_a_robot_is_a_description():
    """Its model, plant and place in a task are made of it."""
    longer = replace(PANDA, name="panda with a long neck", mount_position=(0.0, 0.0, 0.157))
    worlds = Worlds(arm_from_description(longer, HAND), seed=0)
    worlds.reset(0, longer.home)
    reach = worlds.records[0]["truth"]["position"][2]
    np.testing.assert_allclose(panda(HAND).tool_pose(PANDA.home).position[2] - reach, 0.05, atol=1e-6)
    worlds.run(10)
    assert not worlds.controllers["output"]["fault"].any()
    worlds.close()


def test_an_engine_is_a_class():
    worlds = Worlds(panda(), seed=0, backend=NominalBackend)
    worlds.reset(0, worlds.arm.home)
    start = worlds.records[0]["truth"]["position"].copy()
    for _ in range(6):
        worlds.run(17)
    assert worlds.records[0]["tick"] == 102
    assert np.abs(worlds.records[0]["truth"]["position"] - start).max() < 1e-3  # it holds still
