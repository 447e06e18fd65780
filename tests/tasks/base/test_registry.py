"""Tasks by name: each is found, made in either way of Gymnasium, and what is unknown is told with what there is."""

import gymnasium
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.conditions import Conditions
from contactsafe.tasks import ENGINES, TASKS, make_vec, task_by_name
from contactsafe.tasks.base.registry import backend_of, env_id, register_task
from contactsafe.tasks.base.task import Task, TaskOptions
from contactsafe.tasks.wiping.tasks import WipingTasks


@pytest.mark.parametrize("name", TASKS)
def test_a_task_bears_the_name_that_it_is_found_by(name):
    task = task_by_name(name)
    assert isinstance(task, Task)
    assert task.name == name
    assert env_id(name) in gymnasium.registry


@pytest.mark.parametrize("name", TASKS)
def test_a_tasks_configuration_keeps_to_options_and_conditions(name):
    task = task_by_name(name)
    assert task.config() == task.simulation.config_type()
    conditions = Conditions(controller="vices", gains="low")
    assert task.config(None, conditions).controller == "vices"
    assert task.config(None, conditions).action.gains == "low"
    asked = task.options(controller="paper", pushed=True)
    assert task.config(asked, conditions).controller == "paper"
    assert task.config(asked, conditions).pushes is not None


def test_options_left_out_set_no_controller():
    assert TaskOptions().settings() == {"pushes": None}


def test_what_is_unknown_is_told_with_what_there_is():
    for find in (task_by_name, lambda name: make_vec(name, 1)):
        with pytest.raises(InvalidInputError, match=f"task 'cartpole' is unknown; choose from {', '.join(TASKS)}"):
            find("cartpole")
    with pytest.raises(InvalidInputError, match=f"engine = 'steam'; choose {' or '.join(ENGINES)}"):
        backend_of("steam")


@pytest.mark.parametrize("place", ["press.PressTasks", "press", "press:", ":PressTasks", "a:b:c", "", None])
def test_a_place_without_a_colon_was_accepted_and_failed_on_unpacking(place):
    with pytest.raises(
        InvalidInputError, match=r"^task 'press': place = .*; give 'module:NAME' of its Task or .*Tasks'$"
    ):
        register_task("press", place)
    assert "press" not in TASKS
    assert env_id("press") not in gymnasium.registry


@pytest.mark.parametrize("name", ["Press", "press button", "", 3])
def test_a_name_that_no_command_can_take_is_refused(name):
    with pytest.raises(InvalidInputError, match=r"give a name in lower case, such as 'wiping'$"):
        register_task(name, "press:PressTasks")


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("contactsafe.tasks.wiping.tasks:Wiper", "cannot be imported: AttributeError"),
        ("contactsafe.tasks.nowhere:TASK", "cannot be imported: ModuleNotFoundError"),
        ("contactsafe.tasks.wiping.config:WipingConfig", "no Task and no subclass of Tasks; register one"),
        ("contactsafe.tasks.base.registry:ENGINES", "no Task and no subclass of Tasks; register one"),
        ("contactsafe.tasks.wiping.task:TASK", "calls itself 'wiping'; register it by that name"),
    ],
)
def test_a_task_that_is_not_where_it_was_registered_was_a_traceback(place, told):
    try:
        register_task("lost", place)
        for find in (task_by_name, lambda name: make_vec(name, 1)):
            with pytest.raises(InvalidInputError, match=f"^task 'lost': {place} .*{told}"):
                find("lost")
    finally:
        TASKS.pop("lost", None)
        gymnasium.registry.pop(env_id("lost"), None)


class BareTasks(WipingTasks):
    """A task of which nothing but the simulation is declared."""

    name = "bare"


def test_registering_a_subclass_of_tasks_is_enough_and_twice_is_once():
    place = f"{__name__}:BareTasks"
    try:
        register_task("bare", place)
        register_task("bare", place)
        task = task_by_name("bare")
        assert task == Task(task.simulation)
        assert task.scenes is None
        assert list(task.scripted) == ["random"]
    finally:
        TASKS.pop("bare", None)
        gymnasium.registry.pop(env_id("bare"), None)
