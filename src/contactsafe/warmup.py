"""Everything that compiles, done once: what `contactsafe warmup` goes through."""

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np

from contactsafe.control.controller import Controller
from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.policy.policy import Policy
from contactsafe.robot.arm import Arm, arm_from_description
from contactsafe.robot.franka import HAND
from contactsafe.robot.panda import PANDA
from contactsafe.robot.robots import panda
from contactsafe.sim.randomisation import Randomisation
from contactsafe.sim.world import Worlds
from contactsafe.tasks import ENGINES
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.sampling import MaskSampler
from contactsafe.vision.rectify import rectify

MOST_JOINTS = 14


def steps(joints: Sequence[str] = ("7",)) -> dict[str, Callable[[], object]]:
    """Give what is to be done, by name.

    Args:
        joints: numbers of joints of the arms that will be driven.

    Raises:
        InvalidInputError: a number is none, or out of range.
    """
    for word in joints:
        if not word.isdecimal() or not 1 <= int(word) <= MOST_JOINTS:
            raise InvalidInputError(f"joints = {word}; give numbers from 1 to {MOST_JOINTS}, such as 6,7")
    return {
        **{f"controller, {word} joints": partial(_control, int(word)) for word in joints},
        "worlds": _run_worlds,
        "wiping": partial(_wipe, ENGINES["mujoco"], WipingConfig()),
        "wiping, randomised": partial(_wipe, ENGINES["mujoco"], WipingConfig(randomisation=Randomisation.broad())),
        **({"photographs": _photograph} if importlib.util.find_spec("cv2") else {}),
        **({"wiping in PyBullet": _wipe_in_bullet} if importlib.util.find_spec("pybullet") else {}),
        "policy and encoder": _see,
    }


def _control(n: int) -> None:
    Controller(_arm_of(n))


def _arm_of(n: int) -> Arm:
    """Make an arm of n joints out of the Panda's."""
    links, home = (2 * PANDA.links)[:n], (2 * PANDA.home)[:n]
    return arm_from_description(replace(PANDA, links=links, home=home), HAND)


def _run_worlds() -> None:
    worlds = Worlds(panda())
    worlds.reset(0, worlds.arm.home)
    worlds.run(1)
    worlds.render()


def _wipe(task: str, config: WipingConfig) -> None:
    envs = gymnasium.make_vec(task, num_envs=1, config=config)
    envs.reset(seed=0)
    envs.step(np.zeros((1, 18), np.float32))
    envs.close()


def _photograph() -> None:
    _wipe(ENGINES["mujoco"], WipingConfig(image_source="photograph"))


def _wipe_in_bullet() -> None:
    _wipe(ENGINES["pybullet"], WipingConfig())


def _see() -> None:
    sampler = MaskSampler()
    masks, tools = sampler.sample(2, 0)
    Policy(shipped_bundle(), sampler.homography)
    rectify(masks[..., None], tools, sampler.homography, 0.64, 64)
