"""Localisation: where and how hard is the arm touched, by its joints' sensors, and what can they tell at best?"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from contactsafe.control.contact_estimator import ContactEstimator
from contactsafe.control.signals import Contact, Measurement
from contactsafe.experiments.collision_motions import scene_rng
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.detection import reporting
from contactsafe.experiments.localisation_metrics import (
    METRICS,
    NEAREST,
    SET,
    force_metrics,
    limit_metrics,
    point_metrics,
    set_metrics,
)
from contactsafe.experiments.localisation_tables import localisation_tables
from contactsafe.experiments.touch_limit import (
    TOOL_PRIOR,
    Surface,
    belief,
    dense_surface,
    force_at,
    is_no_single,
    spacing,
)
from contactsafe.experiments.touch_scenes import (
    MOVED,
    MOVED_MS,
    QUIET_SENSORS,
    REAL_SENSORS,
    REST_MS,
    STILL,
    STILL_MS,
    Sensed,
    TouchScene,
    sample_touch_scene,
    sense,
    true_base_wrench,
    true_torque,
)
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames

NAME = "localisation"
QUESTION = (
    "A random point of links 3 to 7 is touched with 10 to 60 N and stays touched while the tool moves 10 to 15 cm; of "
    "the arm only its joints' positions, velocities and torques are known, or the wrench at its base as well: where is "
    "the contact, and how strong?"
)
ZERO, NONE = "wrench of zero", "no wrench"
"""The force sensor at the wrist says that nothing touches the tool, or there is none."""

BASE = ", base sensor"
"""Behind either: what the sensor under the base says is known as well."""

TWO = "two contacts"

_LOOKED_AT = {STILL: STILL_MS, MOVED: MOVED_MS}
_BATCH = 16


def localisation(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy. Controllers that are blind to contact are left out.

    Args:
        config: controllers whose estimation is looked at, arm, seeds, and plants: real, or clean with quiet sensors.
        progress: told of every trial done.

    Raises:
        InvalidInputError: no controller reports contacts.
    """
    arm = config.arm
    surface = dense_surface(arm)
    estimators = {name: ContactEstimator(arm, controller) for name, controller in reporting(config.controllers).items()}
    trials: list[Trial] = []
    for start in range(0, config.trials, _BATCH):
        for plant in config.plants:
            for contacts in (1, 2):
                seeds = config.seeds[start : start + _BATCH]
                trials += _run_batch(surface, seeds, contacts, plant, estimators)
                if progress:
                    progress(len(seeds) * len(estimators) * len(_scenarios(contacts)))
    return Experiment(NAME, "Localisation", QUESTION, tuple(trials), METRICS, tables=localisation_tables(trials))


ENTRY = Entry(
    NAME,
    "where and how hard is the arm touched, and what can be known?",
    localisation,
    count=lambda config: (
        len(reporting(config.controllers)) * len(config.plants) * config.trials * sum(map(len, map(_scenarios, (1, 2))))
    ),
    trials=100,
    takes=("plants",),
)


def _scenarios(contacts: int) -> list[tuple[str, str]]:
    """Return what is known of wrist and base, and when is looked, for one contact or two."""
    wrists = (ZERO, NONE) if contacts == 1 else (ZERO,)
    return [(wrist + base, when) for base in ("", BASE) for wrist in wrists for when in _LOOKED_AT]


def _run_batch(
    surface: Surface, seeds: Sequence[int], contacts: int, plant: str, estimators: Mapping[str, ContactEstimator]
) -> list[Trial]:
    arm = surface.arm
    scenes = [sample_touch_scene(arm, seed, contacts) for seed in seeds]
    trials: list[Trial] = []
    for scene, sensed in zip(scenes, sense(arm, scenes, plant == "real"), strict=True):
        limits = _limits(surface, scene, sensed, plant)
        for wrench in dict.fromkeys(wrench for wrench, _ in _scenarios(contacts)):
            for name, estimator in estimators.items():
                for when, figures in _estimate(estimator, scene, sensed, wrench).items():
                    heading = ", ".join([TWO] * (contacts - 1) + [when, wrench])
                    figures = _named(figures | limits[wrench, when], contacts, when)
                    trials.append(Trial(heading, name, scene.motion.seed, figures, plant))
    return trials


def _named(figures: Mapping[str, float], contacts: int, when: str) -> dict[str, float]:
    """Return figures under the names of their metrics: what has an aim of its own has a name of its own."""
    if contacts > 1:
        kept = ("felt", "felt_early", "link", "force_n", "path_cm", "told", "limit_told")
        of_nearest = {f"nearest_{key}": figures.get(key, math.nan) for key in NEAREST}
        return {key: figures.get(key, math.nan) for key in kept} | of_nearest
    return {key.replace("within_5_cm", "within_5_cm_moved") if when == MOVED else key: x for key, x in figures.items()}


def _estimate(
    estimator: ContactEstimator, scene: TouchScene, sensed: Sensed, wrench: str
) -> dict[str, dict[str, float]]:
    """Let an estimator feel what the sensors said; return its figures while the arm was still and once it had moved."""
    wrench_ee, base = np.zeros(6) if wrench.startswith(ZERO) else None, wrench.endswith(BASE)
    estimator.reset(sensed.q[0], sensed.qd[0])
    found, early = {}, 0.0
    rows = zip(sensed.q, sensed.qd, sensed.torque, sensed.wrench_base, strict=True)
    for tick, (q, qd, torque, at_base) in enumerate(rows, start=1):
        contact = estimator.step(Measurement(q, qd, wrench_ee, torque=torque, wrench_base=at_base if base else None))
        if tick == REST_MS:
            early = float(contact.touched)
        for when in (name for name, looked_at in _LOOKED_AT.items() if looked_at == tick):
            figures = {"felt_early": early, "felt": float(contact.touched)}
            figures |= _scene_figures(scene)
            found[when] = figures | _figures(estimator, contact, scene, sensed.q_true[tick - 1])
    return found


def _scene_figures(scene: TouchScene) -> dict[str, float]:
    first = scene.touches[0]
    return {"link": float(first.link), "force_n": float(np.linalg.norm(first.force)), "path_cm": 100.0 * scene.path_m}


def _figures(estimator: ContactEstimator, contact: Contact, scene: TouchScene, q: np.ndarray) -> dict[str, float]:
    """Compare what an estimator says now with the truth in posture q; nothing is said where nothing is felt."""
    arm, places = estimator.arm, estimator.places(SET)
    if not places:
        return {}
    origins, rotations = (frames[0] for frames in link_frames(description_and_tool(arm)[0], q[None]))
    true = [(touch.link, *touch.in_world(origins, rotations)) for touch in scene.touches]
    touched = [(link, point) for link, point, _ in true]
    links = np.array([arm.n + 1 if place.on_tool else place.link for place in places])
    points = np.array([place.point for place in places])
    _, _, force = min(true, key=lambda one: float(np.linalg.norm(contact.point - one[1])))
    return {
        "tool_named": float(contact.kind == "tool"),
        "told": float(contact.several),
        **point_metrics(contact.point, contact.link, touched),
        **set_metrics(links, points, spacing(arm.places), touched),
        **force_metrics(contact.force, force),
    }


def _limits(surface: Surface, scene: TouchScene, sensed: Sensed, plant: str) -> dict[tuple[str, str], dict[str, float]]:
    """Return what the true torques, and the base's wrench, with the sensors' noise alone would tell, by scenario.

    Of two contacts that is whether a single one explains them; once the arm has moved, three postures are known.
    """
    n, sensors = surface.arm.n, REAL_SENSORS if plant == "real" else QUIET_SENSORS
    of_joint = math.hypot(sensors.joint_torque_nm, sensors.joint_torque_play_nm)
    sigma = np.repeat([of_joint, sensors.base_force_n, sensors.base_moment_nm], [n, 3, 3])
    rng = scene_rng(scene.motion.seed, 6)
    postures = [sensed.q_true[tick - 1] for tick in (STILL_MS, (STILL_MS + MOVED_MS) // 2, MOVED_MS)]
    felt = [true_torque(surface.arm, scene, q) + of_joint * rng.standard_normal(n) for q in postures]
    noise = sigma[n:] * rng.standard_normal((len(postures), 6))
    at_base = [true_base_wrench(surface.arm, scene, q) for q in postures] + noise
    found: dict[tuple[str, str], dict[str, float]] = {}
    for base, count in (("", n), (BASE, n + 6)):
        seen = [np.concatenate(both)[:count] for both in zip(felt, at_base, strict=True)]
        for when, many in ((STILL, 1), (MOVED, 3)):
            limits = _limits_of(surface, scene, postures[:many], seen[:many], sigma[:count])
            found |= {(wrench + base, when): figures for wrench, figures in limits.items()}
    return found


def _limits_of(
    surface: Surface, scene: TouchScene, postures: list[np.ndarray], felt: list[np.ndarray], sigma: np.ndarray
) -> dict[str, dict[str, float]]:
    """Return what is told by so many postures, by what is known of the wrist."""
    told = {"limit_told": float(is_no_single(surface, postures, felt, sigma))}
    if len(scene.touches) > 1:
        return {ZERO: told, NONE: told}
    (touch,), q, arm = scene.touches, postures[-1], surface.arm
    origins, rotations = (frames[0] for frames in link_frames(description_and_tool(arm)[0], q[None]))
    point, true_force = touch.in_world(origins, rotations)
    force = force_at(arm, q, (touch.link, point, rotations[touch.link] @ touch.inwards), felt[-1], sigma)
    known = belief(surface, postures, felt, sigma, TOOL_PRIOR)
    return {
        wrench: told | limit_metrics(of, force, surface.apart, (touch.link, point), true_force)
        for wrench, of in ((NONE, known), (ZERO, known.given(~surface.on_tool)))
    }
