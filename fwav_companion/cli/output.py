"""Where a command's output goes: to a file that is whole or not there, or to stdout."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from fwav_companion.errors import InputFileError, UserError
from fwav_companion.on_disk import whole


def is_stdout(name: str) -> bool:
    """Whether ``--out`` asks for stdout. Opened anew by its path, a file there would be overwritten by what is said."""
    return name in ("-", "/dev/stdout")


@contextmanager
def written(name: str) -> Iterator[BinaryIO]:
    """What to write to. InputFileError where a file cannot be; what goes wrong with stdout is told by ``main``."""
    if is_stdout(name):
        if sys.stdout is None:
            raise UserError(f"{name}: stdout is closed; accepted: a file, or an open stdout")
        sys.stdout.flush()
        yield sys.stdout.buffer
        return
    try:
        with whole(Path(name)) as file:
            yield file
    except BrokenPipeError:  # whoever read it has seen enough
        raise
    except OSError as error:
        raise InputFileError(f"{name}: {error.strerror}; accepted: a file that can be written") from None
