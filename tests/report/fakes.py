"""Experiments made up of smooth curves: a plausible arm, plausible forces, no simulation."""

import numpy as np

from contactsafe.experiments import disturbance as pushes
from contactsafe.experiments import joint_safety as joint
from contactsafe.experiments import task_safety as task
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.recording import Recording
from contactsafe.sim.truth import trace_dtype
from contactsafe.tasks.wiping.scenes import Wiping

CONTROLLERS = ("vices", "paper", "safe")
STEADY_N = {"vices": 60.0, "paper": 33.0, "safe": 9.0}
ERROR_MM = {"vices": 32.0, "paper": 18.0, "safe": 4.0}
PICTURE_EVERY = 200
REACHED = np.array(  # postures with the tool over the board, from its middle to its right, rad
    [
        [0.043, 0.436, -0.036, -2.372, 0.046, 2.807, 0.752],
        [-0.144, 0.453, -0.045, -2.338, 0.058, 2.79, 0.546],
        [-0.3, 0.497, -0.055, -2.25, 0.068, 2.746, 0.374],
    ]
)


def moving(times, knots, stop=1.0):
    """Interpolate joint positions, (T, 7), through the reached postures, smoothly, up to a fraction of their path."""
    fraction = stop * np.clip((times - 1.0) / knots, 0.0, 1.0)
    fraction = fraction * fraction * (3 - 2 * fraction) * (len(REACHED) - 1)
    return np.stack([np.interp(fraction, range(len(REACHED)), REACHED[:, i]) for i in range(7)], axis=1)


def touch(times, start, peak, steady):
    """A force that jumps at `start`, overshoots and settles, (T,), N."""
    t = np.clip(times - start, 0.0, None)
    return (times >= start) * (
        steady * (1 - np.exp(-t / 0.05)) + (peak - steady) * np.exp(-t / 0.08) * np.sin(t / 0.04)
    )


def trace(rng, duration_s, controller, obstacle=None):
    times = np.arange(round(1000 * duration_s)) / 1000.0
    rows = np.zeros(len(times), dtype=trace_dtype(7))
    rows["time"] = times
    rows["q"] = moving(times, 3.0)
    force = np.clip(5 + rng.normal(0, 0.4, len(times)) + 2 * np.sin(3 * times + rng.uniform(0, 1)), 0, None) * (
        times > 0.8
    )
    rows["tool_force"][:, 2] = force
    rows["tool_force"][:, 0] = 0.3 * force * np.cos(2 * times)
    rows["tool_force"][:, 1] = 0.3 * force * np.sin(2 * times)
    if obstacle is not None:
        position, stiffness = obstacle
        steady = STEADY_N[controller]
        rows["obstacle_force"] = np.clip(touch(times, 2.6, 1.6 * steady, steady), 0, None)
        rows["obstacle_position"][:, 0] = position
        rows["obstacle_position"][:, 0, 1] -= rows["obstacle_force"] / stiffness
        rows["tau_arm"][:, 0] = 0.16 * rows["obstacle_force"]
        rows["residual"][:, 0] = 0.16 * touch(times, 2.7, steady, steady)
        rows["mode"] = (times > 2.65) & (controller != "vices")
        rows["link"] = 5 * (times > 2.65)
    return rows


def boards(rng, duration_s, dark_object):
    frames = []
    x, y = np.meshgrid(np.arange(250), np.arange(300), indexing="ij")
    wave = np.abs(x - 125 - 40 * np.sin(y / 20 + rng.uniform(0, 6))) < 4
    ink = (wave & (np.abs(y - 150) < 70)) | ((x - 90) ** 2 + (y - 190) ** 2 < 80)
    for i in range(1 + round(1000 * duration_s) // PICTURE_EVERY):
        board = (ink & (y < 225 - 4 * i)).astype(np.uint8)
        if dark_object:
            board[100:150, 15:45] = 2
        frames.append(board)
    return np.array(frames)


def record(scenario, controller, duration_s, obstacle=None, shape=None):
    rng = np.random.default_rng([len(scenario), CONTROLLERS.index(controller)])
    rows = trace(rng, duration_s, controller, obstacle)
    left = np.repeat(np.clip(1.1 - rows["time"][::17] / duration_s, 0.0, 1.0), 17)[: len(rows)]
    pictures = boards(rng, duration_s, shape is not None)
    return Recording(scenario, controller, 0, rows, shape, pictures, PICTURE_EVERY, {"ink_left": left})


def trials(rng, scenario, figures, seeds=10):
    return [
        Trial(scenario, name, seed, {key: value * rng.uniform(0.8, 1.25) for key, value in figures(name).items()})
        for name in CONTROLLERS
        for seed in range(seeds)
    ]


def joint_safety():
    rng = np.random.default_rng(1)
    found, recordings = [], []
    bottle, meter = ((0.334, -0.18, 0.47), 2000.0), ((0.334, -0.195, 0.47), 20000.0)
    for scenario, obstacle, shape in (("bottle", bottle, (0.035, 0.09)), ("thrust meter", meter, (0.02, 0.0))):
        found += trials(
            rng,
            scenario,
            lambda name: {
                "contact_peak_n": 1.6 * STEADY_N[name],
                "contact_steady_n": STEADY_N[name],
                "impulse_ns": 4 * STEADY_N[name],
                "tau_steady_nm": 0.16 * STEADY_N[name],
                "tau_peak_nm": 0.26 * STEADY_N[name],
                "residual_steady_nm": 0.16 * STEADY_N[name],
                "residual_peak_nm": 0.2 * STEADY_N[name],
                "detect_ms": 30.0,
            },
        )
        recordings += [record(scenario, name, 6.0, obstacle, shape) for name in CONTROLLERS]
    found = [Trial(t.scenario, t.controller, t.seed, t.metrics | {"met": 1.0}) for t in found]
    return Experiment(
        "joint-safety", "Joint safety", "What are the forces?", tuple(found), joint.METRICS, joint.HIGHLIGHTS,
        tuple(recordings), (joint.CURVES,), Wiping().stage, policy=Wiping.policy,
    )  # fmt: skip


def task_safety():
    found = trials(
        np.random.default_rng(2),
        "wiping",
        lambda name: {
            "ink_removed": 0.8,
            "time_s": float("nan") if name == "paper" else 11.0,
            "tool_force_peak_n": 14.0,
            "tool_force_median_n": 5.0,
            "tool_force_p95_n": 9.0,
            "something_new": 1.0,
        },
    )
    recordings = tuple(record("wiping", name, 8.0) for name in CONTROLLERS)
    return Experiment(
        "task-safety", "Task safety", "Does the tool press gently?", tuple(found),
        (*Wiping.metrics, *task.with_aims(Wiping.aims)),
        Wiping.highlights, recordings, (task.curves(Wiping.panels), task.IMPEDANCE), Wiping().stage,
        policy=Wiping.policy,
    )  # fmt: skip


def disturbance():
    rng = np.random.default_rng(3)
    found, recordings = [], []
    for mode in ("at rest", "wiping"):
        for link in (4, 5, 6):
            scenario = f"push on link {link} while {mode}"
            found += trials(
                rng,
                scenario,
                lambda name: (
                    {f"error_{axis}_mm": ERROR_MM[name] * s for axis, s in zip("xyz", (0.6, 1, 0.3), strict=True)}
                    | {"error_max_mm": ERROR_MM[name]}
                ),
            )
            for name in CONTROLLERS:
                recording = record(scenario, name, 2.5)
                bump = touch(recording.trace["time"], 0.5, 1.2, 1.0) * (recording.trace["time"] < 2.0)
                recording.trace["error"][:, :3] = 0.001 * ERROR_MM[name] * bump[:, None] * (0.6, -1.0, 0.3)
                recordings.append(recording)
    return Experiment(
        "disturbance", "Disturbance", "How far does the tool stray?", tuple(found), pushes.METRICS, pushes.HIGHLIGHTS,
        tuple(recordings), (pushes.CURVES,),
    )  # fmt: skip


def everything():
    return (task_safety(), joint_safety(), disturbance())


INFO = {
    "version": "0.1.0",
    "when": "2026-01-02T03:04:05+00:00",
    "seeds": list(range(10)),
    "bundle_sha256": "0123456789abcdef" * 4,
    "command": "contactsafe demo --trials 10",
}
