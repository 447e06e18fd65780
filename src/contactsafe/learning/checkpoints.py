"""Files that are whole or absent, and training that goes on where it stopped.

Checkpoints are the trainer's own and local; what is shipped is a bundle. They are still read with torch's
`weights_only`, which takes tensors and plain Python values and runs no code.
"""

import dataclasses
import json
import os
import random
import tempfile
from pathlib import Path

import numpy as np
import torch

from contactsafe.errors import InvalidInputError, OutputError

CHECKPOINT = "checkpoint.pt"

NOT_TAKEN_OVER = ("out", "resume", "max_minutes")
"""Settings that a run which goes on does not take over from the session before."""


def write_atomically(path, write):
    """Let write(temporary path) make a file, then put it in place of path in one step.

    Args:
        path: where the file shall be; its folder exists.
        write: called with the path of a temporary file in the same folder.

    Raises:
        OutputError: the folder cannot be written to.
    """
    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(handle)
        try:
            write(name)
            os.chmod(name, 0o644)
            os.replace(name, path)
        finally:
            Path(name).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}; choose a folder you may write to") from error


def write_json(path, value):
    """Write plain data as indented JSON, atomically."""
    text = json.dumps(value, indent=1, default=str) + "\n"
    write_atomically(path, lambda name: Path(name).write_text(text, encoding="utf-8"))


def prepare_folder(out, resume):
    """Make the folder of a run, or find the one to go on with, and make sure that it can be written to.

    Args:
        out: the folder.
        resume: whether to go on from the checkpoint in it.

    Returns:
        The folder as a Path.

    Raises:
        OutputError: it holds a run already and resume is false, or it cannot be made or written to.
        InvalidInputError: resume is true and there is no checkpoint.
    """
    out = Path(out)
    if resume and not (out / CHECKPOINT).is_file():
        raise InvalidInputError(f"no {CHECKPOINT} in {out} to resume from; leave --resume out to start anew")
    if not resume and (out / CHECKPOINT).exists():
        raise OutputError(f"{out} holds a training run already; give --resume to go on with it, or another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise OutputError(f"cannot write to {out}: {error.strerror}; choose a folder you may write to") from error
    return out


def save_checkpoint(out, state):
    """Write state (tensors and plain values, nested) as the checkpoint of the run in out, atomically."""
    write_atomically(Path(out) / CHECKPOINT, lambda name: torch.save(state, name))


def load_checkpoint(out):
    """Read the checkpoint of the run in out.

    Raises:
        InvalidInputError: it is not a checkpoint this version can read.
    """
    path = Path(out) / CHECKPOINT
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:
        raise InvalidInputError(f"{path} cannot be read as a checkpoint; start anew with another --out") from error


def pack(state):
    """Turn nested plain values and arrays into one text and one tensor.

    A snapshot of 16 worlds has 500 arrays: a tensor each, they take torch.save 25 ms; packed, 5.
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
    """Give back what was packed."""
    data, ends = packed["data"].numpy(), packed["ends"]

    def take(value):
        if set(value) != {"dtype", "shape", "piece"}:
            return value
        start, stop = ends[value["piece"] - 1 : value["piece"] + 1]
        return data[start:stop].copy().view(value["dtype"]).reshape(value["shape"])

    return json.loads(packed["text"], object_hook=take)


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
    check_unchanged(saved, {name: value for name, value in plain(config).items() if name not in may_differ})


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
            yield f"{within}{name} = {before}, now it is {value}"


def as_started(config):
    """Give the settings of the last session of the run in config.out, but for NOT_TAKEN_OVER.

    Where there is no such run they are those given.

    Args:
        config: settings of the kind that the run was started with, a dataclass.

    Raises:
        InvalidInputError: its checkpoint cannot be read.
    """
    if not (Path(config.out) / CHECKPOINT).is_file():
        return config
    state = load_checkpoint(config.out)
    if state.get("algorithm") != getattr(config, "algorithm", None):
        return config
    kept = {name: value for name, value in state.get("config", {}).items() if name not in NOT_TAKEN_OVER}
    return _replaced(config, kept)


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


def restore_random_state(state):
    """Set the generators to what `random_state` collected."""
    torch.set_rng_state(state["torch"])
    kind, keys, position, has_gauss, gauss = state["numpy"]
    np.random.set_state((kind, np.array(keys, dtype=np.uint32), position, has_gauss, gauss))
    version, internal, gauss_next = state["python"]
    random.setstate((version, tuple(internal), gauss_next))
