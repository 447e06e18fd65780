"""The memory of an off-policy algorithm on disk: a file that grows by what is new, whole at every moment."""

from pathlib import Path

import numpy as np

from contactsafe.errors import InvalidInputError, OutputError
from contactsafe.processes import OfTraining

FIELDS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of Stable-Baselines3's ReplayBuffer, one row a step of all environments."""


class ReplayFile(OfTraining):
    """A ring of rows beside the checkpoint, longer than the buffer's own by what is written between two checkpoints.

    So a row is never written where a row of the last checkpoint lies, and a run killed while writing finds all that its
    checkpoint speaks of. Only new rows are written: the buffer as a whole may have hundreds of megabytes.

    Args:
        path: of the file.
        buffer: a ReplayBuffer of Stable-Baselines3, its observations one array.
        slack: most rows added between two checkpoints.
    """

    def __init__(self, path, buffer, slack):
        self.path = Path(path)
        self.buffer = buffer
        self.ring = buffer.buffer_size + slack
        arrays = {name: getattr(buffer, name) for name in FIELDS}
        self.row = np.dtype([(name, array.dtype, array.shape[1:]) for name, array in arrays.items()])
        self.rows = 0

    def save(self):
        """Write what was added since the last time; give the number of rows since the beginning.

        Raises:
            OutputError: the file cannot be written.
        """
        new = (self.buffer.pos - self.rows) % self.buffer.buffer_size
        rows = np.empty(1, self.row)
        try:
            with self.path.open("r+b" if self.rows else "wb") as file:
                for index in range(self.rows, self.rows + new):
                    for name in FIELDS:
                        rows[name] = getattr(self.buffer, name)[index % self.buffer.buffer_size]
                    file.seek(index % self.ring * self.row.itemsize)
                    file.write(rows.tobytes())
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror}; make room and give --resume") from error
        self.rows += new
        return self.rows

    def load(self, rows):
        """Fill the buffer as it was when rows had been written.

        Raises:
            InvalidInputError: the file is not there, or shorter than that.
        """
        size, held = self.buffer.buffer_size, min(rows, self.ring)
        if not held:
            return
        if not self.path.is_file() or self.path.stat().st_size < held * self.row.itemsize:
            raise InvalidInputError(f"{self.path} is missing or cut short; start anew with another --out")
        stored = np.memmap(self.path, self.row, "r", shape=held)
        for index in range(max(0, rows - size), rows):
            for name in FIELDS:
                getattr(self.buffer, name)[index % size] = stored[name][index % self.ring]
        self.rows, self.buffer.pos, self.buffer.full = rows, rows % size, rows >= size
