"""The errors this package raises: one family, one line each, with the remedy."""


class ContactSafeError(Exception):
    """Base of every error raised on purpose; its text says what, found, allowed and remedy."""


class InvalidInputError(ContactSafeError, ValueError):
    """A value given by the user has the wrong shape, is not finite, or lies outside its range."""


class UnreachableError(ContactSafeError):
    """No joint configuration within the limits reaches the asked pose."""


class UnsupportedVersionError(ContactSafeError, ImportError):
    """An installed dependency is of a version this package was not checked with."""


class BundleError(ContactSafeError):
    """A policy bundle is missing, damaged, or of another format."""


class OutputError(ContactSafeError, OSError):
    """Results cannot be written where they were asked for."""
