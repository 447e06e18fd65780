"""Compiled code is kept, mended where it is damaged, and not run where others may have written it."""

import os
import pathlib
import pickle
import runpy
import subprocess
import sys

import pytest
from numba.core import caching
from tests.core.messages import say_once

from contactsafe.core import cache_folder, compiled


def small(tmp_path, monkeypatch, folder):
    """Compile a function anew, cached in a folder."""
    monkeypatch.setattr(compiled, "CACHE_FOLDER", str(folder))
    source = tmp_path / "small.py"
    source.write_text("def double(x):\n    return 2 * x\n")
    double = runpy.run_path(str(source))["double"]
    return compiled.compiled(double)


def test_a_full_disk_while_compiling_is_said_once_and_stops_nothing(tmp_path, monkeypatch, private, capsys):
    def full(*_):
        raise OSError(28, "No space left on device", "f.nbc")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    for _ in range(2):
        function = small(tmp_path, monkeypatch, tmp_path)
        assert function(21) == 42
    assert say_once(capsys) == "f.nbc: No space left on device"


def test_a_damaged_cache_is_compiled_anew_and_mended(tmp_path, monkeypatch, private):
    cache = tmp_path / "cache"
    cache.mkdir()
    assert small(tmp_path, monkeypatch, cache)(21) == 42
    for damaged in (*cache.rglob("*.nbi"), *cache.rglob("*.nbc")):
        damaged.write_bytes(damaged.read_bytes()[:50])
    again = small(tmp_path, monkeypatch, cache)
    assert again(21) == 42
    assert not again.stats.cache_hits
    assert small(tmp_path, monkeypatch, cache)(21) == 42
    third = small(tmp_path, monkeypatch, cache)
    third(21)
    assert third.stats.cache_hits


@pytest.fixture
def no_umask():
    """As in many containers."""
    before = os.umask(0)
    yield
    os.umask(before)


def test_compiled_code_could_be_overwritten_by_anybody_where_the_umask_is_0(tmp_path, monkeypatch, private, no_umask):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "some" / "where"))
    folder = pathlib.Path(cache_folder._cache_folder())
    assert small(tmp_path, monkeypatch, folder)(21) == 42
    written = [tmp_path / "some", *(tmp_path / "some").rglob("*")]
    assert {"where", "lock", "CACHEDIR.TAG"} < {path.name for path in written}
    assert {".nbi", ".nbc"} < {path.suffix for path in written}
    assert [path for path in written if path.stat().st_mode & 0o022] == []


class Planted:
    """What runs when it is unpickled."""

    def __reduce__(self):
        return exec, ("raise SystemExit('foreign code has run')",)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("mode", [0o666, 0o664, 0o646])
def test_code_that_others_may_have_written_is_not_run_but_made_anew(tmp_path, monkeypatch, private, suffix, mode):
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o755)
    small(tmp_path, monkeypatch, cache)(21)
    (planted,) = cache.rglob(f"*.{suffix}")
    planted.write_bytes(pickle.dumps(Planted()))
    planted.chmod(mode)
    again = small(tmp_path, monkeypatch, cache)
    assert again(21) == 42
    assert not again.stats.cache_hits
    assert [path for path in cache.rglob("*.nb*") if path.stat().st_mode & 0o022] == []
    third = small(tmp_path, monkeypatch, cache)
    assert third(21) == 42
    assert third.stats.cache_hits


def test_code_in_a_folder_that_others_may_write_to_is_not_run(tmp_path, monkeypatch, private, capsys):
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o755)
    small(tmp_path, monkeypatch, cache)(21)
    (index,) = cache.rglob("*.nbi")
    index.write_bytes(pickle.dumps(Planted()))
    index.parent.chmod(0o777)
    assert small(tmp_path, monkeypatch, cache)(21) == 42
    assert say_once(capsys) == f"{index.parent} may have been filled by others"


def test_a_cache_that_can_only_be_read_is_read(tmp_path, monkeypatch, private, capsys):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = pathlib.Path(cache_folder._cache_folder())
    (folder / "robot_ab").mkdir()
    (folder / "robot_ab" / "f-1.py311.nbi").write_text("")
    monkeypatch.setattr(os, "utime", lambda path: (_ for _ in ()).throw(OSError(30, "Read-only file system")))
    assert cache_folder._cache_folder() == str(folder)
    assert capsys.readouterr().err == ""


def test_many_processes_that_start_at_once_share_one_cache(tmp_path):
    code = """
import sys
from contactsafe.core import cache_folder, compiled
sys.path.insert(0, sys.argv[1])
import small  # by name: what one process kept, another finds its module by
function = compiled.compiled(small.double)
assert function(21) == 42 and function(0.5) == 1.0 and function(1j) == 2j
"""
    (tmp_path / "small.py").write_text("def double(x):\n    return 2 * x\n")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", code, str(tmp_path)]
    started = [subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    for process in started:
        _, told = process.communicate(timeout=120)
        assert (process.returncode, told) == (0, "")
    (index,) = tmp_path.rglob("*.nbi")
    assert len(list(index.parent.glob("*.nbc"))) == 3


def test_every_compiled_function_is_cached_there():
    from contactsafe.control.tick import control_tick
    from contactsafe.robot.dynamics import update_dynamics

    for function in (control_tick, update_dynamics):
        assert pathlib.Path(compiled.CACHE_FOLDER) in pathlib.Path(function._cache.cache_path).parents
