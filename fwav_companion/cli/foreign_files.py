"""What commands that read files of strangers have in common: one line of an error, and a limit of their work."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO, Final, TextIO

from fwav_companion.errors import InputFileError, UserError
from fwav_companion.memory_limit import GIB, is_want_of_memory, limit_of, limited
from fwav_companion.pixels import LARGEST_PICTURE, PIXELS_VARIABLE

MEMORY_SHARE: Final = 0.75
MOST_MEMORY: Final = 4 * GIB
"""Most memory without --large: ten times what detectors of the sizes that fly use on pictures of 100 Mpx."""
MOST_QUOTED: Final = 160
LARGE_HELP: Final = f"also pictures beyond {LARGEST_PICTURE // 10**6} Mpx, and as much memory as there is"


@contextmanager
def foreign_files(command: str, *, large: bool) -> Iterator[None]:
    """A context in which libraries' words to stderr are quoted in our one line.

    Without ``large``, pictures and memory are limited; reaching a limit is a UserError.
    """
    limit = limit_of(MEMORY_SHARE, MOST_MEMORY)
    with _quoted_libraries(), _largest_picture(large=large):
        if large:
            yield
            return
        with limited(limit):
            try:
                yield
            except Exception as error:
                if isinstance(error, UserError) or not is_want_of_memory(error):
                    raise
                text = f"{command}: out of memory, of which {limit / GIB:.1f} GiB are allowed"
                raise InputFileError(f"{text}; accepted: smaller pictures or models, or --large") from None


@contextmanager
def _largest_picture(*, large: bool) -> Iterator[None]:
    """The limit where OpenCV reads it, which is when it is loaded; a limit of the user's own counts."""
    if large or PIXELS_VARIABLE in os.environ:
        yield
        return
    os.environ[PIXELS_VARIABLE] = str(LARGEST_PICTURE)
    try:
        yield
    finally:
        del os.environ[PIXELS_VARIABLE]


@contextmanager
def _quoted_libraries() -> Iterator[None]:
    """A context in which what libraries write to descriptor 2 is kept, and its first line quoted in a UserError.

    What Python writes to sys.stderr goes where it went. In an error of our own, all that was kept follows.
    """
    try:
        real = os.dup(2)
    except OSError:  # the parent process may have closed it
        yield
        return
    own, kept = sys.stderr, tempfile.TemporaryFile()  # noqa: SIM115  # closed below
    if _is_descriptor_2(own):
        sys.stderr = os.fdopen(os.dup(real), "w", buffering=1, errors="backslashreplace")
    os.dup2(kept.fileno(), 2)
    try:
        yield
    except UserError as error:
        quoted = _first_line(kept)
        if quoted and quoted not in str(error):
            error.args = (f"{error} ({quoted})",)
        raise
    except Exception:
        os.write(real, _content(kept))
        raise
    finally:
        os.dup2(real, 2)
        os.close(real)
        kept.close()
        if sys.stderr is not own:
            sys.stderr.close()
            sys.stderr = own


def _is_descriptor_2(stream: TextIO | None) -> bool:
    try:
        return stream is not None and stream.fileno() == 2
    except (OSError, ValueError):
        return False


def _content(kept: BinaryIO) -> bytes:
    kept.seek(0)
    return kept.read()


def _first_line(kept: BinaryIO) -> str:
    """The first line that libraries wrote, shortened, without addresses in memory; "" where there is none."""
    lines = [line.strip() for line in _content(kept).decode("utf-8", "replace").splitlines()]
    first = next((line for line in lines if line), "")
    return re.sub(r" @ 0x[0-9a-f]+", "", first)[:MOST_QUOTED]
