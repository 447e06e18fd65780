"""What an arm of a downloaded model is put through: hold, move, be pushed, run into a sphere; and what is measured."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactsafe.control.config import ControllerConfig
from contactsafe.control.controller import Controller
from contactsafe.control.signals import Measurement, Target
from contactsafe.robot.arm import Pose
from contactsafe.sim.model_arms import ModelArm, pushed_at
from contactsafe.sim.model_scenes import Scene, build_scene, sphere_in_path

STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)
HOLD_S, MOVE_S, SETTLE_S, PUSHED_S, PUSH_S = 3.0, 2.0, 1.0, 0.5, 1.5
SPRING_N_M = 5000.0
"""Of the sphere that is on springs."""

Path = Callable[[float], tuple[np.ndarray, np.ndarray]]
"""From time, s, to where x_d is, (3,), m, and the posture, (n,), rad."""


@dataclass(frozen=True)
class Run:
    """One run, tick by tick.

    Attributes:
        q, qd: (T, n), rad and rad/s.
        position: of the tool, (T, 3), m.
        error: distance of the tool from x_d, (T,), m.
        in_contact: whether one was reported, (T,).
        force: on the sphere, (T,), N.
        finite: whether every torque was a number.
    """

    q: np.ndarray
    qd: np.ndarray
    position: np.ndarray
    error: np.ndarray
    in_contact: np.ndarray
    force: np.ndarray
    finite: bool


def play(
    of: ModelArm,
    scene: Scene,
    config: ControllerConfig,
    with_wrench: bool,
    path: Path,
    seconds: float,
    push: tuple[str, np.ndarray] | None = None,
) -> Run:
    """Let a controller drive an arm in a scene.

    Args:
        of: the arm.
        scene: fresh.
        config: of the controller.
        with_wrench: whether it is told that nothing touches the tool.
        path: of x_d.
        seconds: that it lasts.
        push: joint whose body is pushed from `PUSHED_S` on for `PUSH_S`, and force, world, (3,), N.
    """
    arm, controller, rows = of.arm, Controller(of.arm, config), list[tuple]()
    controller.reset(arm.home)
    quat, wrench = arm.tool_pose(arm.home).quat, np.zeros(6) if with_wrench else None
    for tick in range(round(1000 * seconds)):
        position, posture = path(0.001 * tick)
        target = Target(Pose(position, quat), STIFFNESS, posture=posture)
        out = controller.step(Measurement(scene.q, scene.qd, wrench), target)
        if push is not None:
            scene.push(push[0], push[1] * (PUSHED_S <= 0.001 * tick < PUSHED_S + PUSH_S))
        scene.step(out.torque)
        at = scene.tool.copy()
        sound = np.isfinite(out.torque).all()
        rows.append((scene.q, scene.qd, at, out.contact.in_contact, scene.force_on_sphere(), position, sound))
    q, qd, tool, in_contact, force, asked, sounds = (np.array(column) for column in zip(*rows, strict=True))
    return Run(q, qd, tool, np.linalg.norm(tool - asked, axis=1), in_contact, force, bool(sounds.all()))


def hold_path(of: ModelArm) -> Path:
    """Return the path that stays where the arm is at home."""
    start = of.arm.tool_pose(of.arm.home).position.copy()
    return lambda time: (start, of.arm.home)


def move_path(of: ModelArm) -> Path:
    """Return the path of the move, smooth, in `MOVE_S`."""
    start = of.arm.tool_pose(of.arm.home).position.copy()

    def at(time: float) -> tuple[np.ndarray, np.ndarray]:
        s = min(time / MOVE_S, 1.0)
        fraction = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        return start + fraction * of.move, of.arm.home + fraction * (of.q_end - of.arm.home)

    return at


def trial(of: ModelArm, config: ControllerConfig, with_wrench: bool, free: np.ndarray | None) -> dict[str, float]:
    """Put an arm through everything under one controller.

    Args:
        of: the arm.
        config: of the controller.
        with_wrench: whether it is told that nothing touches the tool.
        free: centre of the sphere in its path, (3,), m; None where there is none.

    Returns:
        Figures by name; those are missing that the arm cannot be asked for.
    """
    runs = [play(of, build_scene(of), config, with_wrench, hold_path(of), HOLD_S)]
    figures = {"hold_mm": 1000.0 * float(runs[0].error.max()), "false_contact": float(runs[0].in_contact.mean())}
    pushed = play(of, build_scene(of), config, with_wrench, hold_path(of), 1.0 + PUSH_S, pushed_at(of))
    runs.append(pushed)
    begun = round(1000 * PUSHED_S)
    away = np.linalg.norm(pushed.position - pushed.position[begun - 1], axis=1)
    figures["pushed_mm"] = 1000.0 * float(away[begun:].max())
    if of.move.any():
        moved = play(of, build_scene(of), config, with_wrench, move_path(of), MOVE_S + SETTLE_S)
        figures["move_mm"] = 1000.0 * float(moved.error[-1])
        figures["false_contact"] = max(figures["false_contact"], float(moved.in_contact.mean()))
        runs.append(moved)
    if free is not None:
        for name, stiffness in (("fixed", np.inf), ("sprung", SPRING_N_M)):
            swept = play(of, build_scene(of, free, stiffness), config, with_wrench, move_path(of), MOVE_S + SETTLE_S)
            runs.append(swept)
            figures[f"{name}_peak_n"] = float(swept.force.max())
            figures[f"{name}_steady_n"] = float(swept.force[-500:].mean())
    figures["joint_speed_peak_rad_s"] = float(np.max([np.abs(run.qd).max() for run in runs]))
    figures["not_finite"] = float(not all(run.finite and np.isfinite(run.q).all() for run in runs))
    return {name: value if np.isfinite(value) else np.inf for name, value in figures.items()}


def swept_sphere(of: ModelArm, config: ControllerConfig) -> np.ndarray | None:
    """Return where a sphere is that the arm meets on its path, (3,), m; None where it meets none."""
    if not of.move.any():
        return None
    centre = sphere_in_path(of, play(of, build_scene(of), config, True, move_path(of), MOVE_S).q)
    if centre is None:
        return None
    met = play(of, build_scene(of, centre), config, True, move_path(of), MOVE_S)
    return centre if met.force.max() > 0.0 and met.force[0] == 0.0 else None
