"""A contact is detected when the residual exceeds its threshold: how long does that take?

Picture: time from the start of a push on the forearm to contact mode, against the force of the push.
"""

import numpy as np
from drawing import COLOUR, panels, save
from simulation import simulate

import contactsafe as cs

FORCES_N = (5, 7, 10, 15, 20, 30, 40, 60)
START_S = 0.2


def delay(config: cs.ControllerConfig, force: float) -> float:
    """Return the time from the start of a push to contact mode, s; NaN where it never comes."""
    push = {"body": "link5", "point": (0.0, 0.0, -0.1), "force": (0.0, force, 0.0), "start_s": START_S, "stop_s": 2.0}
    trace = simulate(config, 2.0, push=push | {"ramp_s": 0.001})
    in_contact = (trace["mode"] > 0) & (trace["time"] > START_S)
    return float(trace["time"][np.argmax(in_contact)]) - START_S if in_contact.any() else np.nan


def main(folder: str = ".") -> dict[str, list[float]]:
    """Draw, and return the delays for each force and controller, s; NaN where a push goes unnoticed."""
    figure, axis = panels()
    delays = {}
    for name in ("paper", "safe"):
        delays[name] = [delay(getattr(cs.presets, name)(), force) for force in FORCES_N]
        noticed = ", ".join(f"{1000 * value:.0f}" for value in delays[name])
        print(f"{name}: {noticed} ms for {', '.join(map(str, FORCES_N))} N")
        axis.plot(FORCES_N, 1000 * np.array(delays[name]), "o-", color=COLOUR[name], label=name)
    axis.set(xlabel="force of the push (N)", ylabel="detected after (ms)", yscale="log", xscale="log")
    axis.set_xticks(FORCES_N, map(str, FORCES_N), minor=False)
    axis.set_xticks([], minor=True)
    axis.set_yticks([2, 5, 10, 20, 50, 100, 200, 500, 1000], ["2", "5", "10", "20", "50", "100", "200", "500", "1000"])
    axis.legend(loc="upper right", frameon=False)
    save(figure, __file__, folder)
    return delays


if __name__ == "__main__":
    main()
