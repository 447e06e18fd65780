"""The wiping task with the shipped policy: a standard Gymnasium loop, no torch.

Picture: the board before, half-way and after, with the path of the tool, and the ink that is left.
"""

import gymnasium
import numpy as np
from drawing import COLOUR, INK, panels, save

import contactsafe  # noqa: F401  (makes the environment known)
from contactsafe.policy import Policy, shipped_bundle


def main(folder: str = ".", seconds: float = 20.0) -> float:
    """Wipe one board, draw it, and return the fraction of the ink that is left."""
    env = gymnasium.make("contactsafe/Wiping-v0")
    policy = Policy(shipped_bundle("wiping"), env.unwrapped.camera_homography)
    observation, info = env.reset(seed=7)
    ink, path, left = [board(env)], [observation["pose"][:2]], [1.0]
    terminated = truncated = False
    while not (terminated or truncated) and len(left) < 60 * seconds:
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        ink.append(board(env))
        path.append(observation["pose"][:2])
        left.append(info["ink_left"])
    print(f"after {len(left) / 60:.1f} s: {100 * left[-1]:.1f} % of the ink left")

    figure, axes = panels(1, 4, (10.0, 2.9), width_ratios=(1, 1, 1, 1.5))
    centre, half = env.unwrapped.tasks.centre, env.unwrapped.tasks.config.board.ink_size / 2
    edges = (
        centre[1] - half,
        centre[1] + half,
        centre[0] - half,
        centre[0] + half,
    )  # columns lie along y, rows along x
    steps = (0, len(left) // 2, len(left) - 1)
    for axis, step in zip(axes, steps, strict=False):
        axis.imshow(ink[step], cmap="Greys", extent=edges, origin="lower", vmin=0, vmax=1.3, interpolation="nearest")
        x, y = np.array(path[: step + 1]).T
        axis.plot(y, x, color=COLOUR["safe"], linewidth=1.0)
        axis.plot(y[-1], x[-1], "o", color=COLOUR["safe"])
        axis.set(title=f"{step / 60:.1f} s: {100 * left[step]:.0f} % left", xticks=[], yticks=[])
        axis.spines[:].set_visible(True)
    axes[3].plot(np.arange(len(left)) / 60, 100 * np.array(left), color=INK)
    axes[3].set(xlabel="time (s)", title="ink left (%)", xlim=(0, len(left) / 60), ylim=(0, 102))
    save(figure, __file__, folder)
    env.close()
    return float(left[-1])


def board(env: gymnasium.Env) -> np.ndarray:
    """Return where ink lies on the board, (rows along x, columns along y)."""
    return env.unwrapped.tasks.boards.cells[0].copy() == 1


if __name__ == "__main__":
    main()
