"""Settings of a run: as plain values, compared with those it was started with, and taken over by a later session."""

import dataclasses
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.learning.checking import CheckpointError, entry
from contactsafe.learning.checkpoints import CHECKPOINT, load_checkpoint, refused_as


class _Runs(Protocol):
    """Settings of a run, which name its folder."""

    @property
    def out(self) -> Path:
        """The folder."""
        ...


Config = TypeVar("Config", bound=_Runs)

NOT_TAKEN_OVER = ("out", "resume", "max_minutes")
"""Settings that a run which goes on does not take over from the session before."""


def check_same_config(saved: Any, config: Any, may_differ: Sequence[str]) -> None:
    """Refuse to go on with other settings than the run was started with.

    Args:
        saved: the settings kept in the checkpoint, as from `plain`.
        config: the settings now, a dataclass.
        may_differ: names of fields which may change between sessions.

    Raises:
        InvalidInputError: a field differs.
    """
    check_unchanged(_settings(saved), {name: value for name, value in plain(config).items() if name not in may_differ})


def _settings(saved: Any) -> dict[str, Any]:
    """Return saved settings, once they are known to be plain values."""
    try:
        json.dumps(saved)
    except (TypeError, ValueError, RecursionError):
        raise CheckpointError(f"config is {shown(saved)}") from None
    if not isinstance(saved, dict):
        raise CheckpointError(f"config is {shown(saved)}")
    return saved


def check_unchanged(saved: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse to go on where any of nested plain settings is not what was saved.

    Raises:
        InvalidInputError: naming all that differ.
    """
    changed = list(_changes(saved, now))
    if changed:
        raise InvalidInputError(
            f"the run was started with {'; '.join(changed)}; keep the setting, or start anew with another --out"
        )


def _changes(saved: Mapping[str, Any], now: Mapping[str, Any], within: str = "") -> Iterator[str]:
    """Name what differs of nested settings, one phrase each."""
    for name, value in now.items():
        before = saved.get(name)
        if isinstance(value, dict) and isinstance(before, dict):
            yield from _changes(before, value, f"{within}{name}.")
        elif before != value:
            yield f"{within}{name} = {_plainly(before)}, now it is {value}"


def _plainly(value: Any) -> Any:
    return shown(value) if isinstance(value, str | list | dict) and len(str(value)) > 80 else value


def as_started(config: Config) -> Config:
    """Return the settings of the last session of the run in config.out, but for NOT_TAKEN_OVER.

    Where there is no such run they are those given.

    Args:
        config: settings of the kind that the run was started with, a dataclass.

    Raises:
        InvalidInputError: its checkpoint cannot be read.
    """
    if not os.path.isfile(Path(config.out) / CHECKPOINT):
        return config
    state = load_checkpoint(config.out)
    if state.get("algorithm") != getattr(config, "algorithm", None):
        return config
    with refused_as(config.out):
        kept = _settings(entry(state, "config", dict))
        try:
            return _replaced(config, {name: value for name, value in kept.items() if name not in NOT_TAKEN_OVER})
        except (TypeError, ValueError, InvalidInputError):
            raise CheckpointError("its settings are not settings of such a run") from None


def _replaced(config: Any, values: Mapping[str, Any]) -> Any:
    """Replace fields of a dataclass by what `plain` made of them."""

    def typed(now: Any, value: Any) -> Any:
        if dataclasses.is_dataclass(now):
            return _replaced(now, value)
        return type(now)(value) if isinstance(now, tuple | Path) and value is not None else value

    known = [field.name for field in dataclasses.fields(config) if field.name in values]
    return dataclasses.replace(config, **{name: typed(getattr(config, name), values[name]) for name in known})


def plain(config: Any) -> dict[str, Any]:
    """Turn a dataclass into nested dicts and lists of plain values, as JSON would hold it."""
    return json.loads(json.dumps(dataclasses.asdict(config), default=str))
