"""Where compiled code lies: a folder for each version of the sources, which nobody else can have filled.

What lies in such a folder is code that will be run. So it is used only where nobody else can have put it there, and
only folders made here are ever removed: they have a name of their own and a mark inside.
"""

import atexit
import contextlib
import hashlib
import os
import pathlib
import re
import stat
import sys
import tempfile
import time

import llvmlite
import mujoco
import numba
import numpy as np

_KEPT_VERSIONS = 4
_IN_USE_S = 86400.0  # a version started within the last day may still be at work
_ROOMS = ("core", "robot", "vision", "control", "sim", "policy", "tasks")
"""Where compiled functions call each other across files."""

_PREFIX = "contactsafe-compiled-"
_NAME = re.compile(rf"{_PREFIX}[0-9a-f]{{16}}(-\w+)?")
_MARK = "CACHEDIR.TAG"
_MARKED = (
    "Signature: 8a477f597d28d172789f06886806bc55\n# Compiled by contactsafe, which makes it anew where it is gone.\n"
)
LOCK = "lock"
"""File by which processes take turns."""

_OUR_FILE = re.compile(rf"{_MARK}|{LOCK}|.+\.nb[ic](\.tmp\.\w+)?")

_HANDED_DOWN = "CONTACTSAFE_PRIVATE_CACHE"
"""Environment variable by which processes find the private folder of the one that started them."""


def _digest() -> str:
    """Fingerprint what compiled code depends on: the rooms that compile, numba, llvmlite, NumPy, MuJoCo."""
    versions = (numba.__version__, llvmlite.__version__, np.__version__, mujoco.__version__)
    fingerprint = hashlib.sha256(" ".join(versions).encode())
    root = pathlib.Path(__file__).parents[1]
    for path in (path for room in _ROOMS for path in sorted((root / room).rglob("*.py"))):
        fingerprint.update(path.read_bytes())
    return fingerprint.hexdigest()[:16]


def _cache_folder() -> str:
    """Return this version's folder, under NUMBA_CACHE_DIR or the user's cache, and forget the oldest of the others."""
    name = _PREFIX + _digest()
    try:
        root = _root()
        folder = _claimed(root / name)
        _forget_old(root, _KEPT_VERSIONS)
    except OSError as error:
        return _private_folder(name, error)
    return str(folder)


def _root() -> pathlib.Path:
    """Return the folder for caches, made if need be.

    Raises:
        OSError: there is none, or others may exchange what is in it.
    """
    asked, caches = os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME", "")
    if asked:
        root = pathlib.Path(os.path.expanduser(asked))
    elif os.path.isabs(caches):  # others are to be passed over, says the XDG specification
        root = pathlib.Path(caches)
    else:
        home = pathlib.Path(os.path.expanduser("~"))
        if not (home.is_absolute() and home.is_dir()):
            raise FileNotFoundError("this user has no home folder")
        root = home / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    if str(root).startswith("~"):
        raise FileNotFoundError(f"there is no home folder for {asked}")
    root = root.absolute()
    for folder in reversed([folder for folder in (root, *root.parents) if not folder.exists()]):
        folder.mkdir(mode=0o755, exist_ok=True)  # one by one: `parents` would be of the umask's mode
    root = root.resolve()
    _check_parents(root)
    return root


def _check_parents(root: pathlib.Path) -> None:
    """Refuse a place where somebody else could put another folder in place of ours.

    Where the user's own group may write, as many systems set it up, its members are trusted.
    """
    for folder in (root, *root.parents):
        found = folder.stat()
        foreign = found.st_uid not in (0, os.geteuid()) and folder != folder.parent
        group_writes = found.st_mode & stat.S_IWGRP and found.st_gid not in (0, os.getegid())
        shared = (found.st_mode & stat.S_IWOTH or group_writes) and not found.st_mode & stat.S_ISVTX
        if foreign or shared:
            raise PermissionError(f"others may change {folder}")


def _claimed(folder: pathlib.Path) -> pathlib.Path:
    """Make a folder for compiled code, or take one that is there.

    Raises:
        OSError: somebody else may have put something into it, or it can neither be written nor holds anything.
    """
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=0o755)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise NotADirectoryError(f"{folder} is not a folder")
    refuse_foreign(found, folder)
    try:
        os.utime(folder)
        if not (folder / _MARK).exists():
            with open(folder / _MARK, "w", opener=private_to_write) as file:
                file.write(_MARKED)
    except OSError:
        if not any(folder.rglob("*.nbi")):
            raise
    return folder


def refuse_foreign(found: os.stat_result, path: object) -> None:
    """Refuse what belongs to others, or what they may write to.

    Raises:
        PermissionError: it may have been filled by others.
    """
    if found.st_uid not in (0, os.geteuid()) or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(f"{path} may have been filled by others")


def private_to_write(path: str, flags: int) -> int:
    """Open a file that nobody else may write to, from its first moment on and whatever the umask is."""
    return os.open(path, flags | os.O_CLOEXEC, 0o644)


def _private_folder(name: str, reason: OSError) -> str:
    """Return a folder for this process and those it starts, and say so once."""
    handed = os.environ.get(_HANDED_DOWN)
    if handed == os.devnull:
        return handed
    if handed and pathlib.Path(handed).name.startswith(name):
        with contextlib.suppress(OSError):
            if pathlib.Path(handed).is_dir():
                return str(_claimed(pathlib.Path(handed)))
    try:
        _check_parents(pathlib.Path(tempfile.gettempdir()).resolve())
        folder = _claimed(pathlib.Path(tempfile.mkdtemp(prefix=f"{name}-")))
        _forget_old(folder.parent, 0)
    except OSError:
        os.environ[_HANDED_DOWN] = os.devnull  # under which nothing can be kept
        say_uncached(reason)
        return os.devnull
    os.environ[_HANDED_DOWN] = str(folder)
    owner = os.getpid()
    atexit.register(lambda: _remove(folder) if os.getpid() == owner else None)
    say_uncached(reason)
    return str(folder)


def say_uncached(reason: OSError) -> None:
    """Say once a process, on stderr, why compiled code cannot be kept."""
    if _said:
        return
    _said.append(reason)
    why = f"{reason.filename}: {reason.strerror}" if reason.filename else reason.strerror or reason
    print(
        f"contactsafe: compiled code cannot be kept ({why}), so every run compiles anew; "
        "set NUMBA_CACHE_DIR to a folder that you alone may write to",
        file=sys.stderr,
    )


_said: list[OSError] = []


def _forget_old(root: pathlib.Path, kept: int) -> None:
    """Remove folders of ours that were not used for a day, but for the newest."""
    ours = [(folder.lstat().st_mtime, folder) for folder in root.glob(f"{_PREFIX}*") if _is_ours(folder)]
    for used, folder in sorted(ours, reverse=True)[kept:]:
        if time.time() - used >= _IN_USE_S:
            _remove(folder)


def _is_ours(folder: pathlib.Path) -> bool:
    """Tell whether this user's contactsafe made a folder."""
    try:
        found = folder.lstat()
        return (
            _NAME.fullmatch(folder.name) is not None
            and stat.S_ISDIR(found.st_mode)
            and found.st_uid == os.geteuid()
            and (folder / _MARK).read_bytes() == _MARKED.encode()
        )
    except OSError:
        return False


def _remove(folder: pathlib.Path) -> None:
    """Remove a folder of ours; where anything else has come into it, that stays."""
    for place, _, files in os.walk(folder, topdown=False):
        with contextlib.suppress(OSError):
            for name in filter(_OUR_FILE.fullmatch, files):
                os.unlink(os.path.join(place, name))
            os.rmdir(place)


CACHE_FOLDER = _cache_folder()
