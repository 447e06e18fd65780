"""Compiled code is never older than its sources, and lies where nobody else can have put it."""

import os
import pathlib
import pwd
import shutil
import subprocess
import sys

import numba
import pytest
from tests.core.messages import say_once

from contactsafe.core import cache_folder


@pytest.fixture
def copied_sources(tmp_path, monkeypatch):
    """Let the digest look at a copy of the package."""
    root = tmp_path / "contactsafe"
    shutil.copytree(pathlib.Path(cache_folder.__file__).parents[1], root, ignore=lambda _, names: _not_python(names))
    monkeypatch.setattr(cache_folder, "__file__", str(root / "core/cache_folder.py"))
    return root


def _not_python(names):
    return [name for name in names if ("." in name and not name.endswith(".py")) or name == "__pycache__"]


def test_digest_is_that_of_the_contents(copied_sources):
    assert cache_folder._digest() == cache_folder._digest()
    assert len(cache_folder._digest()) == 16


@pytest.mark.parametrize("file", ["core/linalg.py", "control/laws.py", "core/compiled.py", "sim/stepping.py"])
def test_changing_any_source_changes_the_cache(copied_sources, file):
    """Numba by itself would go on using what it inlined from another file."""
    before = cache_folder._digest()
    (copied_sources / file).write_bytes((copied_sources / file).read_bytes() + b"#")
    assert cache_folder._digest() != before


def test_another_numba_changes_the_cache(copied_sources, monkeypatch):
    before = cache_folder._digest()
    monkeypatch.setattr(numba, "__version__", "0.0")
    assert cache_folder._digest() != before


def version(monkeypatch, number):
    monkeypatch.setattr(cache_folder, "_digest", lambda: f"{number:016x}")
    return pathlib.Path(cache_folder._cache_folder())


def test_cache_folder_is_named_by_the_digest_and_old_ones_go(tmp_path, monkeypatch, private):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(cache_folder, "_IN_USE_S", -1.0)
    for number in range(7):
        folder = version(monkeypatch, number)
        assert folder == tmp_path / "cache" / f"contactsafe-compiled-{number:016x}"
        (folder / "robot_ab").mkdir()
        (folder / "robot_ab" / "f-1.py311.nbi").write_text("")
    assert folder.is_dir()
    assert len(list((tmp_path / "cache").iterdir())) == 4


def test_the_parent_of_a_checkout_named_contactsafe_as_cache_folder_loses_nothing(tmp_path, monkeypatch, private):
    """What lies there may even have our names: without our mark it is somebody else's."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(cache_folder, "_IN_USE_S", -1.0)
    precious = [tmp_path / "contactsafe" / name for name in (".git", "src", "tests")]
    precious += [tmp_path / f"contactsafe-compiled-{digest}" for digest in ("a" * 16, "b" * 16 + "-mine", "notes")]
    for folder in precious:
        folder.mkdir(parents=True)
        (folder / "thesis.tex").write_text("years of work")
        os.utime(folder, (0, 0))
    (tmp_path / f"contactsafe-compiled-{'c' * 16}").symlink_to(precious[0], target_is_directory=True)
    for number in range(9):
        version(monkeypatch, number)
    assert all((folder / "thesis.tex").read_text() == "years of work" for folder in precious)
    assert len(list(tmp_path.glob("contactsafe-compiled-0*"))) == 4


def test_what_somebody_put_into_a_cache_folder_of_ours_stays(tmp_path, monkeypatch, private):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = version(monkeypatch, 0)
    (folder / "thesis.tex").write_text("years of work")
    (folder / "robot_ab").mkdir()
    (folder / "robot_ab" / "f.nbc.tmp.0123").write_text("")
    cache_folder._remove(folder)
    assert [path.name for path in folder.rglob("*")] == ["thesis.tex"]


@pytest.mark.parametrize("spoil", ["mode", "file", "link", "owner"])
def test_a_cache_folder_that_somebody_else_may_have_filled_is_not_used(tmp_path, monkeypatch, private, capsys, spoil):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    folder = tmp_path / "cache" / "contactsafe-compiled-0123456789abcdef"
    folder.parent.mkdir()
    if spoil == "file":
        folder.write_text("not a folder")
    elif spoil == "link":
        (tmp_path / "elsewhere").mkdir()
        folder.symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    else:
        folder.mkdir()
        folder.chmod(0o777 if spoil == "mode" else 0o700)
    if spoil == "owner":
        if os.geteuid() != 0:
            pytest.skip("only root gives folders away")
        os.chown(folder, 65534, 65534)
    chosen = pathlib.Path(cache_folder._cache_folder())
    assert chosen.parent == private
    assert chosen.stat().st_mode & 0o077 == 0
    assert say_once(capsys)
    assert cache_folder._cache_folder() == str(chosen)  # as a worker would find it
    assert capsys.readouterr().err == ""


def test_without_any_folder_every_process_compiles_and_it_is_said_once(monkeypatch, private, capsys):
    monkeypatch.setattr(cache_folder, "_check_parents", lambda root: (_ for _ in ()).throw(PermissionError("shared")))
    assert cache_folder._cache_folder() == os.devnull
    assert say_once(capsys) == "shared"
    monkeypatch.setattr(cache_folder, "_said", [])
    assert cache_folder._cache_folder() == os.devnull  # as a worker would
    assert capsys.readouterr().err == ""
    assert list(private.iterdir()) == []


@pytest.mark.parametrize(("mode", "allowed"), [(0o1777, True), (0o777, False), (0o755, True)])
def test_a_shared_folder_serves_only_where_others_cannot_exchange_what_is_in_it(tmp_path, mode, allowed):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    if allowed:
        cache_folder._check_parents(shared)
        return
    with pytest.raises(PermissionError, match=f"others may change {shared}"):
        cache_folder._check_parents(shared)


@pytest.mark.parametrize("home", [None, "", "~", "relative", "/nowhere/at/all"])
def test_a_user_without_home_gets_no_folder_named_tilde(tmp_path, monkeypatch, private, capsys, home):
    monkeypatch.chdir(private)
    monkeypatch.setattr(pwd, "getpwuid", lambda uid: (_ for _ in ()).throw(KeyError(uid)))
    monkeypatch.delenv("HOME") if home is None else monkeypatch.setenv("HOME", home)
    if home == "" or home == "relative":
        monkeypatch.setattr(pathlib.Path, "mkdir", only_within(tmp_path))
    folder = pathlib.Path(cache_folder._cache_folder())
    assert "home folder" in say_once(capsys) or home == ""
    assert [path.name for path in private.iterdir()] == [folder.name]


def only_within(place):
    mkdir = pathlib.Path.mkdir

    def guarded(self, *args, **options):
        if place not in self.parents:
            raise PermissionError(13, "Permission denied")
        mkdir(self, *args, **options)

    return guarded


def test_a_tilde_in_numba_cache_dir_is_the_home_folder(tmp_path, monkeypatch, private):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "~/mine")
    assert pathlib.Path(cache_folder._cache_folder()).parent == tmp_path / "mine"


def test_a_home_that_cannot_be_written_is_said_once_and_nothing_left(tmp_path):
    """Three processes, one of them spawned; the private folder is gone when the first ends."""
    (tmp_path / "tmp").mkdir()
    (tmp_path / "file").write_text("")
    code = """
import os, subprocess, sys
from contactsafe.core.compiled import CACHE_FOLDER
print(CACHE_FOLDER)
if len(sys.argv) == 1:
    if os.fork() == 0:
        sys.exit()
    os.wait()
    subprocess.run([sys.executable, __file__, "worker"], check=True)
    assert os.path.isdir(CACHE_FOLDER)
"""
    script = tmp_path / "script.py"
    script.write_text(code)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "file"), "TMPDIR": str(tmp_path / "tmp")}
    environment.pop(cache_folder._HANDED_DOWN, None)
    ended = subprocess.run(
        [sys.executable, "-u", str(script)], env=environment, capture_output=True, text=True, timeout=120, check=True
    )
    assert len(ended.stdout.split()) == 2
    assert len(set(ended.stdout.split())) == 1
    assert ended.stderr.count("\n") == 1
    assert list((tmp_path / "tmp").iterdir()) == []
