"""SHELL: files that somebody named: read where they are files, written whole or not at all."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final

KINDS: Final = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}
LONGEST_STEM: Final = 50
"""Characters, of a name for the time being: in any alphabet less than the 255 bytes that file systems take."""


def opened(path: Path) -> BinaryIO:
    """The file, to be read. OSError, in words, where there is none, and for what may never end, or never begin."""
    _require_regular(path)
    return path.open("rb")


def content(path: Path) -> bytes:
    """All of it; OSError as :func:`opened`, and where memory is too small for it."""
    with opened(path) as file:
        try:
            return file.read()
        except MemoryError:
            size = os.fstat(file.fileno()).st_size
            raise OSError(errno.ENOMEM, f"Its {size} bytes do not fit into the memory", str(path)) from None


@contextmanager
def whole(path: Path, *, synced: bool = False) -> Iterator[BinaryIO]:
    """A file to write, which gets its name when all of it stands; whatever ends it before leaves all as it was.

    ``synced``: it outlives a power cut. What is no file (a device, a pipe) is written as it is. OSError by ``path``.
    """
    before = _status(path)
    if before is not None and not stat.S_ISREG(before.st_mode):
        with path.open("wb") as file:
            yield file
        return
    real = Path(os.path.realpath(path))  # what a link points to is replaced, not the link
    beside = real.with_name(f".{real.name[:LONGEST_STEM]}.{os.getpid()}")
    created = _created(beside, path, before)
    try:
        with created as file:
            yield file
            file.flush()
            if synced:
                os.fsync(file.fileno())
        beside.replace(real)
    except BaseException as error:  # Ctrl-C too
        beside.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:  # a disk that is full tells no name
            error.filename = str(path)
        raise


def made_folder(path: Path) -> Path:
    """The folder, with those above it, made where it is not there. OSError, in words, where something else stands."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        path.stat()  # of a circle of links, that is what is told
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path)) from None
    return path


def _created(beside: Path, path: Path, before: os.stat_result | None) -> BinaryIO:
    """With the permissions of what it is to replace, which must not forbid that."""
    if before is not None and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    try:
        file = beside.open("wb")
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    if before is not None:
        os.fchmod(file.fileno(), stat.S_IMODE(before.st_mode))
    return file


def _require_regular(path: Path) -> None:
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode) and not path.samefile(os.devnull):  # which is as good as an empty file
        raise OSError(errno.EINVAL, f"Is {KINDS.get(stat.S_IFMT(mode), 'something else')}, no regular file", str(path))


def _status(path: Path) -> os.stat_result | None:
    """None where nothing stands yet. OSError where nobody can tell, as in a circle of links."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None
