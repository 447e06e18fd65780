"""Detection, isolation and identification: when a contact is found, on which link, against errors of the model."""

import math
from dataclasses import replace

import mujoco
import numpy as np
from benchmarks.findings.models import ARM, PAPER, SAFE, VICES, model_at, postures, scaled_mjcf
from benchmarks.findings.printing import say
from benchmarks.findings.scenes import PUSH_N, Loop

from contactsafe.experiments.false_alarms import false_alarm_trials, sample_strokes
from contactsafe.experiments.onsets import CONTACT, point_torque, sample_push
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames


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
    heavy = replace(ARM, model=mujoco.MjModel.from_xml_string(scaled_mjcf(mass=1.1)))
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
