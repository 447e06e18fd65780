"""Seven joints, six directions of the tool: the elbow is free to move. Pushed, it moves and the tool stays.

Picture: the arm from the front, before and during a push on the elbow, and how far elbow and tool move.
"""

import numpy as np
from drawing import COLOUR, INK, SOFT, draw_arm, panels, save
from simulation import ARM, simulate

import contactsafe as cs
from contactsafe.report import View
from contactsafe.robot import link_frames

VIEW = View(target=(0.12, 0.06, 0.42), span=(0.95, 1.0), azimuth=0.35, elevation=0.25)
PUSH = {"body": "link4", "point": (0.0, 0.0, 0.0), "force": (0.0, 15.0, 0.0), "start_s": 0.3, "stop_s": 1.8}
ELBOW = 4


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return how far elbow and tool move at most, m."""
    trace = simulate(cs.presets.paper(), 1.8, push=PUSH)
    elbows = link_frames(ARM.description, trace["q"])[0][:, ELBOW]
    moved = {
        "elbow": np.linalg.norm(elbows - elbows[0], axis=1),
        "tool": np.linalg.norm(trace["position"] - trace["position"][0], axis=1),
    }
    figure, (scene, axis) = panels(1, 2, width_ratios=(1, 1.4))
    times = (0, 1200, 1500, -1)
    for tick, opacity in zip(times, (0.3, 0.3, 0.4, 1.0), strict=True):
        draw_arm(scene, ARM.description, ARM.tool, trace["q"][tick], VIEW, edge=INK, opacity=opacity)
    for (name, distance), colour in zip(moved.items(), (SOFT, COLOUR["paper"]), strict=True):
        print(f"{name}: at most {1000 * distance.max():.1f} mm")
        axis.plot(trace["time"], 1000 * distance, color=colour, label=name)
    axis.set(xlabel="time (s)", ylabel="moved (mm)", title="15 N on the elbow from 0.3 s on", xlim=(0, 1.8))
    axis.set_ylim(bottom=0)
    axis.legend(loc="upper left", frameon=False)
    save(figure, __file__, folder)
    return {name: float(distance.max()) for name, distance in moved.items()}


if __name__ == "__main__":
    main()
