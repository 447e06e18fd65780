"""Sixteen tasks in native threads, for whichever learner you use."""

import time

import gymnasium

import contactsafe  # noqa: F401  (makes the environment known)


def main(steps: int = 120) -> float:
    """Step with random actions, and return environment steps a second."""
    envs = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=16)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    envs.step(envs.action_space.sample())  # compiles on the first run
    start = time.perf_counter()
    for _ in range(steps):
        observation, *_ = envs.step(envs.action_space.sample())
    rate = 16 * steps / (time.perf_counter() - start)
    print(f"{rate:.0f} steps/s; pose {observation['pose'].shape}, mask {observation['mask'].shape}")
    envs.close()
    return rate


if __name__ == "__main__":
    main()
