"""The error tree. The type says whose fault it is; the message says what, where, and what is accepted."""

from __future__ import annotations


class CompanionError(Exception):
    """Base of everything this package raises on purpose."""


class UserError(CompanionError):
    """The user's input is wrong: one line for stderr, exit status 2, never a traceback."""


class ConfigError(UserError):
    """A configuration key is unknown, missing, of the wrong type or out of range."""


class InputFileError(UserError):
    """A file the user named is missing, unreadable or malformed."""


class LinkError(CompanionError):
    """A link could not be opened or was lost. The service retries; it never exits for this."""


class EncodeError(CompanionError):
    """A message was to be sent whose name or fields its MAVLink definition does not have: our own mistake."""
