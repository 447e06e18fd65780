"""The policies' masks from photographs: taken of every world, and segmented as a real camera's are."""

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks.wiping.photograph import PHOTO_PX, Photographer
from contactsafe.tasks.wiping.whiteboards import Whiteboards
from contactsafe.vision.segment import Segmenter


class PhotographSource(Independent):
    """Cameras over the boards of some worlds, and what finds the ink in their pictures.

    It keeps no state: light, pen and camera of an episode follow from `light` of its `task_dtype` record, the noise of
    a picture from that and `steps`. Where the arm hides the board is known by the encoders, as on a real arm.

    Args:
        worlds: whose arms stand before the boards.
        boards: that are seen.
    """

    def __init__(self, worlds: Worlds, boards: Whiteboards):
        camera, board = boards.camera_config, boards.config
        self._worlds, self._boards = worlds, boards
        self._photographers = [Photographer(camera, board, model) for model in worlds.models]
        first = self._photographers[0]
        self._segmenter = Segmenter(first.homography, first.corners, PHOTO_PX, camera.size)

    def photograph(self, i: int, task: np.void) -> np.ndarray:
        """Take the photograph of world i, uint8 (455, 455, 3); `task` is its record."""
        photographer = self._photographers[i]
        solids = photographer.solids(self._worlds.datas[i])
        return photographer.take(self._boards.cells[i], solids, int(task["light"]), int(task["steps"]))

    def look(self, start: int, stop: int, tasks: np.ndarray) -> None:
        """Put what is seen in the photographs of worlds start to stop in place of their masks."""
        for i in range(start, stop):
            photographer = self._photographers[i]
            hidden = photographer.hidden(photographer.solids_at(self._worlds.records[i]["errors"]["q_seen"]))
            self._boards.masks[i] = self._segmenter.segment(self.photograph(i, tasks[i]), hidden)
