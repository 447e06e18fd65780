"""A bundle that acts: observation in, action out, in about a tenth of a millisecond. No torch."""

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.core.errors import BundleError, InvalidInputError
from contactsafe.policy.bundle import ACTIONS, Bundle, blank_observation
from contactsafe.policy.observation import OBSERVED
from contactsafe.policy.perception import Perception


class Policy(Independent):
    """The policy of a bundle: the mean of what was trained, and the motion laid over it, which knows the time.

    `begin` starts an episode; without it the motion goes on from where it is, which does no harm. For a batch, row i of
    an observation belongs to episode i.

    Args:
        bundle: a Bundle, or the path of one.
        homography: board plane (x, y, 1) in m to homogeneous pixels of the camera that makes the masks, (3, 3); the
            task's is `env.unwrapped.camera_homography`. On a robot it comes from calibration and may differ from the
            one trained with: in the tool's frame the policy does not see the difference.

    Raises:
        BundleError: the bundle does not load, or does not run.
        InvalidInputError: the homography is not a finite, invertible (3, 3) matrix.
    """

    def __init__(self, bundle, homography):
        self.bundle = bundle if isinstance(bundle, Bundle) else Bundle.load(bundle)
        manifest = self.bundle.manifest
        self.action_repeat = self.bundle.action_repeat
        self.rate_hz = self.bundle.rate_hz
        self._observes = manifest["observes"]
        self._dither, self._steps = self.bundle.dither, np.zeros(1, int)
        self._perceive = Perception(
            self.bundle.encoder, manifest["representation"], manifest["window_m"], manifest["view_size"], homography
        )
        # The first runs allocate and compile: take them here, not in the control loop.
        for n in (1, 1, 2):
            try:
                self.act(blank_observation(manifest, n))
            except InvalidInputError:
                raise
            except Exception as error:
                reason = str(error).splitlines()[0][:160]
                raise BundleError(f"{self.bundle.folder} loads but does not run ({reason}); export it anew") from error
        self._steps[:] = 0

    def begin(self, i=0):
        """Begin episode i."""
        if i < len(self._steps):
            self._steps[i] = 0

    def act(self, observation):
        """Choose the action.

        Args:
            observation: the task's dict. pose: (6,) or (N, 6), tool position in m then rotation vector in rad; target
                (18,) and force (3,), or N of each, where the bundle observes them (`WipingEnv` says what they are);
                mask: (128, 128, 1) or (N, 128, 128, 1) uint8, ink 0.

        Returns:
            Action, (18,) or (N, 18) float32 in [-1, 1]; the same for the same observation at the same step.

        Raises:
            InvalidInputError: something the policy observes is missing, has another shape or type, or is not finite.
        """
        mask, single = np.asarray(observation["mask"]), np.ndim(observation["pose"]) == 1
        if single:
            mask = mask[None]
        pose = self._vector(observation, "pose", single, len(mask))
        state = np.concatenate([self._vector(observation, name, single, len(mask)) for name in self._observes], axis=1)
        latent = self._perceive(mask, pose)
        action = self.bundle.policy.run(["action"], {"state": state, "latent": latent})[0]
        if action.shape != (len(pose), len(ACTIONS)) or not np.all(np.isfinite(action)):
            raise BundleError(f"{self.bundle.folder} gave an action that is not 18 finite numbers; do not run it")
        if len(self._steps) != len(action):
            self._steps = np.zeros(len(action), int)
        action = self._dither.over(action, self._steps)
        self._steps += 1
        return action[0] if single else action

    def _vector(self, observation, name, single, n):
        """Give one of the vectors observed, (n, k) float32, checked."""
        if name not in observation:
            raise InvalidInputError(f"observation has no {name}; this policy observes {', '.join(self._observes)}")
        value = np.asarray(observation[name], dtype=np.float32)
        value = value[None] if single else value
        if value.shape != (n, OBSERVED[name]):
            raise InvalidInputError(
                f"{name} has shape {value.shape} beside {n} masks; give ({OBSERVED[name]},), or one a mask"
            )
        if not np.all(np.isfinite(value)):
            raise InvalidInputError(f"{name} is not finite; check the robot state before asking the policy")
        return value
