"""SHELL: files that a user named: read only if they are regular files, written completely or not at all."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final

from fwav_companion.errors import InputFileError

KINDS: Final = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}
LONGEST_STEM: Final = 50
"""Characters of a temporary name: in any alphabet fewer than the 255 bytes that file systems accept."""


def open_regular(path: Path) -> BinaryIO:
    """The file, opened for reading. OSError, in words, if it does not exist or is a pipe, device or socket."""
    _require_regular(path)
    return path.open("rb")


def content(path: Path) -> bytes:
    """The whole content. OSError as for :func:`open_regular`, and if the memory is too small."""
    with open_regular(path) as file:
        try:
            return file.read()
        except MemoryError:
            size = os.fstat(file.fileno()).st_size
            raise OSError(errno.ENOMEM, f"Its {size} bytes do not fit into the memory", str(path)) from None


@contextmanager
def whole(path: Path, *, synced: bool = False, mode: int | None = None) -> Iterator[BinaryIO]:
    """A file to write, which gets its name when it is complete; if writing ends early, the old file remains.

    ``synced``: the new content survives a power cut. ``mode``: permissions of the file, whatever the umask; by default
    those of the old file, or those that the umask leaves. Devices and pipes are written directly. OSError names
    ``path``.
    """
    before = _status(path)
    if before is not None and not stat.S_ISREG(before.st_mode):
        with path.open("wb") as file:
            yield file
        return
    real = Path(os.path.realpath(path))  # replace the target of a symbolic link, not the link
    temporary_path = real.with_name(f".{real.name[:LONGEST_STEM]}.{os.getpid()}")
    if mode is None and before is not None:
        mode = stat.S_IMODE(before.st_mode)
    if before is not None and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    temporary = _temporary(temporary_path, path, mode)
    try:
        with temporary as file:
            yield file
            file.flush()
            if synced:
                os.fsync(file.fileno())
        temporary_path.replace(real)
        if synced:
            _sync_folder(real.parent)
    except BaseException as error:  # Ctrl-C too
        temporary_path.unlink(missing_ok=True)
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


def write_page(path: Path, text: str) -> Path:
    """The path of a page that was written, its folder made. InputFileError."""
    try:
        made_folder(path.parent)
        with whole(path) as file:
            file.write(text.encode())
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
    return path


def created(path: Path, mode: int = 0o666) -> BinaryIO:
    """A new file, opened for appending without a buffer. FileExistsError if the name exists, also as a link."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_NOFOLLOW | os.O_CLOEXEC, mode)
    return open(descriptor, "ab", buffering=0)  # noqa: PTH123 (a descriptor, not a path)


def _temporary(temporary_path: Path, path: Path, mode: int | None) -> BinaryIO:
    """The temporary file, created by this process: not a link, nor a file that another one prepared."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        with suppress(FileNotFoundError):
            temporary_path.unlink()  # left over from a killed process with this process id, as after a reboot
        descriptor = os.open(temporary_path, flags, 0o666 if mode is None else mode)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    if mode is not None:
        os.fchmod(descriptor, mode)
    return open(descriptor, "wb")  # noqa: PTH123 (a descriptor, not a path)


def _sync_folder(folder: Path) -> None:
    """Bring the new name in a folder to the disk, where the file system can sync folders."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
