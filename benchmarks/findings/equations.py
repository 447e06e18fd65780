"""What stands or fails in the printed equations: signs, gravity, the projector of (21)."""

from dataclasses import replace

import numpy as np
from benchmarks.findings.models import ARM, PAPER, SAFE, VICES, model_at, postures
from benchmarks.findings.printing import say, spreads
from benchmarks.findings.scenes import Loop, hold, lasting_pushes, strays_mm

import contactsafe as cs
from contactsafe.control.laws import contact_nullspace


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
