"""A peg and a hole known to 5 mm: a scripted spiral presses lightly and widens until the tip falls in.

Picture: the path of the tip (x: where the hole is believed to be, orange: where it is), its depth, the force.
"""

import gymnasium
import numpy as np
from drawing import COLOUR, INK, OBSTACLE, panels, save
from matplotlib.patches import Circle

import contactsafe  # noqa: F401  (makes the environment known)
from contactsafe.tasks import task_by_name


def main(folder: str = ".", seed: int = 2) -> dict[str, float]:
    """Insert one peg, draw it, and return the depth at the end, m, and the largest force of a step's mean, N."""
    envs = gymnasium.make_vec("contactsafe/Insertion-v0", num_envs=1, autoreset_mode="disabled")
    tasks = envs.unwrapped.tasks
    spiral = task_by_name("insertion").scripted_policy("spiral", tasks.config, envs, seed)
    observation, _ = envs.reset(seed=seed)
    spiral.begin(0)
    path, depth, force = [], [], []
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = envs.step(spiral.act(observation))
        path.append(observation["offset"][0, :2])
        depth.append(info["depth_m"][0])
        force.append(tasks.worlds.metrics["tool_force_mean"][0])
        ended = bool(terminated[0] or truncated[0])
    print(f"{1000 * depth[-1]:.1f} mm deep after {len(depth) / 60:.1f} s, at most {max(force):.1f} N")

    figure, axes = panels(1, 3, (10.0, 3.2), width_ratios=(1, 1.2, 1.2))
    x, y = 1000 * np.array(path).T
    hole = 1000 * (tasks.tasks["mouth"][0] - tasks.tasks["believed"][0])
    axes[0].add_patch(Circle(hole[:2], 1000 * tasks.config.clearance_m, facecolor=OBSTACLE))
    axes[0].plot(x, y, color=COLOUR["safe"], linewidth=1.0)
    axes[0].plot(0, 0, "x", color=INK, markersize=7)
    axes[0].set(xlabel="x from the believed mouth (mm)", ylabel="y (mm)", aspect="equal", xlim=(-6, 6), ylim=(-6, 6))
    times = np.arange(1, len(depth) + 1) / 60
    axes[1].plot(times, 1000 * np.array(depth), color=INK)
    axes[1].set(xlabel="time (s)", title="depth in the hole (mm)", xlim=(0, None))
    axes[2].plot(times, force, color=COLOUR["safe"])
    axes[2].set(xlabel="time (s)", title="force on the peg (N)", xlim=(0, None), ylim=(0, None))
    save(figure, __file__, folder)
    envs.close()
    return {"depth": float(depth[-1]), "force": float(max(force))}


if __name__ == "__main__":
    main()
