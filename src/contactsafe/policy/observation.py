"""What a policy's network observes: the vectors that a task declares and a latent, each at its scale, as one vector."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.policy.action_config import ActionConfig

MIN_STD = 0.2
"""Least standard deviation by which a latent number is scaled: one that hardly moves would become noise."""


@dataclass(frozen=True)
class Observation:
    """A vector that a task lets its policies observe; an environment lists its own as `observation_vectors`.

    Attributes:
        name: key in the environment's observation.
        centre: what counts as zero, one number for each of the vector's; a number for a scalar.
        scale: what counts as one, likewise.
        unit: of the numbers.
        doc: what they are.
    """

    name: str
    centre: tuple[float, ...] | float
    scale: tuple[float, ...] | float
    unit: str = ""
    doc: str = ""

    def __post_init__(self) -> None:
        """Refuse a centre and a scale of different lengths, and a scale that is not positive."""
        centre, scale = (_numbers(self, name) for name in ("centre", "scale"))
        if not centre or len(centre) != len(scale) or not all(one > 0.0 for one in scale):
            raise InvalidInputError(
                f"observation '{self.name}' has {len(centre)} centres and scales {scale}; give as many "
                "positive scales as centres, one or more"
            )

    @property
    def size(self) -> int:
        """Numbers in the vector."""
        return np.size(self.centre)


def _numbers(observation: Observation, name: str) -> tuple[float, ...]:
    """Return a field as numbers, and keep it so."""
    value = getattr(observation, name)
    try:
        numbers = tuple(float(one) for one in np.atleast_1d(value))
    except (TypeError, ValueError):
        raise InvalidInputError(
            f"observation '{observation.name}' has {name} = {shown(value)}; give a number, or one for each of the "
            "vector's"
        ) from None
    object.__setattr__(observation, name, numbers)
    return numbers


def target_observation(config: ActionConfig) -> Observation:
    """Return how policies observe the target: x_d less the pose, K1 and D1, the gains scaled by their ranges."""
    low, high = (
        np.array([*stiffness, *damping])
        for stiffness, damping in (
            (config.stiffness_low, config.damping_low),
            (config.stiffness_high, config.damping_high),
        )
    )
    return Observation(
        "target",
        centre=(*6 * [0.0], *((low + high) / 2.0).tolist()),
        scale=(0.03, 0.03, 0.01, 0.03, 0.03, 0.03, *((high - low) / 2.0).tolist()),
        unit="m, rad, 1/s², 1/s",
        doc="x_d less the pose, then K1 and D1",
    )


def chosen(vectors: Sequence[Observation], names: Iterable[str]) -> tuple[Observation, ...]:
    """Return the vectors of these names, in the order of the names; all of them where there are no names.

    Raises:
        InvalidInputError: a name is unknown, or stands twice.
    """
    names = tuple(names) or tuple(vector.name for vector in vectors)
    known = {vector.name: vector for vector in vectors}
    if len(set(names)) < len(names) or not set(names) <= set(known):
        raise InvalidInputError(f"observes = {names}; give some of {', '.join(known)}, each once")
    return tuple(known[name] for name in names)


def check_fields(vectors: Sequence[Observation], record: np.dtype) -> None:
    """Refuse observations that are no field of the tasks' records, or one of another size.

    Raises:
        InvalidInputError: one is.
    """
    for vector in vectors:
        if vector.name not in (record.names or ()):
            raise InvalidInputError(
                f"observation '{vector.name}' is no field of the task; declare it in own_fields, or observe one of "
                f"{', '.join(record.names or ())}"
            )
        size = math.prod(record[vector.name].shape)
        if size != vector.size:
            raise InvalidInputError(
                f"observation '{vector.name}' has {vector.size} centres, and the field of that name {size} numbers; "
                "give one for each"
            )


@dataclass(frozen=True)
class ObservationScaling:
    """Fixed scaling of [vectors, latent]; no running statistics that would have to be shipped beside a policy.

    Attributes:
        observes: names of the vectors, in order.
        centre: (k,) subtracted first.
        scale: (k,) divided by.
        clip: largest magnitude afterwards.
    """

    observes: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]
    clip: float = 8.0

    @classmethod
    def from_statistics(
        cls,
        vectors: Sequence[Observation],
        latent_mean: Sequence[float] | np.ndarray = (),
        latent_std: Sequence[float] | np.ndarray = (),
        clip: float = 8.0,
    ) -> "ObservationScaling":
        """Join the vectors' stated scaling with the latent's measured one."""
        centre = [*(c for vector in vectors for c in np.atleast_1d(vector.centre)), *latent_mean]
        std = np.maximum(np.asarray(latent_std, dtype=np.float64), MIN_STD)
        scale = [*(s for vector in vectors for s in np.atleast_1d(vector.scale)), *std]
        names = tuple(vector.name for vector in vectors)
        return cls(names, tuple(float(c) for c in centre), tuple(float(s) for s in scale), clip)

    def __call__(self, observation: Mapping[str, Any], latent: np.ndarray) -> np.ndarray:
        """Scale what N environments observe, (N, j) each, and their latents (N, l): (N, k) float32."""
        raw = np.concatenate([*(np.asarray(observation[name], np.float32) for name in self.observes), latent], axis=1)
        centre, scale = np.asarray(self.centre, np.float32), np.asarray(self.scale, np.float32)
        return np.clip((raw - centre) / scale, -self.clip, self.clip).astype(np.float32)

    def as_dict(self) -> dict[str, Any]:
        """Return centre, scale and clip as plain values."""
        return {"centre": list(self.centre), "scale": list(self.scale), "clip": self.clip}
