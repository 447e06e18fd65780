"""A bundle that acts: observation in, action out, in about a tenth of a millisecond. No torch."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.core.errors import BundleError, InvalidInputError
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.bundle import Bundle, blank_observation
from contactsafe.policy.perception import Perception


class Policy(Independent):
    """The policy of a bundle: the mean of what was trained, and the dither added to it, which depends on time.

    It is asked `rate_hz` times a second and decides as often as it did in training, every so many steps; in between
    its last action holds. `begin` starts an episode; without it the dither goes on from where it is, which does no
    harm. For a batch, row i of an observation belongs to episode i.

    Args:
        bundle: a Bundle, or the path of one.
        homography: working plane (x, y, 1) in m to homogeneous pixels of the camera that makes the masks, (3, 3); the
            task's is `env.unwrapped.camera_homography`. On a robot it comes from calibration and may differ from the
            one trained with: in the tool's frame the policy does not see the difference. None where it sees no images.

    Raises:
        BundleError: the bundle does not load, or does not run.
        InvalidInputError: the homography is not a finite, invertible (3, 3) matrix.
    """

    def __init__(self, bundle: Bundle | Path | str, homography: np.ndarray | None = None):
        self.bundle = bundle if isinstance(bundle, Bundle) else Bundle.load(bundle)
        self.rate_hz = self.bundle.rate_hz
        self._observes = self.bundle.observes
        self._dither, self._repeat = self.bundle.dither, self.bundle.action_repeat
        self._steps, self._held = np.zeros(1, int), np.zeros((1, ACTION_SIZE), np.float32)
        self._perceive = _perception(self.bundle, homography) if self.bundle.sees else None
        # The first runs allocate and compile: take them here, not in the control loop.
        for n in (1, 1, 2):
            try:
                self.act(blank_observation(self.bundle, n))
            except InvalidInputError:
                raise
            except Exception as error:
                reason = str(error).splitlines()[0][:160]
                raise BundleError(f"{self.bundle.folder} loads but does not run ({reason}); export it anew") from error
        self._steps[:] = 0

    def begin(self, i: int = 0) -> None:
        """Begin episode i."""
        if i < len(self._steps):
            self._steps[i] = 0

    def act(self, observation: Mapping[str, Any]) -> np.ndarray:
        """Choose the action.

        Args:
            observation: the task's dict: the vectors that `bundle.observes` names, (k,) or (N, k), and where the policy
                sees images mask, (128, 128, 1) or (N, 128, 128, 1) uint8, foreground 0, and pose, which begins with the
                tool's position in m.

        Returns:
            Action, (18,) or (N, 18) float32 in [-1, 1]; the same for the same observation at the same step.

        Raises:
            InvalidInputError: something the policy observes is missing, has another shape or type, or is not finite.
        """
        first = next(iter(self._observes))
        single = np.ndim(observation.get("pose", observation.get(first))) == 1
        n = 1 if single else self._count(observation, first)
        state = np.concatenate([self._vector(observation, name, single, n) for name in self._observes], axis=1)
        inputs = {"state": state}
        if self._perceive is not None:
            mask = np.asarray(observation["mask"])
            pose = self._vector(observation, "pose", single, n)
            inputs["latent"] = self._perceive(mask[None] if single else mask, pose)
        action = self.bundle.policy.run(["action"], inputs)[0]
        if action.shape != (n, ACTION_SIZE) or not np.all(np.isfinite(action)):
            raise BundleError(f"{self.bundle.folder} gave an action that is not 18 finite numbers; do not run it")
        if len(self._steps) != n:
            self._steps, self._held = np.zeros(n, int), np.zeros((n, ACTION_SIZE), np.float32)
        decides = self._steps % self._repeat == 0
        self._held = np.where(decides[:, None], self._dither.over(action, self._steps), self._held)
        self._steps += 1
        return self._held[0].copy() if single else self._held.copy()

    def _count(self, observation: Mapping[str, Any], first: str) -> int:
        """Return the number of rows of a batch: one for each mask, or for each of the first vector."""
        value = observation.get("mask" if self._perceive is not None else first)
        return 1 if value is None else len(value)

    def _vector(self, observation: Mapping[str, Any], name: str, single: bool, n: int) -> np.ndarray:
        """Return one of the vectors observed, (n, k) float32, checked."""
        if name not in observation:
            raise InvalidInputError(f"observation has no {name}; this policy observes {', '.join(self._observes)}")
        value = np.asarray(observation[name], dtype=np.float32)
        value = value[None] if single else value
        size = self._observes.get(name, value.shape[-1] if value.ndim else 0)
        if value.shape != (n, size):
            rows = "masks" if self._perceive is not None else "rows"
            raise InvalidInputError(
                f"{name} has shape {value.shape} beside {n} {rows}; give ({size},), or one a {rows[:-1]}"
            )
        if not np.all(np.isfinite(value)):
            raise InvalidInputError(f"{name} is not finite; check the robot state before asking the policy")
        return value


def _perception(bundle: Bundle, homography: np.ndarray | None) -> Perception:
    manifest = bundle.manifest
    if homography is None:
        raise InvalidInputError("homography is None, but the policy sees images; give the camera's, (3, 3)")
    view = manifest["representation"], manifest["window_m"], manifest["view_size"]
    return Perception(bundle.encoder, *view, homography)
