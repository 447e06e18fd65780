"""Files written whole or not at all."""

import os
import tempfile
from pathlib import Path

from contactsafe.errors import OutputError

_REMEDY = "give a folder you may write to with --out"


def prepare_output(folder) -> Path:
    """Make the folder that results go to and make sure that it can be written; call it before long work.

    Args:
        folder: its path; `~` is the home folder, missing parents are made.

    Returns:
        The folder, absolute.

    Raises:
        OutputError: it cannot be made or written.
    """
    folder = Path(folder).expanduser()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".contactsafe-", dir=folder)
        os.close(handle)
        os.unlink(name)
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {_reason(error)}; {_REMEDY}") from None
    return folder.resolve()


def write_whole(path: Path, text: str) -> Path:
    """Write a text file under another name beside it, then rename it: readers see the old file or the new one.

    Args:
        path: of the file.
        text: its content, written as UTF-8.

    Raises:
        OutputError: it cannot be written; the file is as it was.
    """
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {_reason(error)}; {_REMEDY}") from None
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)  # gone already where all went well
    return path


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _reason(error: OSError) -> str:
    return (error.strerror or type(error).__name__).lower()
