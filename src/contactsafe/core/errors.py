"""The errors this package raises: one family, one line each, with the remedy."""

import reprlib


class ContactSafeError(Exception):
    """Base of every error raised on purpose; its text says what, found, allowed and remedy."""


class InvalidInputError(ContactSafeError, ValueError):
    """A value given by the user has the wrong shape, is not finite, or lies outside its range."""


class ModelWarning(UserWarning):
    """Something about a robot model works otherwise than its user might think."""


class UnreachableError(ContactSafeError):
    """No joint configuration within the limits reaches the asked pose."""


class UnsupportedVersionError(ContactSafeError, ImportError):
    """An installed dependency is of a version this package was not checked with."""


class BundleError(ContactSafeError):
    """A policy bundle is missing, damaged, or of another format."""


class OutputError(ContactSafeError, OSError):
    """Results cannot be written where they were asked for."""


def shown(value: object, most: int = 80) -> str:
    """Show a value that was found, in one line of at most so many characters, whatever it is."""
    try:
        text = _short.repr(value)
    except Exception:  # an int of more digits than Python prints, or a foreign __repr__
        text = f"a {type(value).__name__} that cannot be shown"
    return text if len(text) <= most else f"{text[: most - 1]}…"


_short = reprlib.Repr()
_short.maxlist = _short.maxtuple = _short.maxdict = 8
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxlevel = 3
