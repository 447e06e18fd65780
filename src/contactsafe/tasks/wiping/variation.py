"""Worlds that differ from episode to episode: what was sampled goes into plant, camera and pictures."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from contactsafe.core.byte_scan import copy_picture, places_unlike
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.state import Entry, check_state_dict, load_state_dict, of_array, state_dict
from contactsafe.robot.mjcf import TIP_GEOM
from contactsafe.sim.sensing import fill_friction
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks.wiping.board import Camera
from contactsafe.tasks.wiping.camera import INK_PIXEL, OTHER_PIXEL, camera_tables, stack_cameras
from contactsafe.tasks.wiping.randomisation import MAX_DELAY_STEPS, POSSIBLE, Randomisation, sample, sampled_dtype
from contactsafe.tasks.wiping.whiteboards import Whiteboards

CAMERAS = 16
"""Cameras that stand ready: tables of one take 10 ms to compute, so episodes choose among them."""

_CHANGED = ("body_pos", "body_quat", "body_mass", "body_inertia", "geom_friction", "geom_size")


class Variation(Independent):
    """Samples what differs and makes it so.

    Args:
        worlds: each with a model of its own.
        boards: in them.
        ranges: that every episode samples.

    Attributes:
        sampled: `sampled_dtype` records of the episodes that run, (n,).
    """

    def __init__(self, worlds: Worlds, boards: Whiteboards, ranges: Randomisation):
        _refuse_too_light(worlds, ranges)
        self._worlds, self._boards, self._ranges = worlds, boards, ranges
        self.sampled = np.zeros(worlds.n, dtype=sampled_dtype)
        self._plants = [_Plant(worlds, boards, i) for i in range(worlds.n)]
        # Their places are the same in every run: a run that goes on must find them again.
        rng = np.random.default_rng(0)
        cameras = [_perturbed(boards.camera_config, ranges, rng) for _ in range(CAMERAS)]
        boards.cameras = stack_cameras([camera_tables(c, boards.boards[0], worlds.models[0]) for c in cameras])
        self._frames = np.full((worlds.n, MAX_DELAY_STEPS + 1, *boards.masks.shape[1:]), OTHER_PIXEL, dtype=np.uint8)
        self._newest = np.zeros(worlds.n, dtype=np.int64)
        self._random = np.ones(worlds.n, dtype=np.uint64)

    def sample(self, i: int, rng: np.random.Generator) -> None:
        """Sample anew for world i; reset it next."""
        self.sampled[i] = sample(self._ranges, CAMERAS, rng)
        self._random[i] = rng.integers(1, 2**63)
        self._apply(i)

    def look(self, start: int, stop: int) -> None:
        """Take the masks of worlds start to stop as they are, and put what the policy sees of them in their place."""
        _look(start, stop, self.sampled, self._boards.masks, self._frames, self._newest, self._random)

    def look_first(self, i: int) -> None:
        """The same, as if what is seen had been there for long."""
        _corrupt(self._boards.masks[i], self.sampled[i : i + 1], self._random[i : i + 1])
        self._frames[i] = self._boards.masks[i]

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the future."""
        return {
            "sampled": Entry(self._read_sampled, self._write_sampled, self._check_sampled),
            "frames": of_array(self._frames),
            "newest": of_array(self._newest, 0, MAX_DELAY_STEPS),
            "random": of_array(self._random.view(np.int64), -np.inf, np.inf),
        }

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the future."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load the worlds' models; their state is loaded by the worlds, after this."""
        load_state_dict(self.state_entries(), state)

    def _read_sampled(self) -> dict[str, np.ndarray]:
        return {name: self.sampled[name].copy() for name in sampled_dtype.names or ()}

    def _write_sampled(self, value: Mapping[str, np.ndarray]) -> None:
        for name in sampled_dtype.names or ():
            self.sampled[name] = value[name]
        for i in range(self._worlds.n):
            self._apply(i)

    def _check_sampled(self, value: Mapping[str, np.ndarray]) -> None:
        possible = {"camera": (0, CAMERAS - 1), **POSSIBLE}
        # Before the first episode all are 0.
        entries = {
            name: of_array(self.sampled[name], min(low, 0), high)
            for name, (low, high) in possible.items()
            if name in (sampled_dtype.names or ())
        }
        check_state_dict(entries, value)

    def _apply(self, i: int) -> None:
        self._boards.records[i]["camera"] = self.sampled[i]["camera"]
        self._boards.boards[i].changed = True  # as another camera sees it
        self._plants[i].apply(self.sampled[i])


def _refuse_too_light(worlds: Worlds, ranges: Randomisation) -> None:
    """Refuse to take more off a tool than its mass."""
    tool, (low, high) = worlds.arm.tool, ranges.payload_kg
    if tool is not None and low < 0.0 and low <= -tool.inertia.mass:
        raise InvalidInputError(
            f"randomisation payload_kg = ({low}, {high}) takes more than the {tool.inertia.mass:.2g} kg of tool "
            f"'{tool.name}'; give (0.0, {high})"
        )


def _perturbed(camera: Camera, ranges: Randomisation, rng: np.random.Generator) -> Camera:
    """Sample where a camera really stands and looks; turning it moves what it looks at."""
    moved, turned = rng.uniform(*ranges.camera_m, 3), rng.uniform(*ranges.camera_rad, 3)
    position = np.array(camera.position) + moved
    axis = np.array(camera.target) + moved - position
    axis = axis + np.cross(turned, axis)
    return replace(camera, position=tuple(position.tolist()), target=tuple((position + axis).tolist()))


class _Plant:
    """One world's plant as it was built, from which every episode starts."""

    def __init__(self, worlds: Worlds, boards: Whiteboards, i: int):
        # Not the records themselves: a copy of this would keep the old ones.
        self._worlds, self._boards, self._i = worlds, boards, i
        model, errors = worlds.models[i], worlds.records[i]["errors"]
        self._friction, self._drag = errors["friction"].copy(), errors["drag"].copy()
        self._pad_half = boards.records[i]["pad_half"].copy()
        self._delay = int(errors["delay_ticks"])
        self._board, self._tool, self._pad = model.body("workbench").id, model.body("tool").id, model.geom(TIP_GEOM).id
        self._links = [k for k in range(model.nbody) if model.body(k).name.startswith("link")]
        self._kept = {name: getattr(model, name).copy() for name in _CHANGED}

    def apply(self, sampled) -> None:
        """Make model and record those that were sampled."""
        model, errors = self._worlds.models[self._i], self._worlds.records[self._i]["errors"]
        for name, value in self._kept.items():
            getattr(model, name)[:] = value
        model.body_pos[self._board, 2] += sampled["board_height_m"]
        mujoco.mju_euler2Quat(model.body_quat[self._board], [*sampled["board_tilt_rad"], 0.0], "xyz")
        model.geom_friction[self._pad, 0] *= sampled["friction"]
        model.geom_size[self._pad, :2] *= sampled["pad_size"]
        model.body_mass[self._links] *= sampled["inertia"]
        model.body_inertia[self._links] *= sampled["inertia"]
        model.body_mass[self._tool] += sampled["payload_kg"]
        fill_friction(errors, self._friction, self._drag, sampled["joint_friction"])
        self._boards.records[self._i]["pad_half"] = self._pad_half * sampled["pad_size"]
        errors["delay_ticks"] = max(self._delay, sampled["torque_delay_ticks"])


@compiled(nogil=True)
def _look(start, stop, sampled, masks, frames, newest, random):
    for i in range(start, stop):
        _corrupt(masks[i], sampled[i : i + 1], random[i : i + 1])
        count = frames.shape[1]
        newest[i] = (newest[i] + 1) % count
        copy_picture(masks[i], frames[i, newest[i]])
        if sampled[i].delay_steps > 0:
            copy_picture(frames[i, (newest[i] - sampled[i].delay_steps) % count], masks[i])


@compiled(nogil=True)
def _corrupt(mask, sampled, random):
    """Miss some ink pixels of a mask and invent others."""
    missed, invented = sampled[0].ink_missed, sampled[0].ink_invented
    flat = mask.reshape(-1)
    if missed > 0.0:
        inked = np.empty(flat.shape[0], dtype=np.int32)
        for p in inked[: places_unlike(flat, np.uint8(OTHER_PIXEL), inked)]:
            if _uniform(random) < missed:
                flat[p] = OTHER_PIXEL
    for _ in range(int(invented + _uniform(random))):
        flat[int(_uniform(random) * flat.shape[0])] = INK_PIXEL


@compiled
def _uniform(random):
    """Sample from [0, 1): xorshift64* of Vigna 2016; its state is `random`, (1,) uint64."""
    x = random[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    random[0] = x
    return ((x * np.uint64(2685821657736338717)) >> np.uint64(11)) * (1.0 / 9007199254740992.0)
