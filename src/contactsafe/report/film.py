"""What the page's film plays: the arm's shape once, and every run as small integers at 60 Hz."""

import base64
import json
import math

import numpy as np

from contactsafe.core.rotation import quat_to_matrix
from contactsafe.report import data
from contactsafe.report.data import Experiment, Recording
from contactsafe.report.scene import INK, INK_RGB, OBJECT, OBJECT_RGB, Subject, fit
from contactsafe.robot.description import Capsule, Quaternion, Vector3

FRAMES_HZ = 60
Q_UNIT, POSITION_UNIT, FORCE_UNIT = 2e-4, 1e-4, 0.05
"""rad, m and N of one step of the film's integers."""

_EMPTY, _LAID, _GONE_AT, _STAYS = 0, 1, 2, 65535
"""A cell of the board: never inked; covered by the object; clean from frame (code − 2) on; never cleaned."""

_FORCES = {"obstacle": "contact force", "tool": "tool force"}


def film_json(experiment: Experiment, subject: Subject) -> str | None:
    """Write the film of an experiment's recordings as JSON for film.js; None where nothing was recorded.

    Args:
        experiment: with recordings.
        subject: arm and board.
    """
    scenes = [_scene(subject, name, data.recorded(experiment, name)) for name in data.scenarios(experiment)]
    scenes = [scene for scene in scenes if scene is not None]
    if not scenes:
        return None
    film = {
        "hz": FRAMES_HZ,
        "units": {"q": Q_UNIT, "position": POSITION_UNIT, "force": FORCE_UNIT},
        "arm": _arm(subject),
        "board": {"corners": _rounded(subject.board_corners()), "ink": INK_RGB, "object": OBJECT_RGB},
        "scenes": scenes,
    }
    return json.dumps(film, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def first_contact(recording: Recording) -> int | None:
    """Give the first tick at which the arm is pressed by an obstacle with 0.5 N; None where it never is."""
    touching = recording.trace["obstacle_force"] > 0.5
    return int(np.argmax(touching)) if touching.any() else None


def _scene(subject: Subject, name: str, recordings: list[Recording]) -> dict | None:
    if not recordings:
        return None
    view = fit(subject, recordings)
    of = "obstacle" if any(recording.obstacle for recording in recordings) else "tool"
    runs = [_run(recording, of) for recording in recordings]
    contacts = [tick for recording in recordings if (tick := first_contact(recording)) is not None]
    return {
        "name": name,
        "force": _FORCES[of],
        "limit": max(1.0, *(_force(recording, of).max() for recording in recordings)),
        "start": round(min(contacts) / 1000 + 0.3, 3) if contacts else 0.0,
        "target": _rounded(view.target),
        "span": _rounded(view.span),
        "azimuth": round(view.azimuth, 4),
        "elevation": round(view.elevation, 4),
        "runs": runs,
    }


def _run(recording: Recording, of: str) -> dict:
    trace = recording.trace
    count = max(1, math.floor(len(trace) * FRAMES_HZ / 1000))
    edges = np.minimum(np.round(np.arange(count + 1) * 1000 / FRAMES_HZ).astype(int), len(trace))
    ticks = edges[:-1]
    force = np.maximum.reduceat(_force(recording, of), ticks)  # the largest of a frame: no peak is lost
    channels = np.column_stack(
        [
            trace["q"][ticks] / Q_UNIT,
            trace["obstacle_position"][ticks, 0] / POSITION_UNIT,
            force / FORCE_UNIT,
            trace["mode"][ticks],
            trace["link"][ticks],
        ]
    )
    return {
        "controller": recording.controller,
        "frames": count,
        "channels": _encoded(np.clip(np.round(channels), -32768, 32767).astype("<i2")),
        "obstacle": _rounded(recording.obstacle) if recording.obstacle else None,
        "boardHz": round(1000 / recording.board_every, 6),
        "cells": list(recording.boards.shape[1:]),
        "ink": _encoded(_ink_runs(recording.boards)),
    }


def _force(recording: Recording, of: str) -> np.ndarray:
    if of == "obstacle":
        return recording.trace["obstacle_force"]
    return np.linalg.norm(recording.trace["tool_force"], axis=1)


def _ink_runs(boards: np.ndarray) -> np.ndarray:
    """Code the fate of every cell of the boards (F, rows, columns), as pairs of code and number of cells in a row."""
    has = boards == INK
    last = len(boards) - 1 - np.argmax(has[::-1], axis=0)
    gone = np.where(last == len(boards) - 1, _STAYS, last + 1 + _GONE_AT)
    cells = np.where(has.any(axis=0), gone, _EMPTY)
    cells = np.where((boards == OBJECT).any(axis=0), _LAID, cells).ravel()
    starts = np.flatnonzero(np.diff(cells, prepend=-1))
    lengths = np.diff(starts, append=len(cells))
    runs: list[int] = []
    for value, length in zip(cells[starts].tolist(), lengths.tolist(), strict=True):
        while length > 0:
            runs += [value, min(length, 65535)]
            length -= 65535
    return np.array(runs, dtype="<u2")


def _arm(subject: Subject) -> dict:
    """Frames, each in the one before it, and what is fixed to them, for the film's own forward kinematics."""
    arm, tool = subject.arm, subject.tool
    frames = [_frame(link.position, link.quat) for link in arm.links] + [_frame(arm.mount_position, arm.mount_quat)]
    groups: tuple[tuple[Capsule, ...], ...] = (arm.base_capsules, *(link.capsules for link in arm.links), tool.capsules)
    capsules = [
        {"frame": owner, "start": capsule.start, "end": capsule.end, "radius": capsule.radius}
        for owner, group in enumerate(groups)
        for capsule in group
    ]
    pad = None
    if tool.pad_half_size is not None:
        x, y, z = tool.tcp
        pad = {"centre": (x, y, z - tool.pad_half_size[2]), "half": tool.pad_half_size}
    return {"frames": frames, "capsules": capsules, "pad": pad}


def _frame(position: Vector3, quat: Quaternion) -> dict:
    return {"position": position, "rotation": [round(x, 9) for x in quat_to_matrix(np.array(quat)).ravel().tolist()]}


def _encoded(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode()


def _rounded(values) -> list:
    return np.round(np.asarray(values, dtype=float), 5).tolist()
