"""Measure what the paper leaves open: one short function for each finding of docs/concepts/open.md.

`python docs/findings.py` runs all of them, `python docs/findings.py 3 12` two of them. Nothing below is typed in but
scenes and settings: every figure printed is measured when the program runs, on few trials, so that each finding takes
well under a minute. The first run compiles for a minute or two.
"""

import itertools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

import contactsafe as cs
from contactsafe.control.codes import FREE, REJECT
from contactsafe.control.laws import (
    contact_nullspace,
    stiffness_wrench,
    task_inertia,
    task_nullspace,
    torque_against_contact,
)
from contactsafe.experiments.adversarial import run_adversarial
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.collision_scenes import sample_meetings
from contactsafe.experiments.collisions import run_battery
from contactsafe.experiments.false_alarms import false_alarm_trials, sample_strokes
from contactsafe.experiments.franka_links import PUSH_POINTS
from contactsafe.experiments.motions import Playback, record
from contactsafe.experiments.pushes import CONTACT, point_torque, sample_push
from contactsafe.experiments.surfaces import clearance
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import NO_NOISE, PlantConfig, WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

ARM = cs.robots.panda()
STILL = np.zeros(ARM.n)
STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)
PUSH_N = 25.0
UNTOUCHED = np.zeros(6)
"""What a force sensor says while nothing touches the tool."""

PAPER, VICES, SAFE = cs.presets.paper(), cs.presets.vices(), cs.presets.safe()
FAST = PAPER.with_(
    compensation_gain=50.0, detection_gain=50.0, residual_threshold=2.0, null_damping=3.0, contact_damping=2.0
)
"""The paper's law with a fast observer and damping where (21) leaves none; nothing bounds its push."""


# Scenes ---------------------------------------------------------------------------------------------------------------


class Model(NamedTuple):
    """The arm's nominal model in one posture."""

    q: np.ndarray
    M_inv: np.ndarray
    J: np.ndarray
    J_bar: np.ndarray
    Lambda: np.ndarray
    N_t: np.ndarray
    g: np.ndarray


def model_at(q: np.ndarray, arm: cs.Arm = ARM) -> Model:
    """Evaluate an arm's nominal model at rest at q (n,) rad."""
    nominal = arm.dynamics(q, STILL)
    J, M_inv = nominal["J"].copy(), nominal["M_inv"].copy()
    Lambda, J_M_inv = task_inertia(J, M_inv, 0.0, 0.0)
    J_bar = J_M_inv.T @ Lambda
    return Model(q, M_inv, J, J_bar, Lambda, task_nullspace(J, J_bar), nominal["g"].copy())


def postures(count: int) -> list[np.ndarray]:
    """Give postures in which random sweeps and holds begin, away from singularities, (n,) rad each."""
    found: list[np.ndarray] = []
    for seed in itertools.count():
        q = sample_motion(ARM, seed).q_start
        m = model_at(q)
        if np.linalg.det(m.J @ m.M_inv @ m.J.T) > PAPER.impedance.manipulability_floor:
            found.append(q)
        if len(found) == count:
            break
    return found


def hold(
    config: cs.ControllerConfig,
    seconds: float,
    pushes: Sequence[tuple[int, Sequence[float]]] = ((0, ()),),
    obstacles: tuple[Obstacle, ...] = (),
) -> np.ndarray:
    """Let arms as modelled hold the tool at home, each pushed on one link from 0.2 s on; traces, (worlds, T)."""
    worlds = Worlds(ARM, WorldConfig(sensors=NO_NOISE, obstacles=obstacles), config, len(pushes), 0)
    for i, (link, force) in enumerate(pushes):
        worlds.reset(i, ARM.home)
        worlds.controllers[i]["target"]["K_task"] = STIFFNESS
        worlds.controllers[i]["target"]["D_task"] = 2.0 * np.sqrt(STIFFNESS)
        if link:
            worlds.push(i, f"link{link}", PUSH_POINTS[link], force, 0.2, seconds)
    step = np.zeros((worlds.n, 10), dtype=trace_dtype(ARM.n))
    pieces = []
    for _ in range(round(100 * seconds)):
        worlds.run(10, step)
        pieces.append(step.copy())
    worlds.close()
    return np.concatenate(pieces, axis=1)


def lasting_pushes() -> list[tuple[int, Sequence[float]]]:
    """Give horizontal pushes of 25 N from four sides on links 4, 5 and 6."""
    sides = [(math.cos(a), math.sin(a), 0.0) for a in np.arange(4) * math.pi / 2 + 0.4]
    return [(link, PUSH_N * np.array(side)) for link in PUSH_POINTS for side in sides]


def strays_mm(traces: np.ndarray) -> np.ndarray:
    """Give how far each tool went from where it was at first, mm."""
    return 1000.0 * np.linalg.norm(traces["position"] - traces["position"][:, :1], axis=2).max(axis=1)


class Loop:
    """A controller under a plain MuJoCo loop, the arm without friction; what pushes it is written into `data`.

    Args:
        config: of the controller.
        arm: whose model is the plant.
        q: where it starts and what it holds, (n,), rad.
        wrench_ee: what the force sensor says; None for no sensor.
    """

    def __init__(self, config: cs.ControllerConfig, arm: cs.Arm = ARM, q=ARM.home, wrench_ee=UNTOUCHED):
        self.model, self.data = arm.model, mujoco.MjData(arm.model)
        self.data.qpos[:] = q
        self.wrench_ee = wrench_ee
        mujoco.mj_forward(self.model, self.data)
        self.controller = cs.Controller(arm, config.with_(friction_compensation=False))
        self.controller.reset(q)
        self.target = cs.Target(arm.tool_pose(q), STIFFNESS, posture=q)

    def tick(self, torque: Callable[[cs.Output], np.ndarray] = lambda out: out.torque) -> cs.Output:
        """Run one millisecond; `torque` may change what is sent."""
        out = self.controller.step(cs.Measurement(self.data.qpos, self.data.qvel, self.wrench_ee), self.target)
        sent = torque(out)
        self.controller.record["state"]["command"]["tau"] = sent  # the observer has to know
        self.data.ctrl[:] = sent
        mujoco.mj_step(self.model, self.data)
        return out

    def push(self, body: str, force: Sequence[float]) -> None:
        """Push a body at its centre of mass with a force in world axes, N, from now on."""
        self.data.xfrc_applied[self.model.body(body).id, :3] = force

    def push_torque(self) -> np.ndarray:
        """Give the joint torque of what pushes, Jᵀ F, (n,), N m."""
        mujoco.mj_forward(self.model, self.data)
        torque, J = np.zeros(self.model.nv), np.zeros((3, self.model.nv))
        for body in range(1, self.model.nbody):
            mujoco.mj_jacBodyCom(self.model, self.data, J, None, body)
            torque += J.T @ self.data.xfrc_applied[body, :3]
        return torque


class Scenes:
    """Random motions and what the arm meets on them, as in `contactsafe experiment collisions`.

    Args:
        wanted: how many.
        sweeps_only: leave out those in which the tool holds still.
    """

    def __init__(self, wanted: int, sweeps_only: bool = False):
        self.motions = []
        seed = 0
        while len(self.motions) < wanted:
            motion = sample_motion(ARM, seed)
            if not (sweeps_only and motion.holds):
                self.motions.append(motion)
            seed += 1
        self.seeds = [motion.seed for motion in self.motions]
        worlds = Worlds(ARM, [motion.world((), True) for motion in self.motions], VICES, wanted, self.seeds)
        self.free = record(worlds, self.motions)
        worlds.close()
        self.obstacles = [
            tuple(meeting.obstacle for meeting in sample_meetings(ARM, motion, trace["q"]))
            for motion, trace in zip(self.motions, self.free, strict=True)
        ]

    def run(self, config: cs.ControllerConfig, worlds: Sequence[WorldConfig], kind: type[Worlds] = Worlds) -> list:
        """Play the motions under a controller; traces, one a scene."""
        stepped = kind(ARM, worlds, config, len(self.motions), self.seeds)
        traces = record(stepped, self.motions)
        stepped.close()
        return traces


def say(text: str) -> None:
    """Print one line of a finding."""
    print("   ", text, flush=True)


def spreads(values: Sequence[float], unit: str) -> str:
    """Write median, 95th percentile and largest of some figures."""
    return f"{np.median(values):.0f} / {np.percentile(values, 95):.0f} / {np.max(values):.0f} {unit}"


# The printed equations ------------------------------------------------------------------------------------------------


def sign_of_the_external_torque() -> None:
    """With (2) as printed the observer would report the negative of what pushes the arm."""
    loop = Loop(VICES.with_(compensation_gain=50.0))
    loop.push("link5", (0.0, 20.0, 0.0))
    for _ in range(300):
        out = loop.tick()
    true = loop.push_torque()
    cosine = true @ out.residual / np.linalg.norm(true) / np.linalg.norm(out.residual)
    J_bar = model_at(loop.data.qpos.copy()).J_bar
    left, doubled = (np.linalg.norm((J_bar.T @ (true - sign * out.residual))[:3]) for sign in (1, -1))
    say(f"20 N on the forearm: cosine of residual and J^T F {cosine:+.3f}; the printed sign asks for -1")
    say(f"force at the tool after (18) has compensated: {left:.1f} N; with the printed sign {doubled:.1f} N")


def gravity_in_the_null_space() -> None:
    """(17) with gravity in the task alone leaves N_t^T g: the elbow sinks until the posture task holds it."""
    models = sorted(map(model_at, postures(100)), key=lambda m: np.abs(m.N_t.T @ m.g).max())
    left = [np.abs(m.N_t.T @ m.g).max() for m in models]
    say(f"100 postures: joint torque left out {left[50]:.1f} N m, median, {left[95]:.1f} p95, {left[-1]:.1f} at most")
    sunk = []
    for whole in (True, False):
        loop = Loop(VICES, replace(ARM, torque_rate_max=1e9), models[95].q)

        def torque(out: cs.Output, loop: Loop = loop, whole: bool = whole) -> np.ndarray:
            m, now = model_at(loop.data.qpos.copy()), loop.controller.record["dynamics"]
            return out.torque if whole else out.torque - m.N_t.T @ (now["c"] + now["g"])

        before = loop.data.body("link4").xpos.copy()
        for _ in range(1500):
            out = loop.tick(torque)
        sunk.append(1000 * np.linalg.norm(loop.data.body("link4").xpos - before))
        tool = 1000 * np.linalg.norm(out.error[:3])
    say(f"p95 posture, 1.5 s: the elbow goes {sunk[1]:.1f} mm (tool {tool:.2f} mm); c + g whole {sunk[0]:.2f} mm")


def projector_is_zero() -> None:
    """(21) leaves no null space on a Panda: with the posture goes its damping, and a push accelerates the arm."""
    rng = np.random.default_rng(0)
    left, rank = [], []
    for m in map(model_at, postures(100)):
        N_ct = contact_nullspace(m.N_t, m.M_inv, rng.standard_normal(ARM.n))
        left.append(np.linalg.norm(N_ct) / np.linalg.norm(m.N_t))
        rank.append(np.linalg.matrix_rank(m.N_t, tol=1e-6))
    say(f"100 postures and contacts: rank of N_t at most {max(rank)}, |N_ct| / |N_t| at most {max(left):.0e}")
    pushes = [push for push in lasting_pushes() if push[0] == 5]
    quick = PAPER.with_(compensation_gain=50.0, detection_gain=50.0)
    for name, config in {
        "vices": VICES,
        "paper, K_I 50 1/s": quick,
        "the same, null_damping 3": quick.with_(null_damping=3.0),
        "safe": SAFE,
    }.items():
        traces = hold(config, 1.2, pushes)
        speed = np.abs(traces["q"][:, -1] - traces["q"][:, -11]).max(axis=1) / 0.01
        say(
            f"{name:26s} 25 N on link 5 for 1 s: tool {spreads(strays_mm(traces), 'mm')}, joint {speed.max():.2f} rad/s"
        )


def slow_observer() -> None:
    """K_I = 1.5 1/s finds a contact late; two filters of one observer serve triggering and compensation apart."""
    for gain in (PAPER.observer.detection_gain, 15.0, 50.0, SAFE.observer.detection_gain):
        found = []
        for step_nm in (3.0, 5.0, 10.0):
            loop = Loop(VICES.with_(detection_gain=gain, residual_cutoff_hz=math.inf))
            loop.data.qfrc_applied[0] = step_nm
            ticks = next((k for k in range(1000) if loop.tick().contact.link), math.inf)
            found.append(f"{ticks:.0f}")
        say(f"K_I {gain:5.1f} 1/s: steps of 3, 5, 10 N m cross 1.5 N m after {', '.join(found)} ms")


def printed_law_can_hurt() -> None:
    """The compensation cancels the reaction that would have stopped the arm: peaks above those of no law at all."""
    laws = {"vices": VICES, "paper": PAPER, "paper, K_I 15": PAPER.with_(compensation_gain=15.0, detection_gain=15.0)}
    _battery(laws, 48)


def bounded_push() -> None:
    """Bounding what the command pushes along the contact mends that."""
    bounded = PAPER.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0, null_damping=3.0)
    quick = FAST.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0)
    _battery({"vices": VICES, "paper, 3 N m": bounded, "fast, 3 N m": quick, "safe": SAFE}, 48)


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


def yield_or_hold() -> None:
    """One bound for all contacts either presses obstacles or lets a person's push carry the arm away."""
    free = FAST.with_(contact_torque_limit_comply_nm=math.inf, contact_torque_limit_reject_nm=math.inf)
    laws = {
        "no bound": free,
        "3 N m always": FAST.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0),
        "safe": SAFE,
    }
    battery = run_battery(laws, range(16), ["clean"])
    for name, config in laws.items():
        strays = strays_mm(hold(config, 1.7, lasting_pushes()))
        steady = [trial.metrics["contact_steady_n"] for trial in battery.trials if trial.controller == name]
        say(f"{name:13s} 12 pushes of 25 N for 1.5 s: tool {spreads(strays, 'mm'):18s} 16 collisions: "
            f"steady {spreads(steady, 'N')}")  # fmt: skip


def printed_projector_is_0_over_0() -> None:
    """(21) divides by zero where the contact lies wholly in task directions, and rounding decides what damps."""
    rng = np.random.default_rng(0)
    sizes, printed, guarded = [], [], []
    for m in map(model_at, postures(100)):
        residual = m.J.T @ rng.standard_normal(6)
        a = residual @ m.N_t
        a_sharp = m.M_inv @ a / (a @ m.M_inv @ a)
        size = np.linalg.norm(m.N_t)
        sizes.append(np.linalg.norm(a) / np.linalg.norm(residual))
        printed.append(np.linalg.norm(m.N_t @ (np.eye(ARM.n) - np.outer(a_sharp, a))) / size)
        guarded.append(np.linalg.norm(contact_nullspace(m.N_t, m.M_inv, residual) - m.N_t) / size)
    say(f"100 wrenches at the tool: |a| / |residual| at most {max(sizes):.0e}")
    say(f"|N_ct| / |N_t| as printed {min(printed):.2f} to {max(printed):.2f}; guarded, |N_ct - N_t| {max(guarded):.0e}")


def tool_and_arm_told_apart() -> None:
    """A wrench at the tool never shows in the null space, so what does is the arm's, even without a force sensor."""
    rng = np.random.default_rng(0)
    seen: dict[str, list[float]] = {"tool": [], "arm": []}
    for m in map(model_at, postures(100)):
        tool, arm = m.J.T @ rng.standard_normal(6), sample_push(ARM, m.q, rng, CONTACT).torque
        for name, torque in (("tool", tool), ("arm", arm)):
            seen[name].append(np.linalg.norm(m.N_t.T @ torque) / np.linalg.norm(torque))
    say(f"part of a joint torque in the null space: wrench at the tool at most {max(seen['tool']):.0e}, "
        f"push on links 3-7 median {np.median(seen['arm']):.2f}")  # fmt: skip
    found = []
    for body in ("tool", "link4"):
        loop = Loop(SAFE, wrench_ee=None)
        loop.push(body, (0.0, PUSH_N, 0.0))
        found.append(sum(loop.tick().contact.in_contact for _ in range(500)))
    say(f"25 N for 0.5 s, no force sensor: contact mode for {found[0]} ms with the push on the tool, "
        f"{found[1]} ms on link 4")  # fmt: skip


def soft_wrist() -> None:
    """K1 stands before the task inertia: little stiffness about the tool's axis, and axes that push each other."""
    light = replace(ARM, model=mujoco.MjModel.from_xml_string(_arm_mjcf(armature=0.0)))
    for name, arm in {"no rotors": light, "rotors of 0.1 kg m²": ARM}.items():
        m = model_at(ARM.home, arm)
        loop = Loop(VICES, arm)
        loop.target = loop.target._replace(stiffness=np.full(6, 150.0))
        loop.push("tool", (0.0, 0.0, PUSH_N))
        for _ in range(1500):
            out = loop.tick()
        away = -1000 * out.error[:3]
        softest = 150.0 * np.linalg.eigvalsh(m.Lambda[3:, 3:])[0]
        say(f"{name:20s} K1 150: {softest:.1f} N m/rad about the softest axis, Λ_zx {m.Lambda[2, 0]:.1f} kg; "
            f"25 N in z: tool {away[0]:.0f} mm in x, {away[2]:.0f} mm in z")  # fmt: skip


def _arm_mjcf(mass: float = 1.0, armature: float = 1.0) -> str:
    """Write the arm with its links' masses and its rotors' inertia as multiples of the nominal ones."""
    description, tool = description_and_tool(ARM)
    links = tuple(
        replace(
            link,
            joint=replace(link.joint, armature=armature * link.joint.armature),
            inertia=replace(link.inertia, mass=mass * link.inertia.mass),
        )
        for link in description.links
    )
    return arm_mjcf(replace(description, links=links), tool)


# What this project found ----------------------------------------------------------------------------------------------


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


def force_added_drags_the_arm() -> None:
    """Adding a torque along the contact keeps the bound too, but the rest of the task drags the blocked arm on."""
    scenes = Scenes(24, sweeps_only=True)
    delayed = PlantConfig(torque_delay_ticks=1)
    worlds = [WorldConfig(plant=delayed, obstacles=obstacles) for obstacles in scenes.obstacles]
    runs = {
        "no bound": scenes.run(FAST, worlds),
        "3 N m by adding": scenes.run(FAST, worlds, _ForceAdded),
        "3 N m by yielding": scenes.run(
            FAST.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0), worlds
        ),
        "safe": scenes.run(SAFE, worlds),
    }
    for name, traces in runs.items():
        peaks = [trace["obstacle_force"].max() for trace in traces]
        steady = [trace["obstacle_force"][-500:].mean() for trace in traces]
        say(f"{name:18s} 24 sweeps: peak {spreads(peaks, 'N'):20s} steady {spreads(steady, 'N')}")


def pusher_or_obstacle() -> None:
    """The sign of the work misses many that push a moving arm; yielding a little to see whether it eases does not."""
    scenes = Scenes(48)
    real = [motion.world(met, True) for motion, met in zip(scenes.motions, scenes.obstacles, strict=True)]
    found: dict[str, list[list[int]]] = {}
    for config in (FAST, SAFE):
        for kind, traces in (("a sweep into an obstacle", scenes.run(config, real)), ("", _pushed(scenes, config))):
            for motion, trace in zip(scenes.motions, traces, strict=True):
                if not (kind and motion.holds):
                    name = kind or ("a push on a held arm" if motion.holds else "a push on a moving arm")
                    found.setdefault(name, []).append([config is SAFE, *_verdicts(trace)])
    for name, rows in found.items():
        fast, safe = (np.array([row[1:] for row in rows if row[0] == which]).sum(axis=0) for which in (False, True))
        by_work = f"{fast[1]} of {fast[0]} (no bound), {safe[1]} of {safe[0]} (safe)"
        say(f"{name:24s} taken for a push by its work: {by_work}; by yielding: {safe[2]} of {safe[0]}")


def _pushed(scenes: Scenes, config: cs.ControllerConfig = SAFE) -> list[np.ndarray]:
    """Push each arm with 25 N for 1.5 s instead, on link 4, 5 or 6, from the side."""
    n = len(scenes.motions)
    worlds = Worlds(ARM, [motion.world((), True) for motion in scenes.motions], config, n, scenes.seeds)
    play, steps = Playback(worlds, scenes.motions), np.zeros((n, MAX_TICKS), dtype=trace_dtype(ARM.n))
    for i, motion in enumerate(scenes.motions):
        link, angle = 4 + i % 3, 2.4 * i
        force = PUSH_N * np.array([math.cos(angle), math.sin(angle), 0.0])
        worlds.push(i, f"link{link}", PUSH_POINTS[link], force, motion.meets_s, motion.meets_s + 1.5)
    pieces = []
    while play.ticks < 2600:
        ticks = play.step(steps)
        pieces.append(steps[:, :ticks].copy())
    worlds.close()
    return list(np.concatenate(pieces, axis=1))


def _verdicts(trace: np.ndarray) -> tuple[bool, bool, bool]:
    """Tell whether a contact was found, whether its work in the next 50 ms says push, and the controller in 0.5 s."""
    found = (trace["mode"] != FREE) & (np.abs(trace["tau_arm"]).max(axis=1) > 0.3)
    first = int(np.argmax(found))
    work = np.einsum("ti,ti->t", trace["residual_fast"][:-1], np.diff(trace["q"], axis=0))
    pushes = bool(work[first : first + 50].sum() > 0), bool(trace["mode"][first : first + 500][-1] == REJECT)
    return (True, *pushes) if found.any() else (False, False, False)


def stiff_pusher_that_stays() -> None:
    """Where the null space does not yield, rejecting a stiff thing that stays means pressing hard."""
    laws = {
        "vices": VICES,
        "no bound": FAST,
        "3 N m always": FAST.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0),
    }
    things = {"front": _driven_into_the_forearm((-1.0, 0.0, 0.0)), "side": _driven_into_the_forearm((0.0, 1.0, 0.0))}
    for name, config in {**laws, "safe": SAFE}.items():
        found = []
        for whence, thing in things.items():
            trace = hold(config, 3.0, obstacles=(thing,))
            force, away = trace["obstacle_force"][0], strays_mm(trace)[0]
            found.append(
                f"from the {whence}: tool {away:2.0f} mm, {force.max():3.0f} N, {force[-500:].mean():3.0f} N at last"
            )
        say(f"{name:13s} {'; '.join(found)}")


def _driven_into_the_forearm(direction: Sequence[float]) -> Obstacle:
    """Give a sphere of 20 kN/m that comes along a direction, 15 mm into where the forearm is, and stays."""
    origins, rotations = link_frames(description_and_tool(ARM)[0], ARM.home[None])
    place = origins[0, 5] + rotations[0, 5] @ np.array(PUSH_POINTS[5])
    radius, gap, side = 0.04, 0.005, np.array(direction)
    while clearance(ARM, ARM.home[None], place) < radius + gap:
        place = place - 0.0005 * side
    (x, y, z), (tx, ty, tz) = place.tolist(), ((gap + 0.015) * side).tolist()
    return Obstacle((x, y, z), radius, 20e3, travel=(tx, ty, tz), travel_s=(0.2, 0.5))


def naming_the_link() -> None:
    """The furthest joint over its threshold seldom is the one that moves the touched link."""
    rng = np.random.default_rng(0)
    surface = ARM.surface
    own, furthest, nearest = [], [], []
    for q in postures(100):
        origins, rotations = (frame[0] for frame in link_frames(description_and_tool(ARM)[0], q[None]))
        unit = np.array([_unit_torque(origins, rotations, row) for row in surface])
        sizes = np.linalg.norm(unit, axis=1)
        for _ in range(5):
            push = sample_push(ARM, q, rng, CONTACT)
            torque = 10.0 * push.torque / np.linalg.norm(push.force)
            own.append(abs(torque[push.link - 1]))
            over = np.flatnonzero(np.abs(push.torque) > PAPER.detection.residual_threshold)
            furthest.append(abs(push.link - (over[-1] + 1 if over.size else 0)))
            fit = unit @ torque / np.maximum(sizes, 1e-9)
            nearest.append(abs(push.link - surface[int(np.argmax(fit)), 0]))
    say(f"500 pushes on links 3-7: 10 N are {np.median(own):.3f} N m at the pushed link's own joint, median "
        f"(over 1.5 N m in {100 * np.mean(np.array(own) > 1.5):.0f} %)")  # fmt: skip
    for name, off in {"furthest joint above 1.5 N m": furthest, "nearest point of the surface": nearest}.items():
        right, next_to = 100 * np.mean(np.array(off) == 0), 100 * np.mean(np.array(off) <= 1)
        say(f"10 to 60 N, by the {name:28s} the link is right in {right:.0f} %, at most one off in {next_to:.0f} %")


def _unit_torque(origins: np.ndarray, rotations: np.ndarray, row: np.ndarray) -> np.ndarray:
    link = int(row[0])
    place = origins[link] + rotations[link] @ row[1:4]
    return point_torque(origins, rotations, link, place, -rotations[link] @ row[4:])


def masses_of_the_links() -> None:
    """A mass error of 10 % exceeds the threshold; they are identified while nothing touches the arm."""
    heavy = replace(ARM, model=mujoco.MjModel.from_xml_string(_arm_mjcf(mass=1.1)))
    off = np.median([np.abs(model_at(q, heavy).g - model_at(q).g) for q in postures(100)], axis=0)
    say(f"links 10 % heavier: {', '.join(f'{nm:.1f}' for nm in off)} N m at joints 1 to 7, median of 100 postures")
    strokes = sample_strokes(ARM, 0, 6)
    laws = {"paper": PAPER, "safe, no masses": SAFE.with_(mass_uncertainty=0.0), "safe": SAFE}
    for name, config in laws.items():
        found = [trial.metrics for trial in false_alarm_trials(ARM, name, config, strokes)]
        contacts, lasted = sum(f["false_alarms"] for f in found), sum(f["false_contact_s"] for f in found)
        minutes = sum(f["minutes"] for f in found)
        counted = f"{contacts:.0f} false contacts, {lasted:.0f} s of them"
        say(f"{name:19s} masses ± 10 %, {minutes:.1f} min without contact: {counted}")


def impact_on_a_fixed_thing() -> None:
    """The peak of an impact on a thing that cannot move comes before any law can know of it."""
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
    """Give the peak of the first 20 ms, N, when it was and when the contact was found, ms, and what came later, N."""
    first = int(np.argmax(trace["obstacle_force"] > 0.5))
    force, found = trace["obstacle_force"][first:], trace["link"][first:] > 0
    peak_ms = int(np.argmax(force[:20]))
    return force[peak_ms], peak_ms, np.argmax(found) if found.any() else math.inf, force[20:].max()


def force_and_energy() -> None:
    """K e of a far target is a force without bound: bound that force, and the energy that the command may give."""
    m, error = model_at(ARM.home), np.array([0.0, 10.0, 0.0, 0.0, 0.0, 0.0])
    forces = [
        np.linalg.norm(
            stiffness_wrench(
                m.Lambda,
                error,
                np.full(6, 1500.0),
                c.impedance.task_acceleration_max_m_s2,
                c.impedance.task_acceleration_max_rad_s2,
            )[:3]
        )
        for c in (PAPER, SAFE)
    ]
    say(f"a target 10 m away, K1 1500 1/s²: a force of {forces[0]:.0f} N; bounded {forces[1]:.0f} N")
    tank = {"tank_j": SAFE.limits.tank_j, "tank_power_w": SAFE.limits.tank_power_w}
    bounded = {
        name: getattr(SAFE, name)
        for name in ("task_acceleration_max_m_s2", "task_acceleration_max_rad_s2", "posture_error_max_rad")
    }
    laws = {"paper": PAPER, "+ tank": PAPER.with_(**tank), "+ bounded force": PAPER.with_(**bounded), "safe": SAFE}
    for name, config in laws.items():
        found = run_adversarial(ARM, config, range(8), 5000)
        given, beyond = (max(f[figure] for f in found) for figure in ("energy_given_j", "joint_range_beyond_mrad"))
        say(f"{name:14s} 8 adversarial runs of 5 s: at most {given:3.0f} J given away (a tank's bound: "
            f"{SAFE.limits.tank_j + 5 * SAFE.limits.tank_power_w:.0f} J), {beyond:3.0f} mrad out of range")  # fmt: skip


def gains_that_pump() -> None:
    """Stiffness that rises going in and falls going out feeds the arm; bounding its rise stops that."""
    for name, config in {"gains as asked": VICES, "gains rise passively": VICES.with_(passive_gains=True)}.items():
        loop = Loop(config)
        goal, soft, stiff = loop.target, np.full(6, 40.0), np.full(6, 160.0)
        aside = goal.pose.position + np.array([0.0, 0.02, 0.0])
        loop.target = goal._replace(pose=cs.Pose(aside, goal.pose.quat))
        for _ in range(1000):
            out = loop.tick()
        gentle = np.full(6, 2.0)
        away, last = [], 0.0
        for k in range(4000):
            if k % 17 == 0:
                error = 0.0 if k == 0 else out.error[1]
                inwards = error * (error - last) < 0
                loop.target = goal._replace(stiffness=stiff if inwards else soft, damping=gentle)
                last = error
            out = loop.tick()
            away.append(1000 * abs(out.error[1]))
        say(f"{name:21s} swing of {max(away[:500]):.0f} mm in the first 0.5 s, {max(away[-1000:]):.0f} mm after 3 s")


FINDINGS: dict[int, Callable[[], None]] = {
    1: projector_is_zero,
    2: slow_observer,
    3: printed_law_can_hurt,
    4: bounded_push,
    5: yield_or_hold,
    6: printed_projector_is_0_over_0,
    7: tool_and_arm_told_apart,
    8: soft_wrist,
    10: sign_of_the_external_torque,
    11: gravity_in_the_null_space,
    12: force_added_drags_the_arm,
    13: pusher_or_obstacle,
    14: stiff_pusher_that_stays,
    15: naming_the_link,
    16: masses_of_the_links,
    17: impact_on_a_fixed_thing,
    18: force_and_energy,
    19: gains_that_pump,
}


def main(arguments: Sequence[str] = ()) -> int:
    """Run the findings named by number, or all."""
    try:
        wanted = [int(word) for word in arguments] or list(FINDINGS)
        chosen = {number: FINDINGS[number] for number in wanted}
    except (ValueError, KeyError):
        print(f"findings: give numbers out of {', '.join(map(str, FINDINGS))}, or none for all", file=sys.stderr)
        return 2
    for number, measure in chosen.items():
        print(f"{number}. {(measure.__doc__ or '').strip()}", flush=True)
        measure()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
