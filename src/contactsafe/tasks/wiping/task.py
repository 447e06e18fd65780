"""The wiping task as everything that takes a task by its name sees it."""

from dataclasses import dataclass
from typing import Annotated

from contactsafe.control import presets
from contactsafe.core.parse import one_of
from contactsafe.sim.drawings import Boards
from contactsafe.sim.randomisation import Randomisation
from contactsafe.tasks.base.entry import Task
from contactsafe.tasks.base.pushes import Pushes
from contactsafe.tasks.wiping.config import ImageSource, WipingConfig
from contactsafe.tasks.wiping.sampling import MaskSampler
from contactsafe.tasks.wiping.scripted import SCRIPTED


@dataclass(frozen=True)
class WipingOptions:
    """What `contactsafe evaluate` can be told of the wiping task.

    Attributes:
        controller: preset underneath.
        boards: what is drawn on them; all but strokes need contactsafe[handwriting].
        image_source: the ink as it is (mask), or as segmentation finds it in photographs (photograph).
        pushed: push the arm now and then, 5 to 25 N on links 3 to 6.
        randomised: every board another height, tilt, pad, camera and plant, as in training.
    """

    controller: Annotated[str, one_of(presets.PRESETS)] = WipingConfig.controller
    boards: Boards = WipingConfig.boards
    image_source: ImageSource = WipingConfig.image_source
    pushed: bool = False
    randomised: bool = False

    def config(self) -> WipingConfig:
        """Return the task's configuration."""
        return WipingConfig(
            controller=self.controller,
            boards=self.boards,
            image_source=self.image_source,
            pushes=Pushes() if self.pushed else None,
            randomisation=Randomisation.broad() if self.randomised else None,
        )


def training_config(randomise: bool) -> WipingConfig:
    """Return the configuration that policies are trained under."""
    return WipingConfig(randomisation=Randomisation.broad() if randomise else None)


TASK = Task(
    options=WipingOptions,
    training_config=training_config,
    scripted=SCRIPTED,
    mask_sampler=MaskSampler,
    variants=(
        ("cv2", ", photographs", WipingConfig(image_source="photograph"), None),
        ("pybullet", " in PyBullet", WipingConfig(), "pybullet"),
    ),
)
