"""What tests of the cache folder and of what lies in it share."""

import os
import tempfile

import pytest

from contactsafe.core import cache_folder


@pytest.fixture
def private(tmp_path, monkeypatch):
    """No cache folder but those under tmp_path, and nothing said or handed down yet; gives where private ones go."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    monkeypatch.setattr(cache_folder, "_said", [])
    monkeypatch.setattr(cache_folder, "_check_parents", lambda root: None)
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", cache_folder._HANDED_DOWN):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(cache_folder, "_digest", lambda: "0123456789abcdef")
    yield tmp_path / "tmp"
    os.environ.pop(cache_folder._HANDED_DOWN, None)
