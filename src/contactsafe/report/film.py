"""What the page's film plays: the arm's shape once, and every run as small integers at 60 Hz."""

import base64
import json
import math
from collections.abc import Sequence

import numpy as np

from contactsafe.control.codes import COMPLY, REJECT
from contactsafe.core.rotation import quat_to_matrix
from contactsafe.report import data
from contactsafe.report.scene import fit
from contactsafe.results.experiment import Experiment
from contactsafe.results.metrics import CONTACT_N
from contactsafe.results.recording import Recording, Stage
from contactsafe.robot.description import Capsule, Quaternion, Vector3
from contactsafe.robot.shape import tip_rings

FRAMES_HZ = 60
"""Frames of the film a second: those of a screen."""

Q_UNIT, POSITION_UNIT, FORCE_UNIT = 2e-4, 1e-4, 0.05
"""rad, m and N of one step of the film's integers."""

CHANNELS = ("x", "y", "z", "force", "mode", "link")
"""Of a frame, after its joint positions: place of the obstacle, then the rest; film.js finds them by these names."""

MODES = {COMPLY: "complies with", REJECT: "rejects"}
"""What an arm does with a contact, by the number in channel `mode`; any other mode has none."""

_UNCHANGED = 0
"""A cell of a picture that is as in the one before; others hold their value + 1."""

_LONGEST = 65535  # cells in a row that one pair of numbers stands for


def film_json(experiment: Experiment, stage: Stage) -> str | None:
    """Return the film of an experiment's recordings as JSON for film.js; None where nothing was recorded.

    Args:
        experiment: with recordings.
        stage: arm, tool and surface.
    """
    scenes = [_scene(stage, name, data.recorded(experiment, name)) for name in data.scenarios(experiment)]
    scenes = [scene for scene in scenes if scene is not None]
    if not scenes:
        return None
    film = {
        "hz": FRAMES_HZ,
        "channels": CHANNELS,
        "modes": MODES,
        "units": {"q": Q_UNIT, "position": POSITION_UNIT, "force": FORCE_UNIT},
        "arm": _arm(stage),
        "surface": {"corners": _rounded(stage.corners), "colours": stage.colours},
        "scenes": scenes,
    }
    return json.dumps(film, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def first_contact(recording: Recording) -> int | None:
    """Return the first tick at which an obstacle presses the arm; None where none ever does."""
    touching = recording.trace["obstacle_force"] > CONTACT_N
    return int(np.argmax(touching)) if touching.any() else None


def _scene(stage: Stage, name: str, recordings: list[Recording]) -> dict | None:
    if not recordings:
        return None
    view = fit(stage, recordings)
    of_obstacle = any(recording.obstacle for recording in recordings)
    runs = [_run(recording, of_obstacle) for recording in recordings]
    contacts = [tick for recording in recordings if (tick := first_contact(recording)) is not None]
    return {
        "name": name,
        "force": "contact force" if of_obstacle else "tool force",
        "limit": max(1.0, *(force(recording, of_obstacle).max() for recording in recordings)),
        "start": round(min(contacts) / 1000 + 0.3, 3) if contacts else 0.0,
        "target": _rounded(view.target),
        "span": _rounded(view.span),
        "azimuth": round(view.azimuth, 4),
        "elevation": round(view.elevation, 4),
        "runs": runs,
    }


def _run(recording: Recording, of_obstacle: bool) -> dict:
    trace = recording.trace
    count = max(1, math.floor(len(trace) * FRAMES_HZ / 1000))
    edges = np.minimum(np.round(np.arange(count + 1) * 1000 / FRAMES_HZ).astype(int), len(trace))
    ticks = edges[:-1]
    forces = np.maximum.reduceat(force(recording, of_obstacle), ticks)  # the largest of a frame: no peak is lost
    channels = np.column_stack(
        [
            trace["q"][ticks] / Q_UNIT,
            trace["obstacle_position"][ticks, 0] / POSITION_UNIT,
            forces / FORCE_UNIT,
            trace["mode"][ticks],
            trace["link"][ticks],
        ]
    )
    return {
        "controller": recording.controller,
        "frames": count,
        "channels": _encoded(np.clip(np.round(channels), -32768, 32767).astype("<i2")),
        "obstacle": _rounded(recording.obstacle) if recording.obstacle else None,
        "pictureHz": round(1000 / recording.picture_every, 6),
        "cells": [1, 1] if recording.pictures is None else list(recording.pictures.shape[1:]),
        "pictures": None if recording.pictures is None else _encoded(picture_runs(recording.pictures)),
    }


def force(recording: Recording, of_obstacle: bool) -> np.ndarray:
    """Return the force of the obstacle on the arm, or of the task on the tool, (T,), N."""
    if of_obstacle:
        return recording.trace["obstacle_force"]
    return np.linalg.norm(recording.trace["tool_force"], axis=1)


def picture_runs(pictures: np.ndarray) -> np.ndarray:
    """Return pictures, (F, rows, columns), as pairs of a code and of how many cells in a row have it.

    Each picture follows the one before it: 0 stands for a cell that is as it was, else the code is its value + 1.
    """
    flat = pictures.reshape(len(pictures), -1).astype(int) + 1
    codes = np.concatenate([flat[:1], np.where(flat[1:] == flat[:-1], _UNCHANGED, flat[1:])])
    runs: list[int] = []
    for row in codes:
        starts = np.flatnonzero(np.diff(row, prepend=-1))
        lengths = np.diff(starts, append=len(row))
        for code, length in zip(row[starts].tolist(), lengths.tolist(), strict=True):
            while length > 0:
                runs += [code, min(length, _LONGEST)]
                length -= _LONGEST
    return np.array(runs, dtype="<u2")


def _arm(stage: Stage) -> dict:
    """Return frames, each in the one before it, and what is fixed to them, for the film's own forward kinematics."""
    arm, tool = stage.arm, stage.tool
    frames = [_frame(link.position, link.quat) for link in arm.links] + [_frame(arm.mount_position, arm.mount_quat)]
    groups: tuple[tuple[Capsule, ...], ...] = (arm.base_capsules, *(link.capsules for link in arm.links), tool.capsules)
    capsules = [
        {"frame": owner, "start": capsule.start, "end": capsule.end, "radius": capsule.radius}
        for owner, group in enumerate(groups)
        for capsule in group
    ]
    tip = None if tool.tip is None else _rounded(tip_rings(tool))
    return {"frames": frames, "capsules": capsules, "tip": tip}


def _frame(position: Vector3, quat: Quaternion) -> dict:
    return {"position": position, "rotation": [round(x, 9) for x in quat_to_matrix(np.array(quat)).ravel().tolist()]}


def _encoded(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode()


def _rounded(values: Sequence | np.ndarray) -> list:
    return np.round(np.asarray(values, dtype=float), 5).tolist()
