"""A target inside the table: the force of an impedance grows with its depth, unless it is bounded.

Picture: force of the tool on the table against the depth of the target below it.
"""

import numpy as np
from drawing import COLOUR, panels, save
from simulation import ARM, simulate, smooth

import contactsafe as cs
from contactsafe.sim import workbench

DEEPEST_M, DOWN_S, DEEPER_S = 0.12, 1.0, 4.0
TABLE_M = workbench().position[2]


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the largest force for each controller, N."""
    above = float(ARM.tool_pose(ARM.home).position[2]) - TABLE_M

    def depth(seconds: float) -> float:
        """Return how far below the table's surface the target lies, m."""
        landed = above * (smooth(seconds / DOWN_S) - 1.0)
        return landed + DEEPEST_M * smooth((seconds - DOWN_S) / DEEPER_S)

    figure, axis = panels()
    largest = {}
    for name, preset in cs.presets.PRESETS.items():
        trace = simulate(preset(), DOWN_S + DEEPER_S, path=lambda t: np.array([0.0, 0.0, -above - depth(t)]))
        force = np.linalg.norm(trace["tool_force"], axis=1)
        depths = np.array([depth(time) for time in trace["time"]])
        largest[name] = float(force.max())
        print(f"{name}: at most {largest[name]:.0f} N")
        line = {"linestyle": "--"} if name == "paper" else {}  # on top of vices: the paper bounds nothing here
        axis.plot(1000 * depths, force, color=COLOUR[name], label=name, **line)
    axis.set(xlabel="target below the surface of the table (mm)", ylabel="force of the tool (N)", xlim=(-10, 120))
    axis.set_ylim(bottom=0)
    axis.legend(loc="upper left", frameon=False)
    save(figure, __file__, folder)
    return largest


if __name__ == "__main__":
    main()
