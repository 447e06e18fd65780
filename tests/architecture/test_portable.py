"""`make portable` plays another processor or says that it cannot; it never quietly tests this one."""

import importlib.util
import os
import pathlib

import pytest

NATIVE = {
    "numba": "znver4 +avx512f", "numpy": "X86_V3 X86_V4", "openblas": "SkylakeX", "torch": "AVX512", "opencv": "AVX2",
    "libm": "0194aa46", "onednn": "Intel AVX-512", "mkl": "OFF",
}  # fmt: skip


@pytest.fixture
def portable(monkeypatch):
    """The program, on a machine whose libraries choose what NATIVE says, whatever this one is."""
    path = pathlib.Path(__file__).parents[2] / "tools" / "portable.py"
    spec = importlib.util.spec_from_file_location("portable", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "X86", True)
    monkeypatch.setattr(module, "GLIBC", True)
    monkeypatch.setattr(module, "has_fma", lambda: True)
    return module


def lowered(settings):
    low = {"numba": "generic", "numpy": "", "openblas": "Nehalem", "torch": "DEFAULT", "opencv": "", "libm": "c47cd655"}
    return NATIVE if not settings else low | {"onednn": "Intel SSE4.1", "mkl": "COMPATIBLE"}


def test_the_command_runs_with_every_library_taken_down(portable, monkeypatch):
    became = []
    monkeypatch.setattr(portable, "ask", lowered)
    monkeypatch.setattr(os, "execvpe", lambda *call: became.append(call))
    portable.main(["pytest", "-k", "x"])
    ((program, command, environment),) = became
    assert (program, command) == ("pytest", ["pytest", "-k", "x"])
    assert environment["NPY_DISABLE_CPU_FEATURES"] == "X86_V3 X86_V4"
    assert environment["NUMBA_CPU_FEATURES"] == ""
    assert "ONEDNN_VERBOSE" not in environment


@pytest.mark.parametrize("library", NATIVE)
def test_a_library_that_does_not_go_down_is_told_and_nothing_runs(portable, library, monkeypatch):
    monkeypatch.setattr(portable, "ask", lambda settings: lowered(settings) | {library: NATIVE[library]})
    monkeypatch.setattr(os, "execvpe", lambda *_: pytest.fail("the command ran"))
    with pytest.raises(SystemExit) as stopped:
        portable.main(["pytest"])
    assert stopped.value.code == (
        f"portable: {library} did not go down; this would test the machine's own instructions"
    )
