"""One demonstration a folder at a time: two would write into one another's files."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import made_folder


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """The folder, made where it is not there, and nobody else's meanwhile. InputFileError where it cannot be."""
    try:
        made_folder(folder)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
    try:
        # The kernel lets go of it with the process, however that ends: nothing is left to clear away.
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise InputFileError(f"{folder}: another demonstration flies in it; accepted: another folder") from None
    finally:
        os.close(descriptor)
