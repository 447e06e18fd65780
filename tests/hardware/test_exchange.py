"""The shared memory of a run: the same for all who open it, and nobody else's."""

import stat

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.messages import as_words, message_dtype, row_dtype, seen_dtype, step_dtype
from contactsafe.hardware.states import ASKED, TIME_UP


@pytest.fixture
def exchange():
    made = Exchange.create(7)
    yield made
    made.unlink()


def test_what_one_process_writes_the_other_sees(exchange):
    other = Exchange(exchange.path)
    exchange.status["tick"], exchange.targets[3], exchange.ticks[5]["sent"] = 12, 7, np.arange(7.0)
    exchange.steps[2]["shown"] = 9
    assert other.joints == 7
    assert other.status["tick"][0] == 12
    assert other.targets[3] == 7
    assert (other.ticks[5]["sent"] == np.arange(7.0)).all()
    assert other.steps[2]["shown"] == 9


def test_nobody_else_may_read_it(exchange):
    assert stat.S_IMODE(exchange.path.stat().st_mode) == 0o600


def test_nothing_is_left_after_it_is_unlinked_and_unlinking_twice_does_no_harm(exchange):
    exchange.unlink()
    exchange.unlink()
    assert not exchange.path.exists()


def test_the_first_reason_to_stop_stays(exchange):
    exchange.ask_to_stop(TIME_UP)
    exchange.ask_to_stop(ASKED)
    assert exchange.status["stop"][0] == TIME_UP


def test_a_file_that_is_none_is_refused_in_one_line(tmp_path):
    with pytest.raises(InvalidInputError, match="no run's shared memory"):
        Exchange(tmp_path / "nothing")
    (tmp_path / "empty").touch()
    with pytest.raises(InvalidInputError, match="start the run anew"):
        Exchange(tmp_path / "empty")


@pytest.mark.parametrize("dtype", [message_dtype(7), seen_dtype(7), row_dtype(7), step_dtype(), row_dtype(6)])
def test_records_are_made_of_64_bit_numbers_alone(dtype):
    """So they can be seen as words, and lie in a log as in memory."""
    assert dtype.itemsize % 8 == 0
    assert len(as_words(np.zeros(2, dtype))) == 2 * dtype.itemsize // 8


def test_two_runs_of_one_process_share_nothing():
    one, other = Exchange.create(7), Exchange.create(7)
    try:
        one.status["tick"] = 5
        assert one.path != other.path
        assert other.status["tick"][0] == 0
    finally:
        one.unlink()
        other.unlink()
