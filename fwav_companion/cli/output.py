"""Output of a command: a file that is written completely or not at all, or stdout."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from fwav_companion.errors import InputFileError, UserError
from fwav_companion.on_disk import whole


def is_stdout(name: str) -> bool:
    """Whether ``--out`` names stdout. Opening it again by its path would let messages overwrite the output."""
    return name in ("-", "/dev/stdout")


@contextmanager
def written(name: str) -> Iterator[BinaryIO]:
    """A file or stdout to write to. InputFileError if the file cannot be written; ``main`` reports errors of stdout."""
    if is_stdout(name):
        if sys.stdout is None:
            raise UserError(f"{name}: stdout is closed; accepted: a file, or an open stdout")
        sys.stdout.flush()
        yield sys.stdout.buffer
        return
    try:
        with whole(Path(name)) as file:
            yield file
    except BrokenPipeError:  # the reader has closed it
        raise
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: a writable file") from None
