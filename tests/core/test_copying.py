"""Copies share nothing with their original, what is there but once is not copied, threads start wherever they are."""

import copy
import os
import pickle
import threading

import numpy as np
import pytest

from contactsafe.core.copying import Independent, OfTraining, Threads, Unique
from contactsafe.core.errors import InvalidInputError

COPIES = [copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))]
NAMES = ["shallow", "deep", "pickled"]


class View(Independent):
    """Data, and a view of it that is worth nothing elsewhere."""

    _bound = ("first",)

    def __init__(self, values):
        self.values = np.array(values, dtype=float)
        self._bind()

    def _bind(self):
        self.first = self.values[:1]


@pytest.mark.parametrize("copied", COPIES, ids=NAMES)
def test_a_copy_goes_on_by_itself_and_its_view_is_of_its_own_data(copied):
    original = View([1.0, 2.0])
    other = copied(original)
    np.testing.assert_array_equal(other.values, original.values)
    other.first[0] = 7.0
    assert other.values[0] == 7.0
    assert original.values[0] == 1.0


@pytest.mark.parametrize("copied", COPIES, ids=NAMES)
def test_what_there_is_but_once_says_why_it_is_not_copied(copied):
    class Handle(Unique):
        _why = "a handle cannot be copied; open another"

    with pytest.raises(InvalidInputError, match="a handle cannot be copied; open another"):
        copied(Handle())
    with pytest.raises(InvalidInputError, match="go on from its checkpoint, with --resume"):
        copied(OfTraining())


@pytest.mark.parametrize("copied", COPIES, ids=NAMES)
def test_threads_work_in_a_copy_whether_or_not_the_original_has_begun(copied):
    threads = Threads(2)
    assert copied(threads).submit(pow, 2, 5).result() == 32
    assert threads.submit(pow, 2, 6).result() == 64
    other = copied(threads)
    threads.close()
    assert other.submit(pow, 2, 7).result() == 128
    other.close()


def test_as_many_threads_work_as_were_asked_for_and_they_start_again_once_ended():
    threads, together = Threads(3), threading.Barrier(3, timeout=20.0)
    for _ in range(2):
        for done in [threads.submit(together.wait) for _ in range(3)]:
            done.result()
        threads.close()
        threads.close()


def test_what_a_thread_raises_comes_out_where_its_result_is_asked_for():
    threads = Threads(1)
    with pytest.raises(ZeroDivisionError):
        threads.submit(divmod, 1, 0).result()
    assert threads.submit(os.getpid).result() == os.getpid()
    threads.close()
