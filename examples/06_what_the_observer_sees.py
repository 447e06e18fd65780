"""The observer estimates external torque from momentum: joint positions, velocities and commands, no force sensor.

Picture: the true torque of a push at one joint, and the residual under the paper's gain and under the default's.
"""

import numpy as np
from drawing import COLOUR, INK, panels, save
from simulation import simulate

import contactsafe as cs

JOINT = 2
PUSH = {"body": "link5", "point": (0.0, 0.0, -0.1), "force": (0.0, 25.0, 0.0), "start_s": 0.3, "stop_s": 2.3}


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the time in which each residual comes to 63 % of the truth, s."""
    figure, axis = panels()
    rise = {}
    for name in ("paper", "safe"):
        config = getattr(cs.presets, name)()
        trace = simulate(config, 3.0, push=PUSH)
        true, residual = trace["tau_arm"][:, JOINT], trace["residual"][:, JOINT]
        pushed = trace["time"] > PUSH["start_s"]
        reached = np.abs(residual) > 0.63 * np.abs(true[1000])
        rise[name] = float(np.argmax(pushed & reached)) / 1000 - PUSH["start_s"]
        print(f"{name}: 63 % of the push after {1000 * rise[name]:.0f} ms")
        axis.plot(trace["time"], residual, color=COLOUR[name], label=f"residual, {name}")
    axis.plot(trace["time"], true, color=INK, linewidth=1.0, linestyle="--", label="true external torque (safe)")
    axis.set(xlabel="time (s)", ylabel=f"torque at joint {JOINT + 1} (N m)", xlim=(0, 3))
    axis.legend(loc="upper right", frameon=False)
    save(figure, __file__, folder)
    return rise


if __name__ == "__main__":
    main()
