"""Collisions nobody chose: random motions meet random obstacles anywhere along the arm; how hard, and how long?"""

from collections.abc import Sequence

import numpy as np

from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.experiments.collision_scenes import LEAD_M, Meeting, Motion, draw_meetings, draw_motion
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.results import Experiment, Trial
from contactsafe.experiments.run import Progress
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.robot.ik import solve_ik
from contactsafe.sim.records import trace_dtype
from contactsafe.sim.world import MAX_TICKS, Worlds, ticks_of_step

QUESTION = (
    "The tool sweeps or holds, wiping or in free air, and a random point of the arm meets something soft or stiff: "
    "how hard is the contact, and for how long?"
)
BATCH = 50
STEADY_S = 0.5
PLANTS = ("real", "clean")

_CONTACT_N = 0.5  # obstacle force that counts as contact
_AT_LIMIT_RAD = 1e-3


def run_motions(
    arm: Arm, motions: Sequence[Motion], meetings: Sequence[tuple[Meeting, ...]], config: ControllerConfig, real: bool
) -> list[np.ndarray]:
    """Run motions side by side, each with its own obstacles.

    Returns:
        One array of `trace_dtype` records for each, one a ms.
    """
    n = len(motions)
    configs = [m.world(tuple(one.obstacle for one in met), real) for m, met in zip(motions, meetings, strict=True)]
    worlds = Worlds(arm, configs, config, n, [m.seed for m in motions])
    nominal = arm.nominal()
    for i, motion in enumerate(motions):
        worlds.reset(i, motion.q_start)
        controller = worlds.controllers[i]
        controller["target"]["quat"] = motion.start.quat
        controller["target"]["K_task"] = motion.stiffness
        controller["target"]["D_task"] = 2.0 * np.sqrt(motion.stiffness)
        controller["output"]["position"] = controller["dynamics"]["position"]
    trace = np.zeros((n, MAX_TICKS), dtype=trace_dtype(arm.n))
    pieces: list[list[np.ndarray]] = [[] for _ in range(n)]
    lengths = np.array([round(1000 * m.duration_s) for m in motions])
    step, done = 0, 0
    while done < lengths.max():
        ticks = ticks_of_step(step)
        for i, motion in enumerate(motions):
            if done < lengths[i]:
                _aim(worlds.controllers[i], motion, done / 1000.0, arm, nominal.handle)
        worlds.run(np.where(done < lengths, ticks, 1), trace)
        for i in range(n):
            if done < lengths[i]:
                pieces[i].append(trace[i, : min(ticks, lengths[i] - done)].copy())
        step, done = step + 1, done + ticks
    worlds.close()
    return [np.concatenate(piece) for piece in pieces]


def _aim(controller, motion: Motion, time_s: float, arm: Arm, handle) -> None:
    """Set x_d where the motion has it, within its lead, and the posture that goes with it."""
    position = motion.target(time_s)
    if motion.limited:
        away = position - controller["output"]["position"]
        distance = float(np.linalg.norm(away))
        if distance > LEAD_M:
            position = controller["output"]["position"] + away * (LEAD_M / distance)
    target = controller["target"]
    target["position"] = position
    q = np.empty(arm.n)
    error, turn = solve_ik(handle, position, motion.start.quat, target["q_pose"], arm.q_min, arm.q_max, q)
    if error < 1e-3 and turn < 1e-2:
        target["q_pose"] = q


def collisions(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the battery; it needs no policy.

    Args:
        bundle: not used.
        config: controllers and seeds.
        progress: told of every trial done.
    """
    controllers = {name: presets.by_name(name) for name in config.controllers}
    trials: list[Trial] = []
    for first in range(config.seed, config.seed + config.trials, BATCH):
        seeds = range(first, min(first + BATCH, config.seed + config.trials))
        trials += run_battery(controllers, seeds, progress=progress)
    return Experiment("collisions", QUESTION, tuple(trials), ())


def run_battery(
    controllers: dict[str, ControllerConfig],
    seeds: Sequence[int],
    plants: Sequence[str] = PLANTS,
    progress: Progress | None = None,
) -> list[Trial]:
    """Put controllers through the same collisions.

    Args:
        controllers: configurations by name.
        seeds: of the scenes, stepped side by side.
        plants: 'real' for plant and sensors that differ from the model, 'clean' for ideal ones.
        progress: told of every trial done.
    """
    arm = robots.panda()
    motions = [draw_motion(arm, seed) for seed in seeds]
    free = run_motions(arm, motions, [()] * len(motions), presets.vices(), real=True)
    meetings = [draw_meetings(arm, motion, trace["q"]) for motion, trace in zip(motions, free, strict=True)]
    trials = []
    for plant in plants:
        for name, controller in controllers.items():
            traces = run_motions(arm, motions, meetings, controller, real=plant == "real")
            for i, motion in enumerate(motions):
                metrics = collision_metrics(traces[i], free[i], arm) | scene_metrics(motion, meetings[i])
                trials.append(Trial(scenario(motion, plant), name, motion.seed, metrics))
            if progress:
                progress(len(motions))
    return trials


def scenario(motion: Motion, plant: str) -> str:
    """Say in words what a trial was."""
    return f"{'hold' if motion.holds else 'sweep'} {'wiping' if motion.wiping else 'in free air'}, {plant} plant"


def scene_metrics(motion: Motion, meetings: tuple[Meeting, ...]) -> dict[str, float]:
    """Describe a trial's scene by numbers; of two obstacles the stiffer one."""
    stiffest = max(meetings, key=lambda meeting: meeting.obstacle.stiffness)
    return {
        "obstacles": float(len(meetings)),
        "link": float(stiffest.link),
        "obstacle_stiffness_n_m": stiffest.obstacle.stiffness if not stiffest.obstacle.fixed else 1e6,
        "obstacle_mass_kg": stiffest.obstacle.mass,
        "speed_m_s": 0.0 if motion.holds else motion.speed_m_s,
        "lead_limited": float(motion.limited),
    }


def collision_metrics(trace: np.ndarray, free: np.ndarray, arm: Arm) -> dict[str, float]:
    """Summarise one collision by the simulator's truth.

    Args:
        trace: `trace_dtype` records, (T,).
        free: the same motion with nothing in the way, (T,).
        arm: for its joint range.
    """
    force = trace["obstacle_force"]
    touching = force > _CONTACT_N
    steady = trace["time"] > trace["time"][-1] - STEADY_S
    tau = np.abs(trace["tau_arm"]).max(axis=1)
    away = np.linalg.norm(trace["position"] - free["position"], axis=1)
    at_limit = ((trace["q"] < arm.q_min + _AT_LIMIT_RAD) | (trace["q"] > arm.q_max - _AT_LIMIT_RAD)).any(axis=1)
    contact = trace["mode"] == 1
    first = int(np.argmax(touching))
    found = trace["link"][first:] > 0
    return {
        "met": float(touching.any()),
        "contact_peak_n": float(force.max()),
        "contact_steady_n": float(force[steady].mean()),
        "impulse_ns": float(force.sum() / 1000.0),
        "tau_peak_nm": float(tau.max()),
        "tau_steady_nm": float(tau[steady].mean()),
        "detect_ms": float(np.argmax(found)) if touching.any() and found.any() else float("nan"),
        "tool_error_mm": float(1000.0 * away.max()),
        "tool_error_end_mm": float(1000.0 * away[-1]),
        "tool_force_peak_n": float(np.linalg.norm(trace["tool_force"], axis=1).max()),
        "yielding_share": float((contact & (trace["holding"] == 0)).mean()),
        "holding_share": float((contact & (trace["holding"] == 1)).mean()),
        "mode_switches": float(np.count_nonzero(np.diff(trace["mode"]))),
        "limit_touches": float(np.count_nonzero(np.diff(at_limit.astype(int)) > 0)),
    }
