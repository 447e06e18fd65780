"""All that is wrong with a model, told at once: one error with each item and its remedy, one warning beside it."""

import contextlib
import warnings
from collections.abc import Iterator

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError, ModelWarning


class Findings(Independent):
    """What was found in a model: problems, which are its end, and notes, which its user should know."""

    def __init__(self) -> None:
        self._problems: list[str] = []
        self._notes: list[str] = []

    def problem(self, text: str) -> None:
        """Remember what makes the model unusable, with its remedy."""
        if text not in self._problems:
            self._problems.append(text)

    def note(self, text: str) -> None:
        """Remember what works otherwise than one might think."""
        self._notes.append(text)

    @contextlib.contextmanager
    def noting(self) -> Iterator[None]:
        """Remember the error that ends this block, and go on after it."""
        try:
            yield
        except InvalidInputError as error:
            self.problem(str(error))

    def raise_problems(self) -> None:
        """Tell all problems.

        Raises:
            InvalidInputError: there are some; the text of a single one is its own.
        """
        if self._problems:
            raise InvalidInputError(_together(self._problems, "things do not fit"))

    def warn(self, name: str) -> None:
        """Tell all notes on the arm of a name, in one `ModelWarning`."""
        if self._notes:
            text = f"arm '{name}': {_together(self._notes, 'things to know')}"
            warnings.warn(text, ModelWarning, stacklevel=4)


def _together(texts: list[str], what: str) -> str:
    if len(texts) == 1:
        return texts[0]
    return f"{len(texts)} {what}: " + "; ".join(f"({i}) {text}" for i, text in enumerate(texts, start=1))
