"""Training that goes on where it stopped: checkpoints, sealed with a digest and checked before any of it is used.

Checkpoints are the trainer's own and local; what is shipped is a bundle. They are still read with torch's
`weights_only`, which takes tensors and plain Python values and runs no code, and compared with what the run that reads
them would itself have written.
"""

import contextlib
import hashlib
import io
import json
import os
import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch

from contactsafe.core.errors import InvalidInputError, OutputError, shown
from contactsafe.core.files import LOCK, held, write_whole
from contactsafe.learning.checking import CheckpointError

CHECKPOINT = "checkpoint.pt"

MAX_BYTES = 2**32
"""Largest checkpoint that is read."""

_SEAL = "contactsafe checkpoint sha256 {}\n"
_SEALED = re.compile(rb"contactsafe checkpoint sha256 ([0-9a-f]{64})\n")


def write_json(path: Path | str, value: Any) -> None:
    """Write plain data as indented JSON, in one step.

    Raises:
        OutputError: it cannot be written; the file is as it was.
    """
    write_whole(Path(path), (json.dumps(value, indent=1, default=str) + "\n").encode())


@contextlib.contextmanager
def run_folder(out: Path | str, resume: bool) -> Iterator[Path]:
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
    made = not out.exists()
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
        try:
            yield out
        except InvalidInputError:
            if made and os.listdir(out) == [LOCK]:  # refused before anything was done
                shutil.rmtree(out)
            raise


def save_checkpoint(out: Path | str, state: dict[str, Any]) -> None:
    """Write state (tensors and plain values, nested) as the checkpoint of the run in out, in one step.

    Raises:
        OutputError: it cannot be written; the checkpoint before is whole.
    """
    body = io.BytesIO()
    torch.save(state, body)
    data = body.getvalue()
    write_whole(Path(out) / CHECKPOINT, _SEAL.format(hashlib.sha256(data).hexdigest()).encode() + data)


def load_checkpoint(out: Path | str) -> dict[str, Any]:
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
def refused_as(out: Path | str) -> Iterator[None]:
    """Say of which run it is that a checkpoint holds what cannot be."""
    try:
        yield
    except CheckpointError as error:
        raise InvalidInputError(
            f"{Path(out) / CHECKPOINT} is damaged: {error}; start anew with another --out"
        ) from None


def _check_archive(data: bytes) -> None:
    """Refuse an archive whose files are more than it: torch stores them as they are."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = archive.infolist()
    stored = all(file.compress_type == zipfile.ZIP_STORED for file in files)
    if not stored or sum(file.file_size for file in files) > len(data):
        raise ValueError("compressed")
