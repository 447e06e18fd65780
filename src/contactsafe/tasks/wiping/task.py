"""The wiping task as everything that takes a task by its name sees it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contactsafe.tasks.base.task import Task, TaskOptions, Variant
from contactsafe.tasks.wiping.config import ImageSource, RewardConfig, WipingConfig
from contactsafe.tasks.wiping.drawings import Boards
from contactsafe.tasks.wiping.randomisation import Randomisation
from contactsafe.tasks.wiping.sampling import MaskSampler
from contactsafe.tasks.wiping.scenes import Wiping
from contactsafe.tasks.wiping.scripted import SCRIPTED
from contactsafe.tasks.wiping.tasks import WipingTasks


@dataclass(frozen=True)
class WipingOptions(TaskOptions):
    """What `contactsafe evaluate` can be told of the wiping task.

    Attributes:
        controller: preset underneath.
        pushed: push the arm now and then, 5 to 25 N on links 3 to 6.
        boards: what is drawn on them; all but strokes need contactsafe[handwriting].
        image_source: the ink as it is (mask), or as segmentation finds it in photographs (photograph).
        randomised: every board another height, tilt, pad, camera and plant, as in training.
    """

    boards: Boards = WipingConfig.boards
    image_source: ImageSource = WipingConfig.image_source
    randomised: bool = False

    def settings(self) -> dict[str, Any]:
        """Return the fields of WipingConfig that these options set."""
        return {
            **super().settings(),
            "boards": self.boards,
            "image_source": self.image_source,
            "randomisation": Randomisation.broad() if self.randomised else None,
        }


AS_PAPER = Variant(
    config={"reward": RewardConfig.as_paper()},
    training_settings={
        "encoder": Path("runs/vae_paper"),
        "controller": "vices",
        "observes": ("pose",),
        "randomise": False,
        "dither": 0.0,
    },
)
"""Free-space controller, pose and latent alone, the reward in the paper's words, boards that differ in their ink."""


def _robot() -> Any:
    """Return the task for a real robot; pictures need OpenCV, which is loaded for it alone."""
    from contactsafe.tasks.wiping.robot import WipingRobot

    return WipingRobot()


TASK = Task(
    WipingTasks,
    WipingOptions,
    randomised={"randomisation": Randomisation.broad()},
    as_paper=AS_PAPER,
    scripted=SCRIPTED,
    mask_sampler=MaskSampler,
    scenes=Wiping,
    robot=_robot,
    warmup=(
        ("cv2", ", photographs", WipingConfig(image_source="photograph"), "mujoco"),
        ("pybullet", " in PyBullet", WipingConfig(), "pybullet"),
    ),
)
