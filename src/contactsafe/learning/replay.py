"""The memory of an off-policy algorithm on disk: a file that grows by what is new, whole at every moment."""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.copying import OfTraining
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.files import cannot_write

FIELDS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of Stable-Baselines3's ReplayBuffer, one row a step of all environments."""


class ReplayFile(OfTraining):
    """A ring of rows beside the checkpoint, longer than the buffer's own by what is written between two checkpoints.

    So a row is never written where a row of the last checkpoint lies, and a run killed while writing finds all that its
    checkpoint speaks of. Only new rows are written: the buffer as a whole may have hundreds of megabytes. Each
    carries a checksum of its numbers and of which row it is.

    Args:
        path: of the file.
        buffer: a ReplayBuffer of Stable-Baselines3, its observations one array.
        slack: most rows added between two checkpoints.
    """

    def __init__(self, path: Path | str, buffer: Any, slack: int):
        self.path = Path(path)
        self.buffer = buffer
        self.ring = buffer.buffer_size + slack
        arrays = {name: getattr(buffer, name) for name in FIELDS}
        self.row = np.dtype([(name, array.dtype, array.shape[1:]) for name, array in arrays.items()])
        self.sealed = np.dtype([("row", self.row), ("seal", np.uint32)])
        self.rows = 0

    def save(self) -> int:
        """Write what was added since the last time; return the number of rows since the beginning.

        Raises:
            OutputError: the file cannot be written.
        """
        new = (self.buffer.pos - self.rows) % self.buffer.buffer_size
        sealed = np.zeros(1, self.sealed)
        try:
            with self.path.open("r+b" if self.rows else "wb") as file:
                for index in range(self.rows, self.rows + new):
                    for name in FIELDS:
                        sealed["row"][name] = getattr(self.buffer, name)[index % self.buffer.buffer_size]
                    sealed["seal"] = _seal(sealed["row"], index)
                    file.seek(index % self.ring * self.sealed.itemsize)
                    file.write(sealed.tobytes())
        except OSError as error:
            raise cannot_write(self.path, error) from None
        self.rows += new
        return self.rows

    def check(self, rows: int) -> None:
        """Make sure that the file holds what it held when so many rows had been written.

        Raises:
            InvalidInputError: it is not there, shorter than that, or a row is damaged or not finite.
        """
        for index, row in self._stored(rows):
            if not all(np.isfinite(row[name]).all() for name in FIELDS):
                raise InvalidInputError(f"{self.path}: row {index} is not finite; start anew with another --out")

    def load(self, rows: int) -> None:
        """Fill the buffer as it was when rows had been written.

        Raises:
            InvalidInputError: as for `check`.
        """
        size = self.buffer.buffer_size
        for index, row in self._stored(rows):
            for name in FIELDS:
                getattr(self.buffer, name)[index % size] = row[name]
        self.rows, self.buffer.pos, self.buffer.full = rows, rows % size, rows >= size

    def _stored(self, rows: int) -> Iterator[tuple[int, np.void]]:
        """Yield number and content of each row that the buffer held when so many had been written."""
        held = min(rows, self.ring)
        if not held:
            return
        try:
            stored = np.memmap(self.path, self.sealed, "r", shape=held)
        except (OSError, ValueError) as error:
            raise InvalidInputError(f"{self.path} is missing or cut short; start anew with another --out") from error
        for index in range(max(0, rows - self.buffer.buffer_size), rows):
            row = stored[index % self.ring]
            if row["seal"] != _seal(row["row"], index):
                raise InvalidInputError(f"{self.path}: row {index} is damaged; start anew with another --out")
            yield index, row["row"]


def _seal(row: Any, index: int) -> int:
    """Compute the checksum of a row and of its number: a row of an earlier round in the ring is another."""
    return zlib.crc32(row.tobytes(), index & 0xFFFFFFFF)
