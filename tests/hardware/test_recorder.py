"""What the flight recorder writes: whole, by anybody's reader, and whatever was killed."""

import errno
import time

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware import heartbeats
from contactsafe.hardware.exchange import TICKS, Exchange
from contactsafe.hardware.messages import row_dtype, step_dtype
from contactsafe.hardware.recorder import Recorder, record
from contactsafe.hardware.run_log import STEPS_TOPIC, TICKS_TOPIC, is_run, read_run, ros_schema

RUN = {"robot": "fr3", "task": "wiping"}


@pytest.fixture
def exchange():
    made = Exchange.create(7)
    yield made
    made.unlink()


def put(exchange, count, seed=0):
    """Put ticks of random numbers into the ring."""
    rng, status = np.random.default_rng(seed), exchange.status
    for _ in range(count):
        number = int(status["rows"][0])
        row = exchange.ticks[number % TICKS]
        row["tick"], row["stamp"] = number, time.time_ns()
        for name in ("q", "qd", "torque"):
            row["reading"][name] = rng.standard_normal(7)
        row["output"]["point"] = np.nan
        row["output"]["rotation"] = rng.standard_normal((3, 3))
        status["rows"] += 1


def test_every_tick_comes_back_bit_by_bit(exchange, tmp_path):
    written = Recorder(exchange, tmp_path / "run.mcap", RUN)
    put(exchange, 300)
    exchange.steps[0]["shown"] = 17
    exchange.status["steps_written"] = 1
    written.drain()
    put(exchange, 50, seed=1)
    written.drain()
    written.finish()
    run, rows = read_run(tmp_path / "run.mcap", row_dtype(7))
    assert run == RUN
    assert rows.tobytes() == exchange.ticks[:350].tobytes()
    assert read_run(tmp_path / "run.mcap", step_dtype(), STEPS_TOPIC)[1]["shown"].tolist() == [17]
    assert exchange.status["dropped"][0] == 0


def test_a_reader_that_knows_nothing_of_contactsafe_finds_the_numbers_by_their_names(exchange, tmp_path):
    """Foxglove's own library, by the ROS 2 message definition in the file."""
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    written = Recorder(exchange, tmp_path / "run.mcap", RUN)
    put(exchange, 20)
    written.drain()
    written.finish()
    with open(tmp_path / "run.mcap", "rb") as file:
        messages = list(
            reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages(
                topics=[TICKS_TOPIC]
            )
        )
    assert len(messages) == 20
    for k, (_, _, _, message) in enumerate(messages):
        row = exchange.ticks[k]
        assert message.tick == k
        assert np.array_equal(message.reading.q, row["reading"]["q"])
        assert np.array_equal(message.output.rotation, row["output"]["rotation"].ravel())


def test_a_file_that_was_never_finished_is_read_up_to_its_end(exchange, tmp_path):
    written = Recorder(exchange, tmp_path / "run.mcap", RUN)
    put(exchange, 100)
    written.drain()
    _, rows = read_run(tmp_path / "run.mcap", row_dtype(7))
    assert len(rows) == 100
    whole = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) - 700])
    _, rows = read_run(tmp_path / "cut.mcap", row_dtype(7))
    assert 98 <= len(rows) < 100


def test_a_recorder_that_is_too_slow_leaves_ticks_out_and_counts_them(exchange, tmp_path):
    written = Recorder(exchange, tmp_path / "run.mcap", RUN)
    put(exchange, 10)
    exchange.status["rows"] = 3 * TICKS
    written.drain()
    assert exchange.status["dropped"][0] > TICKS
    assert exchange.status["recorded"][0] == 3 * TICKS


def test_a_full_disk_ends_the_log_and_not_the_run(exchange, capfd):
    """/dev/full refuses every write."""
    from pathlib import Path

    exchange.status["finished"] = 0
    record(str(exchange.path), Path("/dev/full"), RUN)
    assert exchange.status["recorder_errno"][0] == errno.ENOSPC
    assert exchange.status["stop"][0] == 0
    assert "the run goes on without a log" in capfd.readouterr().out


def test_it_ends_when_nobody_is_left(exchange, tmp_path, monkeypatch):
    monkeypatch.setattr(heartbeats, "_ALONE_S", 0.1)
    record(str(exchange.path), tmp_path / "run.mcap", RUN)
    assert read_run(tmp_path / "run.mcap", row_dtype(7))[0] == RUN


def test_what_is_no_run_is_told_from_one(tmp_path):
    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\0" * 50)
    assert not is_run(tmp_path / "other.mcap")
    with pytest.raises(InvalidInputError, match="no run that this version"):
        read_run(tmp_path / "other.mcap", row_dtype(7))


def test_the_message_definition_names_every_field_once_and_nested_ones_behind(exchange):
    text = ros_schema(row_dtype(7), "Tick")
    head, *nested = text.split("=" * 80)
    assert "contactsafe/Reading reading" in head
    assert "int64 tick" in head
    assert len(nested) == 4  # reading, measurement, target, output
    assert all(line.islower() for line in head.splitlines() if line.startswith(("float64", "int64")))
