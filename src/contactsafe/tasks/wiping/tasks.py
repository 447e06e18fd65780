"""The wiping task: ink on a whiteboard, seen by a camera, to be wiped off gently."""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.state import Entry, of_object
from contactsafe.policy.action import DOWN
from contactsafe.policy.observation import Observation
from contactsafe.robot.arm import Pose, finite_array
from contactsafe.sim.config import WorldConfig
from contactsafe.tasks.base.tasks import Tasks
from contactsafe.tasks.wiping.board import furnish, pad_half
from contactsafe.tasks.wiping.camera import camera_at
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.drawings import paint_board
from contactsafe.tasks.wiping.figures import EPISODE_METRICS, FIGURES
from contactsafe.tasks.wiping.ink import nearest_ink
from contactsafe.tasks.wiping.observation import observation_vectors
from contactsafe.tasks.wiping.step import OWN_FIELDS, REWARD_TERMS, WEIGHTS, finish, observe, rewards_dtype
from contactsafe.tasks.wiping.variation import Variation
from contactsafe.tasks.wiping.whiteboard import square_image
from contactsafe.tasks.wiping.whiteboards import Whiteboards


class WipingTasks(Tasks):
    """Boards to be wiped, N at a time.

    Observation: `pose`, tool position (m, world) and rotation vector from straight down (rad), (6,); `target`, x_d less
    that pose (m, rad), K1 (1/s²) and D1 (1/s) as now in force, (18,); `force` of the board on the tool as the wrist
    measures it, smoothed, world axes (N), (3,); `mask`, the segmented camera image, ink 0 and everything else 255,
    (128, 128, 1).
    `reset(options={"drawing": image})` puts a drawing of the user's own on the board, `start` the tool somewhere.

    Attributes:
        boards: `Whiteboards` of the worlds.
    """

    name = "wiping"
    config_type = WipingConfig
    reward_terms = REWARD_TERMS
    own_fields = OWN_FIELDS
    own_bounds = {"light": (0, 2**31)}
    reset_options = ("drawing", "start")
    episode_metrics = EPISODE_METRICS
    figures = FIGURES
    place = "board.centre"
    start_info = {"ink_left": 1.0}

    @property
    def centre(self) -> tuple[float, float, float]:
        """Middle of the board."""
        return self.config.board.centre

    @property
    def varies(self) -> bool:
        """Whether episodes change the worlds' models."""
        return self.config.randomisation is not None

    def reached(self) -> tuple[Pose, ...]:
        """Return a grid of where the tool may start."""
        reach, centre = self.config.start_reach, np.array(self.config.board.centre)
        grid = itertools.product((-reach, 0.0, reach), (-reach, 0.0, reach), self.config.start_height)
        return tuple(Pose(centre + offset, DOWN) for offset in grid)

    def furnish(self, world: WorldConfig) -> WorldConfig:
        """Return a world with the board in it."""
        return furnish(world, self.config.board)

    @property
    def observation_vectors(self) -> tuple[Observation, ...]:
        """Pose, target and force."""
        return observation_vectors(self.config.action)

    def prepare(self) -> None:
        """Hang up the boards, and what looks at them."""
        config, ranges = self.config, self.config.randomisation
        if ranges is not None and self.worlds.backends:
            raise InvalidInputError("randomisation is given, and this engine knows none; leave it out, or use MuJoCo")
        self.boards = Whiteboards(config.board, config.camera, self.worlds.models, pad_half(self.arm))
        self._variation = None if ranges is None else Variation(self.worlds, self.boards, ranges)
        self._photographs = self._photograph_source()
        self._rewards = np.zeros(1, dtype=rewards_dtype)
        for name in (*REWARD_TERMS, *WEIGHTS[:-1]):
            self._rewards[name] = getattr(config.reward, name)
        self._rewards["clean_fraction"] = config.clean_fraction

    def _photograph_source(self) -> Any:
        """Make what looks at the worlds in place of their own masks, if anything; OpenCV is loaded for it alone."""
        if self.config.image_source == "mask":
            return None
        from contactsafe.tasks.wiping.photographs import PhotographSource

        return PhotographSource(self.worlds, self.boards)

    def begin_episode(self, i: int, rng: np.random.Generator, options: Mapping[str, Any]) -> Pose:
        """Paint board i and sample the tool's start."""
        config, board = self.config, self.boards.boards[i]
        drawing, start = options.get("drawing"), options.get("start")
        start = None if start is None else self._checked_start(start)
        drawing = None if drawing is None else square_image(drawing)
        board.clear()
        if drawing is None:
            paint_board(board, config.boards, rng)
        else:
            board.paint(drawing)
        if start is None:
            reach = config.start_reach
            start = np.add(config.board.centre, [*rng.uniform(-reach, reach, 2), rng.uniform(*config.start_height)])
        if self._variation is not None:
            self._variation.sample(i, rng)
        return Pose(start, DOWN)

    def _checked_start(self, start: Any) -> np.ndarray:
        """Return a start of the user's own, (3,), m, before anything is changed for it."""
        start, lowest = finite_array(start, (3,), "start"), self.config.board.centre[2]
        if start[2] < lowest:
            raise InvalidInputError(f"start[2] = {start[2]} m is below the board; give {lowest} m or more")
        self.posture_over(Pose(start, DOWN))
        return start

    def after_reset(self, i: int, rng: np.random.Generator) -> None:
        """Count the ink and look at the board for the first time."""
        boards, task = self.boards, self.tasks[i]
        boards.enter_ink(i)
        record, tool = boards.records[i], self.worlds.controllers[i]["output"]["position"]
        ink, distance = nearest_ink(boards.ink_index, i, boards.cells[i], record["origin"], record["cell"], tool)
        task["ink_start"], task["ink"], task["distance"] = ink, ink, distance
        task["light"] = 0 if self._photographs is None else rng.integers(2**31)
        self._look_first(i)

    def observe(self, i: int) -> None:
        """Look again at world i, after its board was changed by hand."""
        self.boards.enter_ink(i)
        self._look_first(i)

    def _look_first(self, i: int) -> None:
        worlds, boards, task = self.worlds, self.boards, self.tasks[i]
        camera = camera_at(boards.cameras, boards.records[i]["camera"])
        plant, shown = worlds.records[i]["plant"], boards.ink_index.shown[i]
        observe(plant, worlds.controllers[i], camera, shown, task, boards.masks[i])
        if self._photographs is not None:
            self._photographs.look(i, i + 1, self.tasks)
        if self._variation is not None:
            self._variation.look_first(i)

    def before_step(self) -> None:
        """Take in what was painted on the boards since the last step."""
        self.boards.enter_changed()

    def finish_step(self, start: int, stop: int) -> None:
        """Erase, score and look, in the worlds from start to stop."""
        worlds, boards = self.worlds, self.boards
        boards.erase(start, stop, worlds)
        finish(
            start, stop, worlds.records, worlds.controllers, worlds.metrics, boards.arrays, self._rewards[0], self.tasks
        )  # fmt: skip
        if self._photographs is not None:
            self._photographs.look(start, stop, self.tasks)
        if self._variation is not None:
            self._variation.look(start, stop)

    def own_entries(self) -> dict[str, Entry]:
        """List boards and what varies."""
        variation = {} if self._variation is None else {"variation": of_object(self._variation)}
        return {**variation, "boards": of_object(self.boards)}

    def own_info(self) -> dict[str, np.ndarray]:
        """Return how much ink is left, and whether the arm has met the table."""
        tasks = self.tasks
        left = tasks["ink"] / np.maximum(tasks["ink_start"], 1)
        return {"ink_left": left, "arm_touched": tasks["failed"] == 1}

    def own_observation(self, i: Any) -> dict[str, np.ndarray]:
        """Return the masks of tasks i, uint8 (…, size, size, 1)."""
        return {"mask": self.boards.masks[i][..., None].copy()}

    def own_spaces(self) -> dict[str, gymnasium.Space]:
        """Return the space of a mask."""
        size = self.config.camera.size
        return {"mask": gymnasium.spaces.Box(0, 255, (size, size, 1), np.uint8)}

    @property
    def camera_homography(self) -> np.ndarray:
        """Board-plane coordinates (x, y, 1), m, to mask pixels (u, v, w), (3, 3)."""
        return self.boards.homography

    def picture(self, i: int) -> np.ndarray:
        """Return mask i as an image, uint8 (512, 512, 3)."""
        return np.kron(self.boards.masks[i], np.ones((4, 4), np.uint8))[..., None].repeat(3, axis=-1)

    def compile_key(self) -> tuple[Any, ...]:
        """Return what decides which code a step compiles."""
        return (*super().compile_key(), self.config.image_source, self.config.randomisation is not None)

    def scratch(self) -> "WipingTasks":
        """Make one task alike to warm up with; its board needs no fonts."""
        return type(self)(replace(self.config, boards="strokes"), 1, arm=self.arm, backend=self._backend)
