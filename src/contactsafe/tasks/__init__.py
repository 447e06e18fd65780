"""Tasks: what an arm is to learn. `base` is common to all; every other folder is one of them, and a line here."""

from contactsafe.tasks.base.registry import ENGINES, TASKS, import_task, make_vec, register_task, task_by_name

register_task("wiping", "contactsafe.tasks.wiping.task:TASK")
register_task("insertion", "contactsafe.tasks.insertion.task:TASK")

DEFAULT_TASK = "wiping"
"""The task that commands take where none is named."""

__all__ = ["DEFAULT_TASK", "ENGINES", "TASKS", "import_task", "make_vec", "register_task", "task_by_name"]
