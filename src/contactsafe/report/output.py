"""Where results go."""

import os
import tempfile
from pathlib import Path

from contactsafe.core.errors import OutputError
from contactsafe.core.files import LOCK, replace

_REMEDY = "give a folder you may write to with --out"


def prepare_output(folder: str | Path) -> Path:
    """Make the folder that results go to and make sure that it can be written; call it before long work.

    Args:
        folder: its path; `~` is the home folder, missing parents are made.

    Returns:
        The folder, absolute.

    Raises:
        OutputError: it cannot be made or written, or holds a training run.
    """
    folder = Path(folder).expanduser()
    if (folder / LOCK).exists():
        raise OutputError(f"{folder} holds a training run; give another folder with --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".contactsafe-", dir=folder)
        os.close(handle)
        os.unlink(name)
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {_reason(error)}; {_REMEDY}") from None
    return folder.resolve()


def write_whole(path: Path, text: str) -> Path:
    """Write a text file, UTF-8, in one step: readers see the old file or the new one.

    Args:
        path: of the file.
        text: its content.

    Raises:
        OutputError: it cannot be written; the file is as it was.
    """
    try:
        replace(path, text.encode())
    except OSError as error:
        raise OutputError(f"cannot write {path}: {_reason(error)}; {_REMEDY}") from None
    return path


def _reason(error: OSError) -> str:
    return (error.strerror or type(error).__name__).lower()
