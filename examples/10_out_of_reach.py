"""A target out of reach stretches the arm until it cannot move outwards: there the task inertia is damped.

Picture: target and tool on the path out and back, and the fastest joint, as a part of its speed limit.
"""

import numpy as np
from drawing import COLOUR, INK, panels, save
from simulation import ARM, simulate, smooth

import contactsafe as cs

OUT_M, OUT_S, WAIT_S = 0.55, 2.0, 1.0


def path(seconds: float) -> np.ndarray:
    """Carry the target straight out, wait, and bring it back."""
    back = smooth((seconds - OUT_S - WAIT_S) / OUT_S)
    return np.array([OUT_M * (smooth(seconds / OUT_S) - back), 0.0, 0.0])


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the largest part of its speed limit that a joint reaches, for each controller."""
    figure, (reach, speed) = panels(2, 1, (8.0, 4.4), sharex=True)
    fastest = {}
    for name in ("vices", "safe"):
        trace = simulate(getattr(cs.presets, name)(), 6.0, path=path)
        part = np.abs(np.gradient(trace["q"], 0.001, axis=0) / ARM.qd_max).max(axis=1)
        fastest[name] = float(part.max())
        print(f"{name}: a joint reaches {100 * fastest[name]:.0f} % of its speed limit")
        reach.plot(trace["time"], trace["position"][:, 0], color=COLOUR[name], label=name)
        speed.plot(trace["time"], 100 * part, color=COLOUR[name])
    target = trace["position"][0, 0] + np.array([path(time)[0] for time in trace["time"]])
    reach.plot(trace["time"], target, color=INK, linewidth=1.0, linestyle="--", label="target")
    reach.set(ylabel="distance from the base (m)")
    reach.legend(loc="upper right", frameon=False)
    speed.set(xlabel="time (s)", ylabel="fastest joint (% of its limit)", xlim=(0, 6), ylim=(0, None))
    save(figure, __file__, folder)
    return fastest


if __name__ == "__main__":
    main()
