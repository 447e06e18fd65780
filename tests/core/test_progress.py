"""Progress bars flooded log files with carriage returns; there they are lines, few of them."""

import io
import sys

import pytest

from contactsafe.core import progress
from contactsafe.core.progress import LINE_EVERY_S, progress_bar


class Stream(io.StringIO):
    """What stderr is: a terminal or not."""

    def __init__(self, terminal):
        super().__init__()
        self.terminal = terminal

    def isatty(self):
        return self.terminal


def stderr(monkeypatch, terminal=False):
    """Put a stream in the place of stderr; in the test itself, for pytest puts its own there before each."""
    stream = Stream(terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


class Clock:
    """Seconds that pass when told to."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(progress, "time", made)
    return made


def test_a_log_file_was_flooded_with_carriage_returns(monkeypatch, clock):
    log = stderr(monkeypatch)
    with progress_bar(total=1000, desc="rounds", mininterval=0.0, miniters=1) as bar:
        for _ in range(1000):
            clock.now += 0.1
            bar.update()
    lines = log.getvalue().splitlines(keepends=True)
    assert "\r" not in log.getvalue()
    assert len(lines) == 1 + int(100 / LINE_EVERY_S)
    assert all(line.startswith("rounds: ") and line.endswith("\n") and line.strip() for line in lines)
    assert "1000/1000" in lines[-1]


def test_a_name_that_changes_at_every_step_writes_no_line_of_its_own(monkeypatch, clock):
    log = stderr(monkeypatch)
    with progress_bar(total=3, desc="compiling") as bar:
        for name in ("tick", "worlds", "tasks"):
            bar.set_description_str(name)
            bar.update()
        assert log.getvalue() == ""
    assert log.getvalue().startswith("tasks")
    assert log.getvalue().count("\n") == 1


def test_two_bars_at_once_leave_no_empty_lines(monkeypatch):
    log = stderr(monkeypatch)
    with progress_bar(total=2, desc="outer") as outer:
        for _ in progress_bar(range(2), desc="inner"):
            outer.update()
    assert [line.partition(":")[0] for line in log.getvalue().splitlines()] == ["inner", "outer"]


def test_a_bar_that_shows_nothing_writes_nothing(monkeypatch):
    log = stderr(monkeypatch)
    bar = progress_bar(disable=True)
    bar.update()
    bar.close()
    assert log.getvalue() == ""


def test_in_a_terminal_it_is_one_line_that_is_drawn_again(monkeypatch):
    screen = stderr(monkeypatch, terminal=True)
    with progress_bar(total=20, desc="rounds", mininterval=0.0, miniters=1) as bar:
        for _ in range(20):
            bar.update()
    assert screen.getvalue().count("\r") >= 20
    assert screen.getvalue().count("\n") == 1
