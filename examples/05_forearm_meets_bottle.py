"""The forearm runs into a bottle that somebody holds: nothing saw it coming, and there is no sensor at that place.

Picture: the arm at the first touch (pale) and at the end, from above, and the force on the bottle.
"""

import numpy as np
from drawing import COLOUR, INK, OBSTACLE, draw_arm, panels, save
from matplotlib.patches import Circle
from simulation import ARM, simulate, smooth

import contactsafe as cs
from contactsafe.report import View
from contactsafe.robot import arm_capsules
from contactsafe.sim import WorldConfig, bottle

VIEW = View(target=(0.13, -0.06, 0.45), span=(0.62, 0.72), azimuth=0.0, elevation=np.pi / 2)  # from above
TRAVEL_M, TRAVEL_S = 0.25, 1.5
FOREARM = 5  # link


def sweep(seconds: float) -> np.ndarray:
    """Carry the tool to the right, which takes the forearm along."""
    return np.array([0.0, -TRAVEL_M * smooth(seconds / TRAVEL_S), 0.0])


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the force on the bottle over the last two seconds for each controller, N."""
    starts, ends, radii, links = arm_capsules(ARM.description, ARM.tool, ARM.home[None])
    thickest = max(np.flatnonzero(links == FOREARM), key=lambda k: radii[k])
    x, y, z = ((starts[0, thickest] + ends[0, thickest]) / 2).tolist()
    thing = bottle((x, y - float(radii[thickest]) - 0.035 - 0.04, z))
    figure, axes = panels(1, 4, (10.0, 2.6), width_ratios=(1, 1, 1, 1.8))
    steady = {}
    for axis, (name, preset) in zip(axes, cs.presets.PRESETS.items(), strict=False):
        trace = simulate(preset(), 6.0, WorldConfig(obstacles=(thing,)), sweep)
        force = trace["obstacle_force"]
        steady[name] = float(force[-2000:].mean())
        print(f"{name}: {force.max():.0f} N at the impact, {steady[name]:.1f} N in the end")
        touch = int(np.argmax(force > 1.0))
        draw_arm(axis, ARM.description, ARM.tool, trace["q"][touch], VIEW, opacity=0.25)
        draw_arm(axis, ARM.description, ARM.tool, trace["q"][-1], VIEW, edge=COLOUR[name])
        for tick, faint in ((touch, 0.4), (-1, 1.0)):
            place = (trace["obstacle_position"][tick, 0] - VIEW.target) @ VIEW.axes().T
            axis.add_patch(Circle(place[:2], thing.radius, facecolor=OBSTACLE, edgecolor=INK, alpha=faint))
        axis.set_title(f"{name}: {steady[name]:.3g} N", color=COLOUR[name], fontweight="bold")
        axes[3].plot(trace["time"], force, color=COLOUR[name], label=name)
    axes[3].set(xlabel="time (s)", title="force on the bottle (N)", xlim=(0, 6), ylim=(0, 70))
    axes[3].legend(loc="upper right", frameon=False, ncols=3)
    save(figure, __file__, folder)
    return steady


if __name__ == "__main__":
    main()
