"""Peak and steady forces of collisions: the printed law, bounds on it, and what no law changes."""

import math
from dataclasses import replace

import numpy as np
from benchmarks.findings.models import FAST, FAST_BOUNDED, PAPER, SAFE, VICES
from benchmarks.findings.printing import say, spreads
from benchmarks.findings.scenes import Scenes, hold, lasting_pushes, strays_mm

import contactsafe as cs
from contactsafe.control.codes import FREE
from contactsafe.control.laws import torque_against_contact
from contactsafe.experiments.collisions import run_battery
from contactsafe.sim.config import PlantConfig, WorldConfig
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import Worlds


def printed_law_can_hurt() -> None:
    """The compensation cancels the reaction that would have stopped the arm: peaks above those of no law at all."""
    laws = {"vices": VICES, "paper": PAPER, "paper, K_I 15": PAPER.with_(compensation_gain=15.0, detection_gain=15.0)}
    _battery(laws, 48)


def bounded_push() -> None:
    """Bounding what the command pushes along the contact prevents that."""
    bounded = PAPER.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0, null_damping=3.0)
    _battery({"vices": VICES, "paper, 3 N m": bounded, "fast, 3 N m": FAST_BOUNDED, "safe": SAFE}, 48)


def yield_or_hold() -> None:
    """One bound for all contacts either presses obstacles or lets a person's push carry the arm away."""
    free = FAST.with_(contact_torque_limit_comply_nm=math.inf, contact_torque_limit_reject_nm=math.inf)
    laws = {"no bound": free, "3 N m always": FAST_BOUNDED, "safe": SAFE}
    battery = run_battery(laws, range(16), ["clean"])
    for name, config in laws.items():
        strays = strays_mm(hold(config, 1.7, lasting_pushes()))
        steady = [trial.metrics["contact_steady_n"] for trial in battery.trials if trial.controller == name]
        say(f"{name:13s} 12 pushes of 25 N for 1.5 s: tool {spreads(strays, 'mm'):18s} 16 collisions: "
            f"steady {spreads(steady, 'N')}")  # fmt: skip


def _battery(laws: dict[str, cs.ControllerConfig], trials: int) -> None:
    result = run_battery(laws, range(trials), ["clean"])
    regressions = next(row for row in result.tables[0].rows if str(row[0]).startswith("peak regressions"))
    for name, count in zip(laws, regressions[2:], strict=True):
        peak, steady = (
            [trial.metrics[figure] for trial in result.trials if trial.controller == name]
            for figure in ("contact_peak_n", "contact_steady_n")
        )
        line = f"peak {spreads(peak, 'N'):22s} steady {spreads(steady, 'N'):20s}"
        say(f"{name:14s} {line} peak regressions: {count:.0f} of {trials}")


def force_added_drags_the_arm() -> None:
    """Adding a torque along the contact keeps the bound too, but the rest of the task drags the blocked arm on."""
    scenes = Scenes(24, sweeps_only=True)
    delayed = PlantConfig(torque_delay_ticks=1)
    worlds = [WorldConfig(plant=delayed, obstacles=obstacles) for obstacles in scenes.obstacles]
    runs = {
        "no bound": scenes.run(FAST, worlds),
        "3 N m by adding": scenes.run(FAST, worlds, _ForceAdded),
        "3 N m by yielding": scenes.run(FAST_BOUNDED, worlds),
        "safe": scenes.run(SAFE, worlds),
    }
    for name, traces in runs.items():
        peaks = [trace["obstacle_force"].max() for trace in traces]
        steady = [trace["obstacle_force"][-500:].mean() for trace in traces]
        say(f"{name:18s} 24 sweeps: peak {spreads(peaks, 'N'):20s} steady {spreads(steady, 'N')}")


class _ForceAdded(Worlds):
    """Worlds in which a torque added along the contact bounds the push, the rest of the task left as it is.

    Their plants have one tick of delay, during which the command is changed; the limits of torque and torque rate come
    last, as in the package.
    """

    bound_nm = 3.0

    def run(self, ticks, trace: np.ndarray | None = None) -> None:
        """Run tick by tick, and bound each command."""
        one = np.zeros((self.n, 1), dtype=trace_dtype(self.arm.n))
        self.controllers["params"]["one_tick"]["torque_step"] = np.inf
        for k in range(int(np.max(ticks))):
            before = self.controllers["state"]["command"]["tau"].copy()
            super().run(1, one)
            if trace is not None:
                trace[:, k] = one[:, 0]
            for i in range(self.n):
                self._bound(i, before[i])

    def _bound(self, i: int, before: np.ndarray) -> None:
        now, state = self.controllers[i]["dynamics"], self.controllers[i]["state"]
        command, direction = state["command"], state["isolation"]["direction"]
        tau, step = command["tau"].copy(), self.arm.torque_rate_max / 1000.0
        if self.controllers[i]["output"]["mode"] != FREE:
            net = tau - now["c"] - now["g"] - command["friction"]
            over = torque_against_contact(direction.copy(), now["M_inv"].copy(), net) - self.bound_nm
            tau += max(over, 0.0) * direction
        tau = np.clip(np.clip(tau, before - step, before + step), -self.arm.tau_max, self.arm.tau_max)
        command["tau"] = self.records[i]["errors"]["tau_delayed"] = tau


def impact_on_a_fixed_obstacle() -> None:
    """The peak of an impact on an obstacle that cannot move comes before any law can know of it."""
    scenes = Scenes(16, sweeps_only=True)
    worlds = [
        WorldConfig(obstacles=tuple(replace(obstacle, stiffness=math.inf) for obstacle in met))
        for met in scenes.obstacles
    ]
    before: list[float] = []
    for name, config in {"vices": VICES, "paper": PAPER, "safe": SAFE}.items():
        impacts = [_impact(trace) for trace in scenes.run(config, worlds)]
        peak, peak_ms, found_ms, later = (np.array(column) for column in zip(*impacts, strict=True))
        before = before or peak.tolist()
        same = np.abs(peak / before - 1.0) < 0.1
        say(f"{name:6s} first 20 ms: peak {np.median(peak):.0f} N after {np.median(peak_ms):.0f} ms "
            f"(within 10 % of vices' in {same.sum()} of {same.size}); found after {np.median(found_ms):.0f} ms; "
            f"later up to {np.median(later):.0f} N")  # fmt: skip


def _impact(trace: np.ndarray) -> tuple[float, int, float, float]:
    """Return the peak of the first 20 ms, N, when it was and when the contact was found, ms, and what came later, N."""
    first = int(np.argmax(trace["obstacle_force"] > 0.5))
    force, found = trace["obstacle_force"][first:], trace["link"][first:] > 0
    peak_ms = int(np.argmax(force[:20]))
    return force[peak_ms], peak_ms, np.argmax(found) if found.any() else math.inf, force[20:].max()
