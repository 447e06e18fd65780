"""The wiping task with the shipped policy: a standard Gymnasium loop, no torch."""

import gymnasium

import contactsafe  # noqa: F401  (makes the environment known)
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.policy.policy import Policy


def main(seconds: float = 20.0) -> float:
    """Wipe one board, and return the fraction of the ink that is left."""
    env = gymnasium.make("contactsafe/Wiping-v0")
    policy = Policy(shipped_bundle("wiping"), env.unwrapped.camera_homography)
    observation, info = env.reset(seed=7)
    steps = 0
    terminated = truncated = False
    while not (terminated or truncated) and steps < 60 * seconds:
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        steps += 1
    print(f"after {steps / 60:.1f} s: {100 * info['ink_left']:.1f} % of the ink left")
    return info["ink_left"]


if __name__ == "__main__":
    main()
