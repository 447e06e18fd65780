"""Files are whole or as they were, whatever fails; a folder has one holder."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from contactsafe.core.errors import OutputError, shown
from contactsafe.core.files import LOCK, held, readable, write_whole

HOLD = """
import pathlib, signal, sys
from contactsafe.core.files import held
with held(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    signal.pause()
"""


def test_a_file_is_written_with_the_users_permissions(tmp_path):
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "file", b"new")
    finally:
        os.umask(before)
    assert (tmp_path / "file").read_bytes() == b"new"
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o640
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_files_that_threads_write_meanwhile_do_not_become_writable_for_all(tmp_path, monkeypatch):
    """The umask of the process was 0 for a moment, to be read."""
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail(f"the umask was set to {mask}"))
    write_whole(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"new"


def test_a_file_size_limit_leaves_the_old_file_whole(tmp_path):
    """RLIMIT_FSIZE fails as a full disk does, but anybody can set it."""
    write_whole(tmp_path / "file", b"old")
    code = """
import pathlib, resource, sys
from contactsafe.core.errors import OutputError
from contactsafe.core.files import readable, write_whole
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
for write in (lambda: write_whole(pathlib.Path(sys.argv[1]), bytes(2000)), readable("big", "x" * 2000).__enter__):
    try:
        write()
    except OutputError as error:
        print(error)
"""
    command = [sys.executable, "-c", code, str(tmp_path / "file")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    whole, big = ended.stdout.splitlines()
    assert whole == f"cannot write {tmp_path}/file: File too large; make room"
    assert big.endswith("/big: File too large; make room")
    assert (tmp_path / "file").read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_folder_that_is_not_there_is_told_with_the_remedy(tmp_path):
    with pytest.raises(OutputError) as error:
        write_whole(tmp_path / "no" / "file", b"")
    expected = f"cannot write {tmp_path}/no/file: No such file or directory; choose a folder you may write to"
    assert str(error.value) == expected


def test_a_temporary_file_is_there_while_it_is_read(tmp_path):
    with readable("arm.urdf", "<robot/>") as path:
        assert path.read_text() == "<robot/>"
    assert not path.parent.exists()


@pytest.fixture
def holder(tmp_path):
    """A process that holds a folder until it is killed."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_the_second_holder_is_refused_and_told_who_the_first_is(tmp_path, holder):
    with pytest.raises(OutputError) as error, held(tmp_path):
        pass
    who = json.loads((tmp_path / LOCK).read_text())
    assert who["process"] == holder.pid
    assert str(error.value) == (
        f"{tmp_path} is in use by process {holder.pid} on {who['host']}, since {who['since']}; "
        "wait for that to end, or give another --out"
    )


def test_a_holder_that_was_killed_holds_nothing(tmp_path, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    with held(tmp_path):
        assert json.loads((tmp_path / LOCK).read_text())["process"] == os.getpid()


KILLED_WRITING = """
import os, pathlib, signal, sys
from contactsafe.core.files import held, write_whole
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
with held(pathlib.Path(sys.argv[1])):
    write_whole(pathlib.Path(sys.argv[1]) / "checkpoint.pt", bytes(1000))
"""


def test_what_a_killed_training_was_writing_is_gone_when_the_folder_is_held_again(tmp_path):
    """Each kill left a checkpoint under a hidden name, for ever; what is not ours stays."""
    others = [".checkpoint.pt-mine.part", "checkpoint.pt-0123456789abcdef.part", ".notes-20261125", ".part"]
    for name in others:
        (tmp_path / name).write_text("years of work")
    (tmp_path / ".folder-0123456789abcdef.part").mkdir()
    (tmp_path / ".link-0123456789abcdef.part").symlink_to(others[0])
    others += [".folder-0123456789abcdef.part", ".link-0123456789abcdef.part", LOCK]
    ended = subprocess.run([sys.executable, "-c", KILLED_WRITING, str(tmp_path)], timeout=60, check=False)
    assert ended.returncode == -signal.SIGKILL
    (left,) = {path.name for path in tmp_path.iterdir()} - set(others)
    assert left.startswith(".checkpoint.pt-")
    with held(tmp_path):
        assert {path.name for path in tmp_path.iterdir()} == set(others)


def test_what_the_holder_is_writing_is_not_taken_away_by_one_that_is_refused(tmp_path, holder):
    part = tmp_path / ".checkpoint.pt-0123456789abcdef.part"
    part.write_text("half")
    with pytest.raises(OutputError), held(tmp_path):
        pass
    assert part.read_text() == "half"


def test_the_same_process_is_refused_as_well_and_may_hold_again_later(tmp_path):
    with held(tmp_path), pytest.raises(OutputError, match=f"in use by process {os.getpid()} on "), held(tmp_path):
        pass
    with held(tmp_path):
        pass


def test_children_of_a_killed_holder_do_not_hold_for_it(tmp_path):
    """A worker that was forked outlives the training that was killed."""
    code = HOLD.replace("    print", "    if os.fork() == 0:\n        time.sleep(60)\n    print").replace(
        "import pathlib", "import os, pathlib, time"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        assert process.stdout.readline() == "held\n"
        time.sleep(0.2)  # for the child to have closed it
        process.kill()
        process.wait()
        with held(tmp_path):
            pass
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.stdout.close()


NONSENSE = ("", "[" * 500, "[" * 1000, '{"process": ' * 83, '{"process": 1e999}', "\xff", '{"process": 1, "host": []}',
    '{"process": 1, "host": "a\\nb", "since": "now"}', '{"process": 1, "host": 1, "since": "\\u001b[2J"}')  # fmt: skip


@pytest.mark.parametrize("text", NONSENSE)
def test_a_lock_that_says_nonsense_is_told_without_a_traceback(tmp_path, holder, text):
    (tmp_path / LOCK).write_text(text, encoding="latin-1")
    with pytest.raises(OutputError, match=r"is in use by another process; wait"), held(tmp_path):
        pass


def test_a_lock_that_is_a_link_to_somebodys_file_is_not_written_to(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    (tmp_path / LOCK).symlink_to("thesis.tex")
    with pytest.raises(OutputError, match=f"^cannot write {tmp_path}/{LOCK}: "), held(tmp_path):
        pass
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


class Hostile:
    def __repr__(self):
        raise RuntimeError


WILD = ("9" * 900_000, 10**5000, [[]] * 10_000, {"a" * 1000: 1}, Hostile(), b"x" * 10_000, "a\nb" * 100, 1e308)


@pytest.mark.parametrize("value", WILD, ids=[type(value).__name__ for value in WILD])
def test_whatever_was_found_is_shown_in_one_short_line(value):
    assert "\n" not in shown(value)
    assert len(shown(value)) <= 80


def test_what_is_short_is_shown_whole():
    assert [shown(value) for value in (99, "60", ["pose", "truth"], {"amplitude": 2.0}, float("nan"))] == [
        "99", "'60'", "['pose', 'truth']", "{'amplitude': 2.0}", "nan",
    ]  # fmt: skip
