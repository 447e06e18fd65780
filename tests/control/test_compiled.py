"""Compiled code is never older than its sources."""

import pathlib
import shutil

import numba
import pytest

from contactsafe import compiled


@pytest.fixture
def copied_sources(tmp_path, monkeypatch):
    """Let the digest look at a copy of the package."""
    root = tmp_path / "contactsafe"
    shutil.copytree(pathlib.Path(compiled.__file__).parent, root, ignore=lambda _, names: _not_python(names))
    monkeypatch.setattr(compiled, "__file__", str(root / "compiled.py"))
    return root


def _not_python(names):
    return [name for name in names if ("." in name and not name.endswith(".py")) or name == "__pycache__"]


def test_digest_is_that_of_the_contents(copied_sources):
    assert compiled._digest() == compiled._digest()
    assert len(compiled._digest()) == 16


@pytest.mark.parametrize("file", ["robot/linalg.py", "control/laws.py", "compiled.py", "sim/stepping.py"])
def test_changing_any_source_changes_the_cache(copied_sources, file):
    """Numba by itself would go on using what it inlined from another file."""
    before = compiled._digest()
    (copied_sources / file).write_bytes((copied_sources / file).read_bytes() + b"#")
    assert compiled._digest() != before


def test_another_numba_changes_the_cache(copied_sources, monkeypatch):
    before = compiled._digest()
    monkeypatch.setattr(numba, "__version__", "0.0")
    assert compiled._digest() != before


def test_cache_folder_is_named_by_the_digest_and_old_ones_go(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiled, "_IN_USE_S", -1.0)
    folders = []
    for version in range(7):
        monkeypatch.setattr(compiled, "_digest", lambda version=version: f"version{version}")
        folder = pathlib.Path(compiled._cache_folder())
        assert folder == tmp_path / "contactsafe" / f"version{version}"
        folders.append(folder)
    assert folder.is_dir()
    assert len(list((tmp_path / "contactsafe").iterdir())) == 4


def test_folder_that_cannot_be_written_is_replaced(tmp_path, monkeypatch):
    taken = tmp_path / "file"
    taken.write_text("not a folder")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(taken))
    folder = pathlib.Path(compiled._cache_folder())
    assert folder.is_dir()
    assert tmp_path not in folder.parents
    folder.rmdir()


def test_every_compiled_function_is_cached_there():
    from contactsafe.control.tick import control_tick
    from contactsafe.robot.dynamics import update_dynamics

    for function in (control_tick, update_dynamics):
        assert pathlib.Path(compiled.CACHE_FOLDER) in pathlib.Path(function._cache.cache_path).parents
