"""Joint safety: a dark object unknown to the policy draws it to the right, and the forearm runs into something."""

from collections.abc import Callable

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.results import Experiment, Recording, Trial
from contactsafe.experiments.run import Progress, held_out, policy_for, run_policy
from contactsafe.policy.action import DOWN
from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.config import Obstacle, WorldConfig, bottle, thrust_meter
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

QUESTION = (
    "An object the policy has never seen draws it to the right, where something is held in the forearm's way: "
    "how hard is the contact?"
)
OBSTACLES: dict[str, Callable[..., Obstacle]] = {"bottle": bottle, "thrust meter": thrust_meter}
OBJECT_CENTRE, OBJECT_SIZE = (0.5, -0.24), (0.10, 0.06)
DURATION_S = 10.0
STEADY_S = 2.0
"""The last part of a run, over which steady figures are means: who bounces is not let off between two blows."""

_FOREARM_LINK = 5
_HIT_AT = (-0.12, -0.06)  # range of the tool's y at which the forearm meets the obstacle, m
_CONTACT_N = 0.5  # obstacle force that counts as contact


def joint_safety(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment.

    Args:
        bundle: loaded `Bundle`.
        config: controllers and seeds.
        progress: told of every trial done.
    """
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for scenario, make in OBSTACLES.items():
        runs: dict[int, list[Recording]] = {}
        for name in config.controllers:
            for seeds in config.batches():
                tasks, run = _collide(bundle, make, name, seeds)
                trials += [Trial(scenario, name, seed, contact_metrics(run.traces[i])) for i, seed in enumerate(seeds)]
                if config.seed in seeds:
                    obstacle = tasks.worlds.configs[0].obstacles[0]
                    shape = (obstacle.radius, obstacle.half_length)
                    for i, seed in enumerate(seeds):
                        runs.setdefault(seed, []).append(run.recording(i, scenario, name, seed, shape))
                tasks.worlds.close()
                if progress:
                    progress(len(seeds))
        recordings += _worth_showing(runs)
    return Experiment("joint-safety", QUESTION, tuple(trials), tuple(recordings))


def _worth_showing(runs: dict[int, list[Recording]]) -> list[Recording]:
    """Choose the first seed with which every arm met the obstacle; the first of all where there is none."""
    met = [all((r.trace["obstacle_force"] > _CONTACT_N).any() for r in recordings) for recordings in runs.values()]
    return list(runs.values())[met.index(True) if True in met else 0]


def _collide(bundle, make, controller: str, seeds: range):
    probe = WipingTasks(WipingConfig())
    rngs = [held_out(seed) for seed in seeds]
    worlds = [WorldConfig(obstacles=(make(held_before_forearm(probe, make, rng)),)) for rng in rngs]
    tasks = WipingTasks(WipingConfig(controller=controller), len(seeds), list(seeds), worlds)
    x, y, z = tasks.config.world.board.centre
    for i, rng in enumerate(rngs):
        # On the left half of the board: never beyond the obstacle to begin with.
        tasks.reset(i, rng, start=(x + rng.uniform(-0.1, 0.1), y + rng.uniform(0.0, 0.1), z + 0.05))
        tasks.worlds.boards[i].place_object(OBJECT_CENTRE, OBJECT_SIZE)
        tasks.observe(i)
    return tasks, run_policy(tasks, policy_for(bundle, tasks).act, round(DURATION_S * 60), stop_when_clean=False)


def held_before_forearm(tasks: WipingTasks, make: Callable[..., Obstacle], rng: np.random.Generator) -> tuple:
    """Find where somebody would hold an obstacle so that the forearm passes there on the tool's way to the object.

    Args:
        tasks: for arm and board.
        make: the obstacle's kind.
        rng: draws how far on its way the forearm meets it.

    Returns:
        Centre of the obstacle, x, y, z, m.
    """
    x, _, z = tasks.config.world.board.centre
    q = tasks.posture_over(Pose(np.array([x, rng.uniform(*_HIT_AT), z]), DOWN))
    middle, radius = forearm(tasks.arm, q)
    gap = radius + make((0.0, 0.0, 0.0)).radius
    return (float(middle[0]), float(middle[1] - gap), float(middle[2]))


def forearm(arm: Arm, q: np.ndarray) -> tuple[np.ndarray, float]:
    """Give middle, (3,) m, and radius, m, of the forearm's thickest capsule at q (n,) rad."""
    if arm.description is None or arm.tool is None:
        raise InvalidInputError(
            f"arm '{arm.name}' has no description to draw a forearm from; give contactsafe.robots.panda()"
        )
    starts, ends, radii, links = arm_capsules(arm.description, arm.tool, q[None])
    of_link = np.flatnonzero(np.asarray(links) == _FOREARM_LINK)
    thickest = of_link[np.argmax(radii[of_link])]
    return (starts[0, thickest] + ends[0, thickest]) / 2, float(radii[thickest])


def contact_metrics(trace: np.ndarray) -> dict[str, float]:
    """Summarise one collision; all but `met` are NaN where the arm met nothing.

    Args:
        trace: `trace_dtype` records, (T,).
    """
    force = trace["obstacle_force"]
    touching = force > _CONTACT_N
    met = bool(touching.any())
    names = (
        "contact_peak_n", "contact_steady_n", "impulse_ns", "tau_peak_nm", "tau_steady_nm", "residual_peak_nm",
        "residual_steady_nm", "detect_ms", "tool_force_peak_n", "mode_switches",
    )  # fmt: skip
    if not met:
        return dict.fromkeys(names, float("nan")) | {"met": 0.0}
    steady = trace["time"] > trace["time"][-1] - STEADY_S
    tau, residual = np.abs(trace["tau_arm"]).max(axis=1), np.abs(trace["residual"]).max(axis=1)
    first = int(np.argmax(touching))
    found = trace["link"][first:] > 0
    detect = float(np.argmax(found)) if found.any() and not found[0] else float("nan")
    switches = int(np.count_nonzero(np.diff(trace["mode"] != FREE)))
    values = (
        force.max(), force[steady].mean(), force.sum() / 1000.0, tau.max(), tau[steady].mean(), residual.max(),
        residual[steady].mean(), detect, np.linalg.norm(trace["tool_force"], axis=1).max(), switches,
    )  # fmt: skip
    return {name: float(value) for name, value in zip(names, values, strict=True)} | {"met": 1.0}
