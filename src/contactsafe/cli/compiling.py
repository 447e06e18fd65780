"""Everything that compiles, done once: what `contactsafe warmup` goes through."""

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from contactsafe.control.contact_estimator import ContactEstimator
from contactsafe.control.controller import Controller
from contactsafe.control.presets import safe
from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.control_loop import ControlLoop, ControlSettings
from contactsafe.hardware.exchange import Exchange
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.actor import Actor, PolicySettings
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.policy.policy import Policy
from contactsafe.robot.arm import Arm, arm_from_description
from contactsafe.robot.fr3 import FR3
from contactsafe.robot.franka import HAND
from contactsafe.robot.panda import PANDA
from contactsafe.robot.robots import fr3, panda
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks import DEFAULT_TASK, TASKS, make_vec, task_by_name
from contactsafe.tasks.base.task import Task
from contactsafe.tasks.insertion.robot import InsertionRobot
from contactsafe.vision.rectify import rectify

MOST_JOINTS = 14


def steps(joints: Sequence[str] = ("7",)) -> dict[str, Callable[[], object]]:
    """Return what is to be done, by name.

    Args:
        joints: numbers of joints of the arms that will be driven.

    Raises:
        InvalidInputError: a number is none, or out of range.
    """
    for word in joints:
        if not word.isdecimal() or not 1 <= int(word) <= MOST_JOINTS:
            raise InvalidInputError(f"joints = {word}; give numbers from 1 to {MOST_JOINTS}, such as 6,7")
    found: dict[str, Callable[[], object]] = {
        f"controller, {word} joints": partial(_control, int(word)) for word in joints
    }
    found |= {f"estimator, {word} joints": partial(_feel, int(word)) for word in joints}
    found["worlds"] = _run_worlds
    for name in TASKS:
        found |= {f"{name}{what}": run for what, run in _of_task(task_by_name(name)).items()}
    return found | {"policy and encoder": _see, "control loop and policy of a real robot": _drive}


def _of_task(task: Task) -> dict[str, Callable[[], object]]:
    """Return the runs that compile all variants of a task, by what follows its name."""
    runs: dict[str, Callable[[], object]] = {"": partial(_do, task.name, task.config())}
    if task.randomised:
        runs[", randomised"] = partial(_do, task.name, task.training_config(True))
    for package, name, config, engine in task.warmup:
        if importlib.util.find_spec(package):
            runs[name] = partial(_do, task.name, config, engine)
    return runs


def _do(task: str, config: Any, engine: str = "mujoco") -> None:
    envs = make_vec(task, 1, config, engine)
    envs.reset(seed=0)
    envs.step(np.zeros((1, ACTION_SIZE), np.float32))
    envs.close()


def _control(n: int) -> None:
    Controller(_arm_of(n))


def _feel(n: int) -> None:
    ContactEstimator(_arm_of(n))


def _arm_of(n: int) -> Arm:
    """Make an arm of n joints out of the Panda's."""
    links, home = (2 * PANDA.links)[:n], (2 * PANDA.home)[:n]
    return arm_from_description(replace(PANDA, links=links, home=home), HAND)


def _run_worlds() -> None:
    worlds = Worlds(panda())
    worlds.reset(0, worlds.arm.home)
    worlds.run(1)


def _drive() -> None:
    """Make both for a robot that is none; they run once without driving anything."""
    exchange, task = Exchange.create(len(FR3.links)), InsertionRobot()
    arm, work = fr3(task.tool), task.work()
    try:
        nothing: Any = SimpleNamespace(torque_rate=np.ones(arm.n))
        ControlLoop(ControlSettings(arm, safe(), nothing), exchange)
        work.prepare(arm, lockstep=True)
        Actor(PolicySettings(arm, shipped_bundle("insertion"), work), exchange)
    finally:
        exchange.unlink()


def _see() -> None:
    make_sampler = task_by_name(DEFAULT_TASK).mask_sampler
    if make_sampler is None:
        return
    sampler = make_sampler()
    masks, tools = sampler.sample(2, 0)
    Policy(shipped_bundle(DEFAULT_TASK), sampler.homography)
    rectify(masks[..., None], tools, sampler.homography, 0.64, 64)
