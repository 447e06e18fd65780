"""Sixteen tasks in native threads, for whichever learner you use: here under the shipped policy.

Picture: what the sixteen cameras see after two seconds, and how much ink is left in each.
"""

import time

import gymnasium
import numpy as np
from drawing import COLOUR, panels, save

import contactsafe  # noqa: F401  (makes the environment known)
from contactsafe.policy import Policy, shipped_bundle


def main(folder: str = ".", steps: int = 120) -> np.ndarray:
    """Step, draw, and return the fraction of ink left in each environment, (16,)."""
    envs = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=16, autoreset_mode="disabled")
    policy = Policy(shipped_bundle("wiping"), envs.unwrapped.camera_homography)
    observation, _ = envs.reset(seed=0)
    start = time.perf_counter()
    for _ in range(steps):
        observation, _, terminated, truncated, info = envs.step(policy.act(observation))
        if (terminated | truncated).any():
            break
    rate = 16 * steps / (time.perf_counter() - start)
    print(f"{rate:.0f} steps/s, policy included; pose {observation['pose'].shape}, mask {observation['mask'].shape}")

    figure, axes = panels(2, 8, (10.0, 2.9))
    for axis, mask, left in zip(axes.flat, observation["mask"], info["ink_left"], strict=True):
        axis.imshow(mask[..., 0], cmap="gray", vmin=-80, vmax=255, interpolation="nearest")
        axis.set_title(f"{100 * left:.0f} %", color=COLOUR["safe"])
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(True)
    save(figure, __file__, folder)
    envs.close()
    return info["ink_left"]


if __name__ == "__main__":
    main()
