"""Tasks: what an arm is to learn. `base` is what they share; every other folder is one of them."""

from contactsafe.tasks.base.registry import register_task

register_task("wiping", "contactsafe.tasks.wiping.tasks:WipingTasks")
register_task("insertion", "contactsafe.tasks.insertion.tasks:InsertionTasks")
