"""The insertion task: a round peg, and a hole whose place is known only roughly; force and pose to find it by."""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import quat_to_matrix, rotvec_to_quat
from contactsafe.policy.action import DOWN
from contactsafe.policy.observation import Observation, target_observation
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, Pose, finite_array
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.fixtures import TipSurface
from contactsafe.tasks.base.tasks import Tasks
from contactsafe.tasks.insertion.config import MAX_START_M, InsertionConfig
from contactsafe.tasks.insertion.figures import EPISODE_METRICS, FIGURES
from contactsafe.tasks.insertion.observation import ELAPSED, OFFSET, WRENCH
from contactsafe.tasks.insertion.picture import TopView, paint
from contactsafe.tasks.insertion.scene import PEG, block, peg_radius, table
from contactsafe.tasks.insertion.step import OWN_FIELDS, REWARD_TERMS, begin, finish, parameters_dtype

STEEL = TipSurface(friction=0.3, solref=(0.02, 1.0), solimp=(0.9, 0.95, 0.001))
"""Steel between rubber finger tips, which yield: 10 kN/m beneath the arm's 4 kg."""


class InsertionTasks(Tasks):
    """Pegs to be inserted, N at a time.

    Observation: `offset`, tool position less the believed mouth (m), and rotation vector from straight down (rad),
    (6,); `target`, x_d less the tool's pose (m, rad), K1 (1/s²) and D1 (1/s), (18,); `wrench` on the peg about its tip,
    as the wrist measures it, less what it read in the air, smoothed, world axes (N, N m), (6,); `elapsed` (s), (1,). No
    camera.
    `reset(options={"height": h})` starts the tip h above the believed mouth, m.
    """

    name = "insertion"
    config_type = InsertionConfig
    reward_terms = REWARD_TERMS
    own_fields = OWN_FIELDS
    reset_options = ("height",)
    episode_metrics = EPISODE_METRICS
    figures = FIGURES
    varies = True
    place = "mouth"

    @property
    def observation_vectors(self) -> tuple[Observation, ...]:
        """Offset, target, wrench and time."""
        return OFFSET, target_observation(self.config.action), WRENCH, ELAPSED

    @property
    def centre(self) -> tuple[float, float, float]:
        """The believed mouth."""
        return self.config.mouth

    def default_arm(self) -> Arm:
        """Return a Panda that holds the peg."""
        return robots.panda(PEG)

    def reached(self) -> tuple[Pose, ...]:
        """Return the corners of where holes may be, above the block and at full depth."""
        config, error = self.config, self.config.error_m
        corners = itertools.product((-error, error), (-error, error), (config.start_m[1], -config.depth_m))
        return tuple(Pose(np.add(config.mouth, corner), DOWN) for corner in corners)

    @property
    def hole_radius(self) -> float:
        """Radius of the hole, m: that of the arm's peg, and the clearance."""
        return peg_radius(self.arm, self.config.depth_m) + self.config.clearance_m

    def furnish(self, world: WorldConfig) -> WorldConfig:
        """Return a world with table and block in it, and a peg of steel."""
        fixtures = (table(), block(self.config.mouth, self.hole_radius))
        return replace(world, fixtures=fixtures, tip=STEEL)

    def prepare(self) -> None:
        """Take the weights for compiled code."""
        config = self.config
        self._parameters = np.zeros(1, dtype=parameters_dtype)
        for name in (*REWARD_TERMS, "gentle_n"):
            self._parameters[name] = getattr(config.reward, name)
        self._parameters["depth_m"] = config.depth_m

    def begin_episode(self, i: int, rng: np.random.Generator, options: Mapping[str, Any]) -> Pose:
        """Sample where the hole truly is and how slippery it is; the tool starts above where it is believed to be."""
        config, task = self.config, self.tasks[i]
        believed = np.array(config.mouth)
        error = np.array([*rng.uniform(-config.error_m, config.error_m, 2), 0.0])
        tilt = rotvec_to_quat(np.array([*rng.uniform(-config.tilt_rad, config.tilt_rad, 2), 0.0]))
        friction, height = rng.uniform(*config.friction), rng.uniform(*config.start_m)
        if "height" in options:
            height = self._checked_height(options["height"])
        self.worlds.place_fixture(i, "block", believed + error, tilt)
        self.worlds.set_tip_friction(i, friction)
        task["believed"], task["mouth"] = believed, believed + error
        task["axis"] = -quat_to_matrix(tilt)[:, 2]
        return self._start(height)

    def _start(self, height: float) -> Pose:
        """Return the tool's pose this high above the believed mouth, m."""
        return Pose(np.add(self.config.mouth, [0.0, 0.0, height]), DOWN)

    def _checked_height(self, height: Any) -> float:
        """Return a height of the user's own, m, before anything is changed for it."""
        height = float(finite_array(height, (), "height"))
        if not 0.0 <= height <= MAX_START_M:
            raise InvalidInputError(f"height = {height}; give 0 to {MAX_START_M} m above the believed mouth")
        self.posture_over(self._start(height))
        return height

    def after_reset(self, i: int, rng: np.random.Generator) -> None:
        """Measure and observe for the first time."""
        begin(self.worlds.records, self.worlds.controllers, self.tasks, i)

    def finish_step(self, start: int, stop: int) -> None:
        """Score and observe, in the worlds from start to stop."""
        worlds = self.worlds
        finish(start, stop, worlds.records, worlds.controllers, worlds.metrics, self._parameters[0], self.tasks)

    def own_info(self) -> dict[str, np.ndarray]:
        """Return how deep the peg is, m, and whether the arm has met table or block."""
        return {"depth_m": self.tasks["depth"].copy(), "arm_touched": self.tasks["failed"] == 1}

    def picture(self, i: int) -> np.ndarray:
        """Return block, hole and peg from above, uint8 (512, 512, 3)."""
        task, depth_m = self.tasks[i], self.config.depth_m
        tip = self.worlds.records[i]["truth"]["position"]
        places = (task["believed"][:2], task["mouth"][:2], tip[:2])
        return paint(TopView(*places, self.hole_radius, peg_radius(self.arm, depth_m), task["depth"] / depth_m))
