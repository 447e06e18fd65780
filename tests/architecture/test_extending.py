"""One of each is added from outside the package, without touching a file of it."""

from dataclasses import dataclass

import numpy as np
from tests.control.test_parameter import Example
from tests.sim.nominal_backend import NominalBackend

from contactsafe.control.parameter import allowed, fill_record, record_fields
from contactsafe.policy.observation import Observation
from contactsafe.robot.robots import panda
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks import TASKS, make_vec, register_task
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

    @property
    def observation_vectors(self):
        warm = Observation("temperature", centre=(20.0,), scale=(5.0,), unit="°C")
        return (*super().observation_vectors, warm)

    def finish(self, start, stop):
        super().finish(start, stop)
        tasks = self.tasks[start:stop]
        tasks["temperature"][:, 0] = self.config.warmth + 0.01 * tasks["steps"]


def test_a_parameter_is_checked_recorded_and_documented_by_its_declaration():
    record = np.zeros((), dtype=record_fields(Example, 7))
    fill_record(record, Example(gain=3.0))
    assert record["gain"] == 3.0
    assert allowed(Example.__dataclass_fields__["gain"]) == "> 0"


def test_an_observation_and_a_task_are_a_class():
    before = dict(TASKS)
    register_task("warm", f"{__name__}:WarmTasks")
    try:
        env = make_vec("warm", 2, WarmConfig(warmth=30.0))
        assert env.single_observation_space["temperature"].shape == (1,)
        env.reset(seed=0)
        observation, *_ = env.step(np.zeros((2, 18), np.float32))
        np.testing.assert_allclose(observation["temperature"], 30.01, rtol=1e-6)
        assert env.unwrapped.observation_vectors[-1].name == "temperature"
        env.close()
    finally:
        TASKS.clear()
        TASKS.update(before)


def test_an_engine_is_a_class():
    worlds = Worlds(panda(), seed=0, backend=NominalBackend)
    worlds.reset(0, worlds.arm.home)
    start = worlds.records[0]["truth"]["position"].copy()
    for _ in range(6):
        worlds.run(17)
    assert worlds.records[0]["tick"] == 102
    assert np.abs(worlds.records[0]["truth"]["position"] - start).max() < 1e-3  # it holds still
