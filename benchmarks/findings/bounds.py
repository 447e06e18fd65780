"""Stiffness, force and energy of the task: what the gains come to, and what bounds it."""

from dataclasses import replace

import mujoco
import numpy as np
from benchmarks.findings.models import ARM, PAPER, SAFE, VICES, model_at, scaled_mjcf
from benchmarks.findings.printing import say
from benchmarks.findings.scenes import PUSH_N, Loop

import contactsafe as cs
from contactsafe.control import presets
from contactsafe.control.laws import stiffness_wrench
from contactsafe.experiments.adversarial import run_adversarial


def soft_wrist() -> None:
    """K1 stands before the task inertia: little stiffness about the tool's axis, and axes that push each other."""
    light = replace(ARM, model=mujoco.MjModel.from_xml_string(scaled_mjcf(armature=0.0)))
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
    accelerations = ("task_acceleration_max_m_s2", "task_acceleration_max_rad_s2")
    bounded = {name: presets.SAFE[name][0] for name in (*accelerations, "posture_error_max_rad")}
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
