"""Files that are written whole or not at all, and folders that one process at a time writes to."""

import contextlib
import datetime
import errno
import fcntl
import json
import os
import re
import secrets
import socket
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from contactsafe.core.errors import OutputError

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

LOCK = "training.lock"
"""File that is locked while a folder is held; it says by whom, and stays."""

_PART = ".{name}-{token}.part"
_OUR_PART = re.compile(r"\..+-[0-9a-f]{16}\.part")
"""Names of files that are being written, which a killed process leaves behind."""


def write_whole(path: Path, data: bytes) -> None:
    """Write a file under another name beside it, then rename it: readers see the old file or the new one.

    Args:
        path: of the file; its folder exists.
        data: its content.

    Raises:
        OutputError: it cannot be written, as on a full disk; the file is as it was.
    """
    try:
        replace(path, data)
    except OSError as error:
        raise cannot_write(path, error) from None


def replace(path: Path, data: bytes) -> None:
    """Do as `write_whole` does, for callers with words of their own.

    Raises:
        OSError: it cannot be written; the file is as it was.
    """
    part = path.with_name(_PART.format(name=path.name, token=secrets.token_hex(8)))
    try:
        with part.open("xb") as file:  # with the mode that the system gives it: the umask need not be known
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)  # gone already where all went well


def cannot_write(path: object, error: OSError) -> OutputError:
    """Turn an error of the operating system into one line with the remedy."""
    remedy = "make room" if error.errno in _NO_ROOM else "choose a folder you may write to"
    return OutputError(f"cannot write {path}: {error.strerror or error}; {remedy}")


@contextlib.contextmanager
def readable(name: str, text: str) -> Iterator[Path]:
    """Put a text into a temporary file for as long as the block runs, for libraries that read nothing else.

    Raises:
        OutputError: it cannot be written.
    """
    try:
        folder = tempfile.TemporaryDirectory(prefix="contactsafe-")
    except OSError as error:
        raise cannot_write("a temporary file", error) from None
    with folder:
        path = Path(folder.name) / name
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise cannot_write(path, error) from None
        yield path


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder against other processes for as long as the block runs.

    The lock is the operating system's: it ends with the process, however that ends. What a killed process was writing
    is removed.

    Args:
        folder: which is there.

    Raises:
        OutputError: another process holds it, with who that is; or the lock cannot be written.
    """
    path = folder / LOCK
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise cannot_write(path, error) from None
    forked = _Closed(handle)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(
                f"{folder} is in use by {_holder(handle)}; wait for that to end, or give another --out"
            ) from None
        except OSError:
            pass  # a file system without locks: nobody can be kept out, and what is being written is not touched
        else:
            _remove_parts(folder)
        _sign(path, handle)
        yield
    finally:
        forked.close()


class _Closed:
    """A file that children of a fork close at once: they must not hold the lock longer than their parent."""

    def __init__(self, handle: int):
        self._handle, self._open = handle, True
        os.register_at_fork(after_in_child=self.close)

    def close(self) -> None:
        if self._open:
            self._open = False
            os.close(self._handle)


def _sign(path: Path, handle: int) -> None:
    since = datetime.datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
    text = json.dumps({"process": os.getpid(), "host": socket.gethostname(), "since": since}) + "\n"
    try:
        os.ftruncate(handle, 0)
        os.pwrite(handle, text.encode(), 0)
    except OSError as error:
        raise cannot_write(path, error) from None


def _holder(handle: int) -> str:
    """Say who wrote last into a lock that is taken."""
    try:
        found = json.loads(os.pread(handle, 1000, 0))
        who = f"process {int(found['process'])} on {found['host']:.60}, since {found['since']:.30}"
    except (OSError, ValueError, LookupError, TypeError, ArithmeticError, RecursionError):  # as anybody may write it
        return "another process"
    return who if who.isprintable() else "another process"


def _remove_parts(folder: Path) -> None:
    """Remove what was being written in a folder when its holder was killed."""
    with contextlib.suppress(OSError):
        for entry in os.scandir(folder):
            found = entry.stat(follow_symlinks=False)
            ours = _OUR_PART.fullmatch(entry.name) and stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid()
            if ours:
                os.unlink(entry.path)
