"""How hard the shipped policy lands, and whether two engines press alike: what docs/concepts/measured.md says of it.

    python benchmarks/forces.py [boards] [seed]

Needs `contactsafe[pybullet]`. Forces are those of the engines on the pad, N.
"""

import sys

import numpy as np

from contactsafe.policy.bundle import shipped_bundle
from contactsafe.policy.policy import Policy
from contactsafe.results.metrics import CONTACT_N
from contactsafe.tasks import make_vec
from contactsafe.tasks.wiping.config import WipingConfig

STEPS = 600  # ten seconds
AIR_STEPS, LANDING_STEPS = 5, 3
DOWN, FORTH = 2, 0  # which action moves the target towards the board, and along it
WHOLE_STEP = 16  # ticks


def wipe(engine, boards, seed):
    """Let the policy wipe, and return each board's steps until it is clean: peak and mean force, ticks in contact."""
    env = make_vec("wiping", boards, WipingConfig(), engine)
    policy = Policy(shipped_bundle("wiping"), env.unwrapped.camera_homography)
    observation, _ = env.reset(seed=seed)
    tasks, alive = env.unwrapped.tasks, np.ones(boards, bool)
    found = [[] for _ in range(boards)]
    for _ in range(STEPS):
        observation, _, terminated, truncated, _ = env.step(policy.act(observation))
        alive &= ~(terminated | truncated)
        for i in np.flatnonzero(alive):
            task, metrics = tasks.tasks[i], tasks.worlds.metrics[i]
            found[i].append((task["force_peak"], task["force_mean"], metrics["contact_ticks"]))
    env.close()
    return [np.array(rows).reshape(-1, 3) for rows in found]


def landings(peaks):
    """Return the largest force of the first steps of every contact that follows some steps in the air."""
    found, air = [], AIR_STEPS
    for k, peak in enumerate(peaks):
        if peak > CONTACT_N and air >= AIR_STEPS:
            found.append(peaks[k : k + LANDING_STEPS].max())
        air = 0 if peak > CONTACT_N else air + 1
    return found


def press(engine, speed):
    """Press as deep as the target goes, to and fro along the board, and return the mean force over two seconds."""
    env = make_vec("wiping", 1, WipingConfig(controller="vices"), engine)
    env.reset(seed=3)
    forces = []
    for k in range(240):
        action = np.zeros((1, 18))
        action[:, DOWN] = -0.5 if k < 80 else 0.0
        if k >= 120:
            action[:, FORTH] = speed * np.sign(np.sin(2.0 * np.pi * (k - 120) / 60))
        forces.append(env.step(action)[4]["tool_force_mean_n"][0])
    env.close()
    return np.mean(forces[120:])


def main() -> None:
    """Measure and print."""
    boards = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 42
    wiped = wipe("mujoco", boards, seed)
    landed = [peak for rows in wiped for peak in landings(rows[:, 0])]
    middle, high, most = np.percentile(landed, [50, 95, 100])
    print(
        f"{len(landed)} landings on {boards} boards: median {middle:.1f}, 95th percentile {high:.1f}, most {most:.1f} N"
    )
    for engine in ("mujoco", "pybullet"):
        steps = np.concatenate(wiped[:8] if engine == "mujoco" else [wipe(engine, 1, seed + i)[0] for i in range(8)])
        touching = steps[steps[:, 0] > CONTACT_N]
        print(
            f"{engine:9s} policy, steps with contact, medians: mean force {np.median(touching[:, 1]):.1f} N, "
            f"largest {np.median(touching[:, 0]):.1f} N; "
            f"{np.mean(touching[:, 2] >= WHOLE_STEP):.0%} in contact throughout"
        )
        held = ", ".join(f"{press(engine, speed):.1f}" for speed in (0.0, 0.3, 0.8))
        print(f"{engine:9s} pressed and moved along at 0, 0.3 and 0.8 of the largest action: {held} N in the mean")


if __name__ == "__main__":
    main()
