"""The program in a process of its own: any encoding, any pipe, any optimisation, any moment of Ctrl-C."""

import os
import signal
import subprocess
import sys
import time

import pytest

import contactsafe
from contactsafe.core.compiled import ANNOUNCEMENT

SLOWLY = ["evaluate", "--episodes", "100000"]
"""Works until it is stopped."""


def started(*words, flags=(), **options):
    environment = {**os.environ, **options.pop("environment", {})}
    program = [sys.executable, *flags, "-m", "contactsafe", *words]
    return subprocess.Popen(program, env=environment, preexec_fn=_hears_control_c, **options)


def _hears_control_c():
    """Hear it even where a shell that started the tests in its background does not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def outcome_of(process):
    """Wait for a process's end and return its stdout and stderr; leave nothing behind that does not end."""
    try:
        return process.communicate(timeout=120)
    finally:
        process.kill()


def ended(*words, **options):
    """Run the program to its end; return status, stdout and stderr as bytes."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL} | options
    process = started(*words, **options)
    out, err = outcome_of(process)
    return process.returncode, out, err


def shell(script):
    """Run a shell's line in which `$it` is the program; return the status and stderr."""
    environment = {**os.environ, "it": f"{sys.executable} -m contactsafe"}
    done = subprocess.run(["sh", "-c", script], env=environment, capture_output=True, timeout=300)
    return done.returncode, done.stderr


def test_the_installed_program_says_its_version():
    assert ended("--version") == (0, f"contactsafe {contactsafe.__version__}\n".encode(), b"")


@pytest.mark.parametrize("encoding", ["cp1252", "latin-1:strict", "ascii"])
def test_an_encoding_without_a_character_shows_another_and_no_traceback(encoding):
    environment = {"PYTHONIOENCODING": encoding}
    for words, shown in ((["evaluate", "--help"], b"{mujoco,pybullet}"), (["train", "--help"], b"?-VAE;")):
        status, out, err = ended(*words, environment=environment)
        assert (status, err) == (0, b"")
        assert shown in out


def test_a_progress_bar_and_files_in_an_encoding_without_their_characters(tmp_path):
    words = ["experiment", "disturbance", "--trials", "1", "--controllers", "vices,safe", "--out", str(tmp_path)]
    locale = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    status, out, err = ended(*words, environment=locale)
    assert status == 0, err
    assert (out + err).isascii()
    assert b"disturbance" in err
    assert "✓" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "taught"),
    [
        (["--help"], ["Let a policy do its task in episodes it has never seen."]),
        (["experiment", "--help"], ["somebody leans on the arm", "seeds tried with each controller."]),
    ],
)
def test_help_teaches_without_docstrings(words, taught):
    status, out, err = ended(*words, flags=["-OO"])
    assert (status, err) == (0, b"")
    assert all(text in out.decode() for text in taught)


def test_help_of_training_teaches_without_docstrings():
    pytest.importorskip("torch")
    status, out, _ = ended("train", "ppo", "--help", flags=["-OO"])
    assert status == 0
    for text in ("Settings of PPO", "passes over a rollout.", "environments side by side."):  # its own and its base's
        assert text in out.decode()


@pytest.mark.skipif(os.name != "posix", reason="POSIX shells and signals")
class TestStreams:
    """What becomes of the other end of stdout and stderr."""

    def test_a_reader_that_has_gone_ends_it_quietly(self):
        for words in (["experiment", "--help"], ["evaluate", "--episodes", "1"]):
            read, write = os.pipe()
            os.close(read)
            status, _, err = ended(*words, stdout=write)
            os.close(write)
            assert status == 128 + signal.SIGPIPE
            assert b"Traceback" not in err
            assert b"BrokenPipe" not in err
            assert b"Exception" not in err

    @pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
    def test_a_full_disk_is_told_in_one_line_and_fails(self):
        with open("/dev/full", "wb") as full:
            status, _, err = ended("evaluate", "--help", stdout=full)
        assert status == 1
        told = b"contactsafe: cannot write to standard output: no space left on device; give it another place\n"
        assert err == told

    @pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
    def test_a_result_is_not_lost_where_stderr_cannot_be_written(self):
        with open("/dev/full", "wb") as full:
            status, out, _ = ended("evaluate", "--episodes", "1", stderr=full)
        assert status == 0
        assert b"return_mean" in out

    @pytest.mark.parametrize(
        ("script", "expected"),
        [
            ("$it --help >&-", 0),
            ("$it --help <&- >&- 2>&-", 0),
            ("$it dance >&- 2>&-", 2),
        ],
    )
    def test_closed_streams_are_done_without(self, script, expected):
        assert shell(script) == (expected, b"")


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
class TestSignals:
    """Signals at any moment."""

    @pytest.mark.parametrize("after_s", [0.4, 1.0, 2.0, 3.0])
    def test_control_c_stops_with_130_and_one_line_whenever_it_comes(self, after_s):
        self.stop(signal.SIGINT, after_s, b"contactsafe: stopped")

    def test_control_c_stops_while_numba_compiles(self, tmp_path):
        self.stop(signal.SIGINT, 4.0, b"contactsafe: stopped", {"NUMBA_CACHE_DIR": str(tmp_path)})

    def test_termination_ends_with_143_and_one_line(self):
        self.stop(signal.SIGTERM, 2.0, b"contactsafe: terminated")

    def stop(self, number, after_s, told, environment=None):
        process = started(
            *SLOWLY,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            environment=environment or {},
            start_new_session=True,
        )
        time.sleep(after_s)
        process.send_signal(number)
        out, err = outcome_of(process)
        besides = (b"", ANNOUNCEMENT.encode())  # said before what compiles
        lines = [
            line for line in err.replace(b"\r", b"\n").splitlines() if line not in besides and b"episodes" not in line
        ]
        assert (process.returncode, out, lines) == (128 + number, b"", [told])

    def test_a_program_that_imports_the_package_keeps_its_signal_handlers(self):
        code = "import signal; before = signal.getsignal(2); import contactsafe; assert signal.getsignal(2) is before"
        assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0
