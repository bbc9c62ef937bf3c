"""The error tree. The type says who must act; the message says what is wrong, where, and what is accepted."""

from __future__ import annotations


class CompanionError(Exception):
    """Base of all errors that this package raises deliberately."""


class UserError(CompanionError):
    """The user's input is wrong: one line for stderr, exit status 2, never a traceback."""


class ConfigError(UserError):
    """A configuration key is unknown, missing, of the wrong type or out of range."""


class InputFileError(UserError):
    """A file that the user named is missing, unreadable or malformed."""


class LinkError(CompanionError):
    """A link could not be opened, or was lost. The service retries and never exits for this."""


class ImplausibleStateError(CompanionError):
    """A file that the service keeps between flights has a value outside its range. The service starts without it."""


class EncodeError(CompanionError):
    """A message's name or fields are not in the MAVLink definitions: a defect in this program."""
