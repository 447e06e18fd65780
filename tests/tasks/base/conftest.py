"""Every task of the registry in turn, its episodes six policy steps long."""

import gymnasium
import pytest

from contactsafe.tasks import TASKS, task_by_name
from contactsafe.tasks.base.registry import env_id


@pytest.fixture(scope="module", params=TASKS)
def task(request):
    """Name of the task."""
    return request.param


@pytest.fixture(scope="module")
def short(task):
    """Its configuration."""
    return task_by_name(task).simulation.config_type(episode_s=0.1)


@pytest.fixture(scope="module")
def name(task):
    """What Gymnasium calls it."""
    return env_id(task)


@pytest.fixture(scope="module")
def env(name, short):
    """One environment, for tests that begin with a reset."""
    return gymnasium.make(name, config=short)


@pytest.fixture
def envs(name, short):
    """Three, stepped natively."""
    made = gymnasium.make_vec(name, num_envs=3, config=short)
    yield made
    made.close()
