"""Insertion on a Franka, by force alone: the wrench at the peg is what the joints' torques tell of it."""

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import rotvec_to_quat
from contactsafe.policy.action import DOWN
from contactsafe.policy.action_config import ActionConfig
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.robot.arm import Arm, Pose
from contactsafe.sim.franka_scene import FrankaScene
from contactsafe.tasks.base.robot import Simulated
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.scene import PEG, block, peg_radius, table
from contactsafe.tasks.insertion.step import BIAS_STEPS
from contactsafe.tasks.insertion.tasks import STEEL

_SMOOTHING = 0.5  # of the wrench, a policy step, as in training
_WAITS_STEPS = 30
"""Policy steps between two pegs."""

_STALLED_STEPS = 1200
"""Policy steps, twenty seconds, after which a peg that is not in is lifted and tried anew."""


class InsertionWork:
    """What the insertion task supplies for a real robot.

    Args:
        config: of the task: where the mouth is believed to be, and how deep the peg is to go.
    """

    def __init__(self, config: InsertionConfig):
        self._config = config

    @property
    def centre(self) -> tuple[float, float, float]:
        """The believed mouth."""
        return self._config.mouth

    @property
    def action(self) -> ActionConfig:
        """How actions move the target."""
        return self._config.action

    @property
    def start(self) -> Pose:
        """Above the believed mouth, in the middle of where the policy was trained to begin."""
        height = sum(self._config.start_m) / 2.0
        return Pose(np.add(self._config.mouth, [0.0, 0.0, height]), DOWN)

    @property
    def travel_m_s(self) -> float:
        """Slow enough that a peg comes out of a tilted hole without a jolt."""
        return 0.03

    @property
    def homography(self) -> None:
        """No camera looks."""
        return None

    def prepare(self, arm: Arm, lockstep: bool, speed: float = 1.0) -> None:
        """Take the arm whose torques tell the wrench."""
        del lockstep
        self._speed = speed
        self._arm, self._bias, self._wrench = arm, np.zeros(6), np.zeros(6)
        self._depth, self._waited, self._steps = 0.0, 0, -1

    def look(self, seen: np.void, pose: np.ndarray, steps: int) -> dict[str, np.ndarray]:
        """Return offset, wrench and time, as in training; the wrench less what it was in the air."""
        measured, self._steps = self._tool_wrench(seen), steps
        if steps < 0:
            self._waited += 1
        elif steps == 0:
            self._bias[:], self._wrench[:], self._waited = 0.0, 0.0, 0
        elif steps <= BIAS_STEPS:
            self._bias += measured / BIAS_STEPS
        else:
            self._wrench += _SMOOTHING * (measured - self._bias - self._wrench)
        self._depth = self._config.mouth[2] - float(seen["position"][2])
        offset = np.concatenate([pose[:3] - np.array(self._config.mouth), pose[3:]])
        elapsed = np.array([max(steps, 0) / POLICY_RATE_HZ])
        return {"offset": offset, "wrench": self._wrench.copy(), "elapsed": elapsed}

    def _tool_wrench(self, seen: np.void) -> np.ndarray:
        """Return the wrench at the tool that the joints' external torque tells, world axes, (6,)."""
        dynamics = self._arm.dynamics(seen["q"], np.zeros(self._arm.n))
        J, J_M_inv = dynamics["J"], dynamics["J"] @ dynamics["M_inv"]
        return np.linalg.solve(J_M_inv @ J.T, J_M_inv @ seen["residual"])

    def is_blind(self) -> bool:
        """Tell that nothing has to be seen."""
        return False

    def is_ready(self) -> bool:
        """Tell whether the arm has waited long enough between two pegs."""
        return self._waited >= _WAITS_STEPS

    def is_done(self) -> bool:
        """Tell whether the peg is in."""
        return self._depth >= self._config.depth_m

    def is_stalled(self) -> bool:
        """Tell whether the peg has been searching for long."""
        return self._steps > _STALLED_STEPS / self._speed

    def seen_with(self) -> tuple[float, int]:
        """Return that nothing was seen."""
        return math.nan, 0

    def close(self) -> None:
        """Nothing is to be let go of."""


class MovedBlock:
    """The effect of a simulated run: once a peg is in and out again, the block stands elsewhere.

    Args:
        config: of the task.
        seed: of where it stands.
        rounds: pegs of the run.
    """

    def __init__(self, config: InsertionConfig, seed: int, rounds: int):
        self._config, self._seed, self._rounds = config, seed, rounds

    def begin(self, model: mujoco.MjModel) -> None:
        """Put the block where it is, in the simulator's process."""
        self._model, self._rng = model, np.random.default_rng(self._seed)
        self._inserted, self._in = 0, False
        self._move()

    def _move(self) -> None:
        config, body = self._config, self._model.body("block").id
        error = self._rng.uniform(-config.error_m, config.error_m, 2)
        tilt = self._rng.uniform(-config.tilt_rad, config.tilt_rad, 2)
        self._model.body_pos[body] = np.add(config.mouth, [*error, 0.0])
        self._model.body_quat[body] = rotvec_to_quat(np.array([*tilt, 0.0]))

    def after_step(self, tick: int, q: np.ndarray, position: np.ndarray, rotation: np.ndarray, force_n: float) -> None:
        """Move the block after each peg that was in."""
        depth = self._config.mouth[2] - position[2]
        if depth >= self._config.depth_m:
            self._in = True
        elif self._in and depth < -0.005:
            self._in, self._inserted = False, self._inserted + 1
            if self._inserted < self._rounds:
                self._move()


class InsertionRobot:
    """The insertion task for a real robot."""

    tool = PEG

    def work(self, **looks: Any) -> InsertionWork:
        """Return the work; no camera looks."""
        if looks.get("camera_calibration") is not None:
            raise InvalidInputError("insertion looks with no camera; leave out the camera's calibration")
        return InsertionWork(InsertionConfig())

    def simulated(self, arm: Arm, shared: Path, seed: int, rounds: int, met: bool, **looks: Any) -> Simulated:
        """Return a run over blocks that stand beside where they are believed to be."""
        del shared, met
        config = InsertionConfig()
        radius = peg_radius(arm, config.depth_m) + config.clearance_m
        scene = FrankaScene(self.tool, STEEL, (table(), block(config.mouth, radius)))

        def figures(truth: np.ndarray) -> dict[str, float]:
            deep = truth["position"][:, 2] <= config.mouth[2] - config.depth_m
            return {"done, pegs that went in": float(np.count_nonzero(np.diff(deep.astype(int)) > 0)) / rounds}

        return Simulated(scene, MovedBlock(config, seed, rounds), self.work(**looks), figures)
