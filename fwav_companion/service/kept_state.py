"""SHELL: the guarded reader of the files in the state directory. A file that fails is set aside, and never used.

The service starts with these files after every restart. So a wrong value in one of them would repeat at every start.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

import msgspec

from fwav_companion.errors import ImplausibleStateError
from fwav_companion.on_disk import open_regular

T = TypeVar("T")

MOST_BYTES: Final = 64 * 1024
"""Largest state file that is read, bytes: the largest one that the service writes has less than 1 kB."""


def read_state(path: Path, decode: Callable[[bytes], T], on_failure: Callable[[str], None]) -> T | None:
    """The decoded content of a state file; None if the file does not exist, or cannot be used.

    ``decode`` raises msgspec.DecodeError or ImplausibleStateError for content that the service must not use. Then the
    file is renamed to NAME.bad, and ``on_failure`` gets one line with the path, the value and what is accepted.
    """
    try:
        with open_regular(path) as file:
            content = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        on_failure(f"{path} is not used: {error.strerror or error}")
        return None
    try:
        if len(content) > MOST_BYTES:
            raise ImplausibleStateError(f"more than {MOST_BYTES // 1024} KiB")
        return decode(content)
    except (msgspec.DecodeError, ImplausibleStateError, UnicodeDecodeError, RecursionError) as error:
        on_failure(f"{path} is not used: {error}; {_set_aside(path)}")
        return None


def _set_aside(path: Path) -> str:
    """Rename the file to NAME.bad; the result in words."""
    bad = path.with_name(path.name + ".bad")
    try:
        path.replace(bad)
    except OSError as error:
        return f"it cannot be set aside: {error.strerror or error}"
    return f"it is set aside as {bad.name}"
