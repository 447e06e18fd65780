"""How this package compiles: numba, cached on disk under a digest of the sources.

Numba's own cache looks only at the file a function stands in, so a compiled caller goes on using an old callee from
another file after that has changed. Here every version of the sources has a cache folder of its own, `cache_folder`.
"""

import contextlib
import fcntl
import os
import sys
import uuid
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numba
from numba.core import caching, event
from numba.core.errors import NumbaExperimentalFeatureWarning

from contactsafe.core.cache_folder import CACHE_FOLDER, LOCK, private_to_write, refuse_foreign, say_uncached


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
            refuse_foreign(os.stat(self._cache_path), self._cache_path)
            refuse_foreign(os.stat(self._index_path), self._index_path)
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        refuse_foreign(os.stat(path), path)
        return super()._load_data(name)

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        part = f"{filepath}.tmp.{uuid.uuid4().hex[:16]}"
        try:
            with open(part, "xb", opener=private_to_write) as file:
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
            say_uncached(error)


@contextlib.contextmanager
def _locked(kind: int) -> Iterator[None]:
    """Lock CACHE_FOLDER, where that can be done."""
    try:
        handle = os.open(os.path.join(CACHE_FOLDER, LOCK), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
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
    "contactsafe: compiling for this machine, once, for up to a few minutes (`contactsafe warmup` does it beforehand "
    "for all that is shipped)"
)
"""What is said on stderr when the first function has to be compiled; what is in the cache is loaded in silence."""


class _Announcer(event.Listener):
    """Says once a process that it compiles, before it does."""

    said = False

    def on_start(self, event):
        ours = event.data["dispatcher"].py_func.__module__.startswith("contactsafe.")
        if ours and not _Announcer.said and sys.stderr is not None:
            _Announcer.said = True
            print(ANNOUNCEMENT, file=sys.stderr, flush=True)

    def on_end(self, event):
        """Nothing is to be said then."""


def compile_in_silence() -> None:
    """Say nothing when the first function has to be compiled: somebody asked for it."""
    _Announcer.said = True


event.register("numba:compile", _Announcer())

# Where a record has all fields of another and more behind them, what was compiled for that one takes it, as it should.
warnings.filterwarnings("ignore", r"(.|\n)*Record\(", NumbaExperimentalFeatureWarning)
