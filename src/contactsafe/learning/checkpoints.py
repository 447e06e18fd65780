"""Training that goes on where it stopped: checkpoints, sealed with a digest and checked before any of it is used.

Checkpoints are the trainer's own and local; what is shipped is a bundle. They are still read with torch's
`weights_only`, which takes tensors and plain Python values and runs no code, and compared with what the run that reads
them would itself have written.
"""

import contextlib
import dataclasses
import hashlib
import io
import json
import math
import os
import random
import re
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from contactsafe.core.errors import InvalidInputError, OutputError, shown
from contactsafe.core.files import held, write_whole
from contactsafe.learning.checking import CheckpointError, check_tensor, kind_of, part, whole

CHECKPOINT = "checkpoint.pt"

NOT_TAKEN_OVER = ("out", "resume", "max_minutes")
"""Settings that a run which goes on does not take over from the session before."""

MAX_BYTES = 2**32
"""Largest checkpoint that is read."""

_SEAL = "contactsafe checkpoint sha256 {}\n"
_SEALED = re.compile(rb"contactsafe checkpoint sha256 ([0-9a-f]{64})\n")


def write_json(path, value):
    """Write plain data as indented JSON, in one step.

    Raises:
        OutputError: it cannot be written; the file is as it was.
    """
    write_whole(Path(path), (json.dumps(value, indent=1, default=str) + "\n").encode())


@contextlib.contextmanager
def run_folder(out, resume) -> Iterator[Path]:
    """Make the folder of a run, or find the one to go on with, and hold it for as long as the block runs.

    Args:
        out: the folder.
        resume: whether to go on from the checkpoint in it.

    Yields:
        The folder as a Path.

    Raises:
        OutputError: another process trains in it, it holds a run already and resume is false, or it cannot be made or
            written to.
        InvalidInputError: resume is true and there is no checkpoint.
    """
    out = Path(out)
    if resume and not os.path.isfile(out / CHECKPOINT):
        raise InvalidInputError(f"no {CHECKPOINT} in {out} to resume from; leave --resume out to start anew")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise OutputError(f"cannot write to {out}: {error.strerror}; choose a folder you may write to") from error
    with held(out):
        if not resume and (out / CHECKPOINT).exists():
            raise OutputError(f"{out} holds a training run already; give --resume to go on with it, or another --out")
        yield out


def save_checkpoint(out, state):
    """Write state (tensors and plain values, nested) as the checkpoint of the run in out, in one step.

    Raises:
        OutputError: it cannot be written; the checkpoint before is whole.
    """
    body = io.BytesIO()
    torch.save(state, body)
    data = body.getvalue()
    write_whole(Path(out) / CHECKPOINT, _SEAL.format(hashlib.sha256(data).hexdigest()).encode() + data)


def load_checkpoint(out):
    """Read the checkpoint of the run in out, once it is known to be the one that was written.

    Raises:
        InvalidInputError: it is damaged, or not a checkpoint of this version.
    """
    path = Path(out) / CHECKPOINT
    try:
        with path.open("rb") as file:
            seal, data = file.readline(200), file.read(MAX_BYTES)
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror}; check who may read it") from None
    sealed = _SEALED.fullmatch(seal)
    if sealed is None:
        raise InvalidInputError(f"{path} cannot be read as a checkpoint; start anew with another --out")
    if sealed[1].decode() != hashlib.sha256(data).hexdigest():
        raise InvalidInputError(f"{path} is damaged (its SHA-256 differs); start anew with another --out")
    try:
        _check_archive(data)
        state = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except Exception as error:
        raise InvalidInputError(f"{path} cannot be read as a checkpoint; start anew with another --out") from error
    if not isinstance(state, dict):
        raise InvalidInputError(f"{path} holds {shown(state)}; start anew with another --out")
    return state


@contextlib.contextmanager
def refused_as(out):
    """Say of which run it is that a checkpoint holds what cannot be."""
    try:
        yield
    except CheckpointError as error:
        raise InvalidInputError(
            f"{Path(out) / CHECKPOINT} is damaged: {error}; start anew with another --out"
        ) from None


def _check_archive(data):
    """Refuse an archive whose parts are more than the file: torch stores them as they are."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = archive.infolist()
    if any(part.compress_type != zipfile.ZIP_STORED for part in parts) or sum(p.file_size for p in parts) > len(data):
        raise ValueError("compressed")


def pack(state):
    """Turn nested plain values and arrays into one text and one tensor.

    The state of 16 worlds has 500 arrays: a tensor each, they take torch.save 25 ms; packed, 5.
    """
    pieces = [b""]

    def stow(value):
        if isinstance(value, dict):
            return {name: stow(inner) for name, inner in value.items()}
        if isinstance(value, list):
            return [stow(inner) for inner in value]
        if not isinstance(value, np.ndarray):
            return value
        pieces.append(value.tobytes())
        return {"dtype": value.dtype.str, "shape": value.shape, "piece": len(pieces) - 1}

    text = json.dumps(stow(state))
    return {"text": text, "ends": np.cumsum([len(piece) for piece in pieces]).tolist(), "data": _tensor(pieces)}


def unpack(packed):
    """Give back what was packed.

    Raises:
        CheckpointError: it was not packed here.
    """
    text, ends, tensor = part(packed, "text", str), part(packed, "ends", list), part(packed, "data", torch.Tensor)
    if tensor.dtype != torch.uint8 or tensor.ndim != 1 or not tensor.is_contiguous():
        raise CheckpointError(f"its data are {kind_of(tensor)} of shape {tuple(tensor.shape)}")
    data = tensor.numpy()
    if not all(type(end) is int for end in ends) or ends != sorted(ends) or not 0 <= min(ends, default=0):
        raise CheckpointError(f"the ends of its pieces are {shown(ends)}")

    def unstow(value):
        if set(value) != {"dtype", "shape", "piece"}:
            return value
        piece, shape = whole(value, "piece", len(ends) - 1), part(value, "shape", list)
        kind = part(value, "dtype", str)
        if not _NUMBERS.fullmatch(kind) or not all(type(size) is int and size >= 0 for size in shape):
            raise CheckpointError(f"it holds an array of {shown(kind)} and shape {shown(shape)}")
        piece = data[ends[piece - 1] : ends[piece]] if piece else data[:0]
        if len(piece) != math.prod(shape) * np.dtype(kind).itemsize:
            raise CheckpointError(f"it holds {len(piece)} bytes for an array of {shown(kind)} and shape {shown(shape)}")
        return piece.copy().view(kind).reshape(shape)

    try:
        return json.loads(text, object_hook=unstow)
    except (ValueError, RecursionError) as error:
        if isinstance(error, CheckpointError):
            raise
        raise CheckpointError("its text is not JSON") from None


_NUMBERS = re.compile(r"[<|=][biuf][1248]")
"""Types of the arrays that are packed."""


def _tensor(pieces):
    return torch.frombuffer(bytearray(b"".join([*pieces, b"\0"])), dtype=torch.uint8)


def check_same_config(saved, config, may_differ):
    """Refuse to go on with other settings than the run was started with.

    Args:
        saved: the settings kept in the checkpoint, as from `plain`.
        config: the settings now, a dataclass.
        may_differ: names of fields which may change between sessions.

    Raises:
        InvalidInputError: a field differs.
    """
    check_unchanged(_settings(saved), {name: value for name, value in plain(config).items() if name not in may_differ})


def _settings(saved):
    """Give saved settings, once they are known to be plain values."""
    try:
        json.dumps(saved)
    except (TypeError, ValueError, RecursionError):
        raise CheckpointError(f"config is {shown(saved)}") from None
    if not isinstance(saved, dict):
        raise CheckpointError(f"config is {shown(saved)}")
    return saved


def check_unchanged(saved, now):
    """Refuse to go on where any of nested plain settings is not what was saved.

    Raises:
        InvalidInputError: naming all that differ.
    """
    changed = list(_changes(saved, now))
    if changed:
        raise InvalidInputError(
            f"the run was started with {'; '.join(changed)}; keep the setting, or start anew with another --out"
        )


def _changes(saved, now, within=""):
    """Name what differs of nested settings, one phrase each."""
    for name, value in now.items():
        before = saved.get(name)
        if isinstance(value, dict) and isinstance(before, dict):
            yield from _changes(before, value, f"{within}{name}.")
        elif before != value:
            yield f"{within}{name} = {_plainly(before)}, now it is {value}"


def _plainly(value):
    return shown(value) if isinstance(value, str | list | dict) and len(str(value)) > 80 else value


def as_started(config):
    """Give the settings of the last session of the run in config.out, but for NOT_TAKEN_OVER.

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
        kept = _settings(part(state, "config", dict))
        try:
            return _replaced(config, {name: value for name, value in kept.items() if name not in NOT_TAKEN_OVER})
        except (TypeError, ValueError, InvalidInputError):
            raise CheckpointError("its settings are not settings of such a run") from None


def _replaced(config, values):
    """Replace fields of a dataclass by what `plain` made of them."""

    def typed(now, value):
        if dataclasses.is_dataclass(now):
            return _replaced(now, value)
        return type(now)(value) if isinstance(now, tuple | Path) else value

    known = [field.name for field in dataclasses.fields(config) if field.name in values]
    return dataclasses.replace(config, **{name: typed(getattr(config, name), values[name]) for name in known})


def plain(config):
    """Turn a dataclass into nested dicts and lists of plain values, as JSON would hold it."""
    return json.loads(json.dumps(dataclasses.asdict(config), default=str))


def random_state():
    """Collect the state of Python's, NumPy's and torch's global random generators."""
    kind, keys, position, has_gauss, gauss = np.random.get_state(legacy=True)
    version, internal, gauss_next = random.getstate()
    return {
        "torch": torch.get_rng_state(),
        "numpy": [kind, np.asarray(keys).tolist(), int(position), int(has_gauss), float(gauss)],
        "python": [version, list(internal), gauss_next],
    }


def check_random_state(state):
    """Refuse what `random_state` cannot have collected: the generators use the positions in it unseen.

    Raises:
        CheckpointError: naming the generator.
    """
    for name, now in random_state().items():
        found = part(state, name, type(now))
        if name == "torch":
            check_tensor(found, now, "random.torch")
            fits = _is_torch_state(found)
        elif len(found) != len(now) or found[0] != now[0] or not isinstance(found[1], list):
            fits = False
        elif name == "numpy":
            fits = _is_twister(found[1], found[2]) and _fits(found[3:])
        else:
            *keys, position = found[1] or [None]
            fits = _is_twister(keys, position) and _fits(found[2:])
        if not fits:
            raise CheckpointError(f"random.{name} is not a state of its generator")


def _is_twister(keys, position):
    """Tell whether numbers are a state of the Mersenne Twister."""
    return (
        isinstance(keys, list)
        and len(keys) == 624
        and all(type(key) is int and 0 <= key < 2**32 for key in keys)
        and type(position) is int
        and 0 <= position <= 624
    )


def _fits(values):
    """Tell whether values are finite numbers or None, as generators keep a normal number for the next time."""
    return all(value is None or (isinstance(value, int | float) and math.isfinite(value)) for value in values)


def _is_torch_state(state):
    try:
        torch.Generator().set_state(state)
    except RuntimeError:
        return False
    return True


def restore_random_state(state):
    """Set the generators to what `random_state` collected."""
    torch.set_rng_state(state["torch"])
    kind, keys, position, has_gauss, gauss = state["numpy"]
    np.random.set_state((kind, np.array(keys, dtype=np.uint32), position, has_gauss, gauss))
    version, internal, gauss_next = state["python"]
    random.setstate((version, tuple(internal), gauss_next))
