"""A message comes through whole, or not at all."""

import threading

import numpy as np

from contactsafe.core.compiled import compiled
from contactsafe.hardware.mailbox import TORN, publish, receive


def test_what_is_published_is_received_with_a_number_that_counts_up():
    box, message, found = np.zeros(6, np.int64), np.arange(5), np.zeros(5, np.int64)
    assert receive(box, found) == 0  # never written
    publish(box, message)
    first = receive(box, found)
    assert (found == message).all()
    publish(box, message + 10)
    assert receive(box, found) > first > 0
    assert (found == message + 10).all()


def test_a_message_that_is_being_written_is_torn():
    box, found = np.zeros(6, np.int64), np.zeros(5, np.int64)
    publish(box, np.arange(5))
    box[0] += 1
    assert receive(box, found) == TORN


@compiled(nogil=True)
def _write(box, message, times):
    for k in range(times):
        message[:] = k
        publish(box, message)


@compiled(nogil=True)
def _read(box, found, times):
    mixed = 0
    for _ in range(times):
        if receive(box, found) > 0 and found.min() != found.max():
            mixed += 1
    return mixed


def test_no_reader_ever_sees_half_of_two_messages():
    box, message, found = np.zeros(65, np.int64), np.zeros(64, np.int64), np.zeros(64, np.int64)
    _write(box, message, 1)
    _read(box, found, 1)
    writer = threading.Thread(target=_write, args=(box, message, 400_000))
    writer.start()
    mixed = _read(box, found, 400_000)
    writer.join()
    assert mixed == 0
