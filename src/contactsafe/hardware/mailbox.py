"""Messages between processes through shared memory: the newest one counts, and a torn one is never taken.

A mailbox is a row of 64-bit words: a sequence number, then the message. The one writer makes the number odd, writes,
and makes it even; a reader takes the message where the number was even and the same before and after (a seqlock).
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from contactsafe.core.compiled import compiled

TORN = -1
"""What `receive` returns where the message changed while it was read."""


@intrinsic
def _fence(typing_context: Any) -> Any:
    """Keep the memory accesses before this point before it, and those behind it behind it."""

    def codegen(context, builder, signature, args):
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), codegen


@compiled
def publish(box: np.ndarray, message: np.ndarray) -> None:
    """Put a message in a mailbox; one process does.

    Args:
        box: int64, (1 + k,), in shared memory.
        message: int64, (k,): any record, seen as words.
    """
    number = box[0]
    box[0] = number + 1
    _fence()
    for i in range(message.shape[0]):
        box[1 + i] = message[i]
    _fence()
    box[0] = number + 2


@compiled
def receive(box: np.ndarray, message: np.ndarray) -> int:
    """Take the newest message out of a mailbox.

    Args:
        box: int64, (1 + k,), in shared memory.
        message: int64, (k,); overwritten, with anything where the message is torn.

    Returns:
        The mailbox's sequence number, 0 where it was never written; `TORN` where the message changed meanwhile.
    """
    before = box[0]
    _fence()
    for i in range(message.shape[0]):
        message[i] = box[1 + i]
    _fence()
    return before if before % 2 == 0 and box[0] == before else TORN
