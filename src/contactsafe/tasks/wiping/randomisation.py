"""What differs from episode to episode: height and tilt of the table, pad, camera, plant.

A policy that has met all of this carries over to a robot that nobody tuned for it. What is sampled goes into the plant
and into what the camera sees; controller and policy are never told.
"""

from dataclasses import dataclass, fields

import numpy as np

from contactsafe.core.errors import InvalidInputError

Range = tuple[float, float]


@dataclass(frozen=True)
class Randomisation:
    """Ranges, both ends included, that each episode samples evenly; the defaults change nothing.

    Attributes:
        board_height_m: of the board above where it is believed to be, m.
        board_tilt_rad: about x, and about y, rad.
        friction: of the pad on the board, as a multiple of the configured one.
        pad_size: edges of the pad, as a multiple of the tool's; both alike.
        camera_m: along x, y and z, by which the camera is not where its calibration says, m.
        camera_rad: about its three axes, likewise, rad.
        ink_missed: fraction of ink pixels that segmentation misses, anew in every picture.
        ink_invented: pixels of every picture that it takes for ink.
        delay_steps: policy steps by which the picture is late; whole.
        payload_kg: at the tool, of which the controller knows nothing, kg.
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

    def __post_init__(self) -> None:
        """Refuse ranges that are none, or that no world can have."""
        for field in fields(self):
            low, high = getattr(self, field.name)
            least, most = POSSIBLE.get(field.name, (-np.inf, np.inf))
            if not least <= low <= high <= most:
                raise InvalidInputError(
                    f"randomisation {field.name} = ({low}, {high}); give (low, high) "
                    f"with {least:g} ≤ low ≤ high ≤ {most:g}"
                )

    @classmethod
    def broad(cls) -> "Randomisation":
        """Return the ranges that the shipped policy is trained with."""
        return cls(
            board_height_m=(-0.005, 0.005),
            board_tilt_rad=(-0.012, 0.012),
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

POSSIBLE = {
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

sampled_dtype = np.dtype(
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


def sample(config: Randomisation, cameras: int, rng: np.random.Generator) -> np.ndarray:
    """Sample one episode's world, a `sampled_dtype` record, (); `cameras` is how many stand ready."""
    sampled = np.zeros((), dtype=sampled_dtype)
    for name in sampled_dtype.names or ():
        low, high = (0, cameras - 1) if name == "camera" else getattr(config, name)
        whole = sampled_dtype[name].base.kind == "i"
        sampled[name] = (
            rng.integers(low, high, endpoint=True) if whole else rng.uniform(low, high, sampled_dtype[name].shape)
        )
    return sampled
