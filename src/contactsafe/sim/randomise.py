"""What differs from episode to episode: a table not quite where it was, another pad, a camera that was knocked.

A policy that has met all of this carries over to a robot that nobody tuned for it. What is drawn goes into the plant
and into what the camera sees; controller and policy are never told.
"""

from dataclasses import dataclass, fields

import mujoco
import numpy as np

from contactsafe.errors import InvalidInputError

Range = tuple[float, float]


@dataclass(frozen=True)
class Randomisation:
    """Ranges, both ends included, that each episode draws from evenly; the defaults change nothing.

    Attributes:
        board_height_m: of the board above where it is believed to be, m.
        board_tilt_rad: about x, and about y, rad.
        friction: of the pad on the board, as a multiple of the configured one.
        pad_size: edges of the pad, as a multiple of the tool's; both alike.
        camera_m: along x, y and z, by which the camera is not where its calibration says, m.
        camera_rad: about its three axes, likewise, rad.
        ink_missed: share of ink pixels that segmentation misses, anew in every picture.
        ink_invented: pixels of every picture that it takes for ink.
        delay_steps: policy steps by which the picture is late; whole.
        payload_kg: at the tool, unknown to the controller, kg.
        joint_friction: as a multiple of the plant's.
        inertia: masses and inertias of the links, as a multiple of the plant's.
        torque_delay_ticks: ticks between command and effect, 0 or 1.
    """

    board_height_m: Range = (0.0, 0.0)
    board_tilt_rad: Range = (0.0, 0.0)
    friction: Range = (1.0, 1.0)
    pad_size: Range = (1.0, 1.0)
    camera_m: Range = (0.0, 0.0)
    camera_rad: Range = (0.0, 0.0)
    ink_missed: Range = (0.0, 0.0)
    ink_invented: Range = (0.0, 0.0)
    delay_steps: tuple[int, int] = (0, 0)
    payload_kg: Range = (0.0, 0.0)
    joint_friction: Range = (1.0, 1.0)
    inertia: Range = (1.0, 1.0)
    torque_delay_ticks: tuple[int, int] = (0, 0)

    def __post_init__(self):
        """Refuse ranges that are none, or that no world can have."""
        for field in fields(self):
            low, high = getattr(self, field.name)
            least, most = _POSSIBLE.get(field.name, (-np.inf, np.inf))
            if not least <= low <= high <= most:
                raise InvalidInputError(
                    f"randomisation {field.name} = ({low}, {high}); give (low, high) "
                    f"with {least:g} ≤ low ≤ high ≤ {most:g}"
                )

    @classmethod
    def broad(cls) -> "Randomisation":
        """Give the ranges that the shipped policy is trained with."""
        return cls(
            board_height_m=(-0.006, 0.006),
            board_tilt_rad=(-0.015, 0.015),
            friction=(0.6, 1.6),
            pad_size=(0.85, 1.1),
            camera_m=(-0.006, 0.006),
            camera_rad=(-0.006, 0.006),
            ink_missed=(0.0, 0.1),
            ink_invented=(0.0, 0.5),
            delay_steps=(0, 3),
            payload_kg=(-0.1, 0.2),
            joint_friction=(0.5, 1.5),
            inertia=(0.95, 1.05),
            torque_delay_ticks=(0, 1),
        )


MAX_DELAY_STEPS = 6

_POSSIBLE = {
    "board_height_m": (-0.05, 0.05),
    "board_tilt_rad": (-0.1, 0.1),
    "friction": (0.0, 10.0),
    "pad_size": (0.1, 1.5),
    "camera_m": (-0.1, 0.1),
    "camera_rad": (-0.1, 0.1),
    "ink_missed": (0.0, 1.0),
    "ink_invented": (0.0, 1000.0),
    "delay_steps": (0, MAX_DELAY_STEPS),
    "payload_kg": (-0.3, 3.0),
    "joint_friction": (0.0, 10.0),
    "inertia": (0.1, 10.0),
    "torque_delay_ticks": (0, 1),
}

draw_dtype = np.dtype(
    [
        ("board_height_m", float),
        ("board_tilt_rad", float, (2,)),
        ("friction", float),
        ("pad_size", float),
        ("camera", int),  # which of the cameras that stand ready
        ("ink_missed", float),
        ("ink_invented", float),
        ("delay_steps", int),
        ("payload_kg", float),
        ("joint_friction", float),
        ("inertia", float),
        ("torque_delay_ticks", int),
    ]
)
"""What one episode drew."""


def draw(config: Randomisation, cameras: int, rng: np.random.Generator) -> np.ndarray:
    """Draw one episode's world, a `draw_dtype` record, (); `cameras` is how many stand ready."""
    drawn = np.zeros((), dtype=draw_dtype)
    for name in draw_dtype.names or ():
        if name == "camera":
            drawn[name] = rng.integers(cameras)
        elif draw_dtype[name].base.kind == "i":
            drawn[name] = rng.integers(*getattr(config, name), endpoint=True)
        else:
            drawn[name] = rng.uniform(*getattr(config, name), draw_dtype[name].shape)
    return drawn


class Nominal:
    """A plant as it was built, from which every draw starts.

    Args:
        model: of the plant; its own, since draws change it.
        friction: joint friction of the plant record, (n, 3).
        pad_half: half edges of the pad of the plant record, (2,), m.
    """

    def __init__(self, model: mujoco.MjModel, friction: np.ndarray, pad_half: np.ndarray):
        self._model = model
        self._friction, self._pad_half = friction.copy(), pad_half.copy()
        self._board, self._tool = model.body("board").id, model.body("tool").id
        self._links = [i for i in range(model.nbody) if model.body(i).name.startswith("link")]
        self._pad = model.geom("pad").id
        self._kept = {name: getattr(model, name).copy() for name in _CHANGED}

    def apply(self, plant, drawn) -> None:
        """Make the model and the `plant_dtype` record those that were drawn."""
        model = self._model
        for name, value in self._kept.items():
            getattr(model, name)[:] = value
        model.body_pos[self._board, 2] += drawn["board_height_m"]
        mujoco.mju_euler2Quat(model.body_quat[self._board], [*drawn["board_tilt_rad"], 0.0], "xyz")
        model.geom_friction[self._pad, 0] *= drawn["friction"]
        model.geom_size[self._pad, :2] *= drawn["pad_size"]
        model.body_mass[self._links] *= drawn["inertia"]
        model.body_inertia[self._links] *= drawn["inertia"]
        model.body_mass[self._tool] += drawn["payload_kg"]
        plant["friction"] = self._friction
        plant["friction"][:, 0] *= drawn["joint_friction"]
        plant["pad_half"] = self._pad_half * drawn["pad_size"]
        plant["delay_ticks"] = drawn["torque_delay_ticks"]


_CHANGED = ("body_pos", "body_quat", "body_mass", "body_inertia", "geom_friction", "geom_size")
