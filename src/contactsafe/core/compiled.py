"""How this package compiles: numba, cached on disk under a digest of the sources.

Numba's own cache looks only at the file a function stands in, so a compiled caller goes on using an old callee from
another file after that has changed. Here every version of the sources has a cache folder of its own.

What lies in such a folder is code that will be run. So it is used only where nobody else can have put it there, and
only folders made here are ever removed: they have a name of their own and a mark inside.
"""

import atexit
import contextlib
import fcntl
import hashlib
import os
import pathlib
import re
import stat
import sys
import tempfile
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import caching, event
from numba.core.errors import NumbaExperimentalFeatureWarning

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
_LOCK = "lock"
_OUR_FILE = re.compile(rf"{_MARK}|{_LOCK}|.+\.nb[ic](\.tmp\.\w+)?")

_HANDED_DOWN = "CONTACTSAFE_PRIVATE_CACHE"
"""Environment variable by which processes find the private folder of the one that started them."""


def _digest() -> str:
    """Fingerprint what compiled code depends on: the rooms that compile, numba, llvmlite, NumPy."""
    fingerprint = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {np.__version__}".encode())
    root = pathlib.Path(__file__).parents[1]
    for path in (path for room in _ROOMS for path in sorted((root / room).rglob("*.py"))):
        fingerprint.update(path.read_bytes())
    return fingerprint.hexdigest()[:16]


def _cache_folder() -> str:
    """Give this version's folder, under NUMBA_CACHE_DIR or the user's cache, and forget the oldest of the others."""
    name = _PREFIX + _digest()
    try:
        root = _root()
        folder = _claimed(root / name)
        _forget_old(root, _KEPT_VERSIONS)
    except OSError as error:
        return _private_folder(name, error)
    return str(folder)


def _root() -> pathlib.Path:
    """Give the folder for caches, made if need be.

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
    _refuse_foreign(found, folder)
    try:
        os.utime(folder)
        if not (folder / _MARK).exists():
            with open(folder / _MARK, "w", opener=_private_to_write) as file:
                file.write(_MARKED)
    except OSError:
        if not any(folder.rglob("*.nbi")):
            raise
    return folder


def _refuse_foreign(found: os.stat_result, path: object) -> None:
    if found.st_uid not in (0, os.geteuid()) or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(f"{path} may have been filled by others")


def _private_to_write(path: str, flags: int) -> int:
    """Open a file that nobody else may write to, from its first moment on and whatever the umask is."""
    return os.open(path, flags | os.O_CLOEXEC, 0o644)


def _private_folder(name: str, reason: OSError) -> str:
    """Give a folder for this process and those it starts, and say so once."""
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
        _say_uncached(reason)
        return os.devnull
    os.environ[_HANDED_DOWN] = str(folder)
    owner = os.getpid()
    atexit.register(lambda: _remove(folder) if os.getpid() == owner else None)
    _say_uncached(reason)
    return str(folder)


def _say_uncached(reason: OSError) -> None:
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


class _Locator(getattr(caching, "UserProvidedCacheLocator", None) or caching._UserProvidedCacheLocator):  # type: ignore
    """Where numba keeps the code of a file: under CACHE_FOLDER, and nowhere else if that cannot be written."""

    def ensure_cache_path(self) -> None:
        with contextlib.suppress(FileExistsError):
            os.mkdir(self.get_cache_path(), mode=0o755)

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> Any:
        return cls(py_func, py_file)


class _Files(caching.CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _OwnFiles(caching.IndexDataCacheFile):
    """Numba's files, written so that nobody else may write to them, and read only where nobody else could."""

    def _load_index(self) -> dict:
        with contextlib.suppress(FileNotFoundError):
            _refuse_foreign(os.stat(self._cache_path), self._cache_path)
            _refuse_foreign(os.stat(self._index_path), self._index_path)
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        _refuse_foreign(os.stat(path), path)
        return super()._load_data(name)

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        part = f"{filepath}.tmp.{uuid.uuid4().hex[:16]}"
        try:
            with open(part, "xb", opener=_private_to_write) as file:
                yield file
            os.replace(part, filepath)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(part)
            raise


class _Cache(caching.FunctionCache):
    """Numba's cache, for which neither a full disk nor a damaged file is a reason to stop.

    Index and code of a function are two files; the lock keeps those of one process together.
    """

    _impl_class = _Files

    def __init__(self, function: Callable):
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = _OwnFiles(self._cache_path, self._impl.filename_base, locator.get_source_stamp())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            with _locked(fcntl.LOCK_SH):
                return super().load_overload(sig, target_context)
        except Exception:  # of any kind, as pickle has them: it is compiled anew
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            with _locked(fcntl.LOCK_EX):
                super().save_overload(sig, data)
        except OSError as error:
            _say_uncached(error)


@contextlib.contextmanager
def _locked(kind: int) -> Iterator[None]:
    """Lock CACHE_FOLDER, where that can be done."""
    try:
        handle = os.open(os.path.join(CACHE_FOLDER, _LOCK), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        yield
        return
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, kind)
        yield
    finally:
        os.close(handle)


def compiled(function: Callable | None = None, **options: Any) -> Any:
    """Compile a function with numba in nopython mode, cached; as `@compiled` or `@compiled(nogil=True)`.

    Args:
        function: the function; None when options are given.
        options: of `numba.njit`.
    """
    if function is None:
        return lambda decorated: compiled(decorated, **options)
    dispatcher = numba.njit(function, error_model="numpy", **options)  # nothing in a tick raises, not x / 0 either
    if hasattr(dispatcher, "_cache"):  # it has none where NUMBA_DISABLE_JIT is set
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = CACHE_FOLDER
        try:
            dispatcher._cache = _Cache(function)
        finally:
            numba.config.CACHE_DIR = before
    return dispatcher


def inlined(function: Callable) -> Any:
    """Compile a function into its callers: for stages of a tick, to which an array would be handed over as nine words.

    Args:
        function: called from compiled code, in few places.
    """
    return compiled(function, forceinline=True)


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

# Where a record has all fields of another and more behind them, what was compiled for that one takes it, as it should.
warnings.filterwarnings("ignore", r"(.|\n)*Record\(", NumbaExperimentalFeatureWarning)
