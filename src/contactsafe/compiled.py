"""How this package compiles: numba, cached on disk under a digest of the sources.

Numba's own cache looks only at the file a function stands in, so a compiled caller goes on using an old callee from
another file after that has changed. Here every version of the sources has a cache folder of its own.
"""

import hashlib
import os
import pathlib
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import event

_KEPT_VERSIONS = 4
_IN_USE_S = 86400.0  # a version started within the last day may still be at work
_ROOMS = ("robot", "control", "sim", "envs")  # where compiled functions call each other across files


def _digest() -> str:
    """Fingerprint what compiled code depends on: the rooms that compile, numba, llvmlite, NumPy."""
    fingerprint = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {np.__version__}".encode())
    root = pathlib.Path(__file__).parent
    for path in [root / "compiled.py", *(path for room in _ROOMS for path in sorted((root / room).rglob("*.py")))]:
        fingerprint.update(path.read_bytes())
    return fingerprint.hexdigest()[:16]


def _cache_folder() -> str:
    """Give this version's folder, under NUMBA_CACHE_DIR or the user's cache, and forget the oldest of the others."""
    home = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    root = pathlib.Path(home) / "contactsafe"
    try:
        folder = root / _digest()
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        if not os.access(folder, os.W_OK):
            raise PermissionError
    except OSError:
        return tempfile.mkdtemp(prefix="contactsafe-")
    versions = sorted((path for path in root.iterdir() if path.is_dir()), key=lambda path: -path.stat().st_mtime)
    for old in versions[_KEPT_VERSIONS:]:
        if time.time() - old.stat().st_mtime < _IN_USE_S:
            continue
        shutil.rmtree(old, ignore_errors=True)
    return str(folder)


CACHE_FOLDER = _cache_folder()


def compiled(function: Callable | None = None, **options: Any) -> Any:
    """Compile a function with numba in nopython mode, cached; as `@compiled` or `@compiled(nogil=True)`.

    Args:
        function: the function; None when options are given.
        options: of `numba.njit`.
    """
    if function is None:
        return lambda decorated: compiled(decorated, **options)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = CACHE_FOLDER
    try:
        return numba.njit(function, cache=True, **options)
    finally:
        numba.config.CACHE_DIR = before


ANNOUNCEMENT = (
    "contactsafe: compiling for this machine, once, for up to a few minutes (`contactsafe warmup` does it ahead)"
)
"""What is said on stderr when the first function has to be compiled; what is in the cache is loaded in silence."""


class _Announcer(event.Listener):
    """Says once a process that it compiles, before it does."""

    said = False

    def on_start(self, event):
        ours = event.data["dispatcher"].py_func.__module__.startswith("contactsafe.")
        if ours and not self.said and sys.stderr is not None:
            self.said = True
            print(ANNOUNCEMENT, file=sys.stderr, flush=True)

    def on_end(self, event):
        """Nothing is to be said then."""


event.register("numba:compile", _Announcer())
