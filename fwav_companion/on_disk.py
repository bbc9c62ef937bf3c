"""SHELL: files that a user named: read only if they are regular files, written completely or not at all."""

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
"""Characters of a temporary name: in any alphabet fewer than the 255 bytes that file systems accept."""


def opened(path: Path) -> BinaryIO:
    """The file, opened for reading. OSError, in words, if it does not exist or is a pipe, device or socket."""
    _require_regular(path)
    return path.open("rb")


def content(path: Path) -> bytes:
    """The whole content. OSError as for :func:`opened`, and if the memory is too small."""
    with opened(path) as file:
        try:
            return file.read()
        except MemoryError:
            size = os.fstat(file.fileno()).st_size
            raise OSError(errno.ENOMEM, f"Its {size} bytes do not fit into the memory", str(path)) from None


@contextmanager
def whole(path: Path, *, synced: bool = False) -> Iterator[BinaryIO]:
    """A file to write, which gets its name when it is complete; if writing ends early, the old file remains.

    ``synced``: the new content survives a power cut. Devices and pipes are written directly. OSError names ``path``.
    """
    before = _status(path)
    if before is not None and not stat.S_ISREG(before.st_mode):
        with path.open("wb") as file:
            yield file
        return
    real = Path(os.path.realpath(path))  # replace the target of a symbolic link, not the link
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
        if isinstance(error, OSError) and error.filename is None:  # as for a full disk
            error.filename = str(path)
        raise


def made_folder(path: Path) -> Path:
    """The folder, created with its parents if it does not exist. OSError, in words, if the name is not a folder."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        path.stat()  # raises the better error for a circle of links
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path)) from None
    return path


def _created(beside: Path, path: Path, before: os.stat_result | None) -> BinaryIO:
    """The temporary file, with the permissions of the file that it will replace. OSError if that is write-protected."""
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
    if not stat.S_ISREG(mode) and not path.samefile(os.devnull):  # the null device serves as an empty file
        kind = KINDS.get(stat.S_IFMT(mode), "something else")
        raise OSError(errno.EINVAL, f"Is {kind}, not a regular file", str(path))


def _status(path: Path) -> os.stat_result | None:
    """The file's status; None if it does not exist. OSError if that cannot be determined, as in a circle of links."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None
