"""SHELL: mount points above a directory that are not mounted, by what the system itself lists."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import msgspec

MOUNT_INFO, FSTAB = Path("/proc/self/mountinfo"), Path("/etc/fstab")
REMOVABLE: Final = (Path("/media"), Path("/run/media"), Path("/mnt"))
"""Directories whose content is mounted: removable media and temporary mounts (Filesystem Hierarchy Standard 3.0)."""


class MissingMount(msgspec.Struct, frozen=True):
    """A mount point above a directory that is not mounted."""

    point: str
    """Mount point."""
    device: str = ""
    """Device of /etc/fstab; "" where the mount point is known by its place alone."""

    def __str__(self) -> str:
        """What is wrong, one clause."""
        return f"nothing is mounted at {self.point}{f' ({self.device} in /etc/fstab)' if self.device else ''}"


class _Mount(msgspec.Struct, frozen=True):
    """One line of mountinfo (proc(5))."""

    device: str
    """Major and minor number."""
    root: str
    """Path within its file system that is mounted."""
    point: Path


def missing_mount_above(directory: Path) -> MissingMount | None:
    """The mount point above an absolute directory of this system that is not mounted; None where none is missing."""
    try:
        mount_info = MOUNT_INFO.read_text(errors="replace")
    except OSError:
        return None
    try:
        fstab = FSTAB.read_text(errors="replace")
    except OSError:
        fstab = ""
    return missing_mount(directory.resolve(), mount_info, fstab)


def missing_mount(directory: Path, mount_info: str, fstab: str) -> MissingMount | None:
    """The mount point above ``directory`` that is not mounted, from the text of mountinfo and of fstab.

    A mount point is known from fstab, or as the place of removable media. A bind mount of a directory onto itself does
    not count as mounted: systemd makes one for each ReadWritePaths= of a unit.
    """
    mounts = list(_mounts(mount_info))
    if not mounts:
        return None
    root = next((mount for mount in mounts if mount.point == Path("/")), None)
    mounted = {mount.point for mount in mounts if root is None or not _is_bound_to_itself(mount, root)}
    expected = [(point, device) for device, point in _fstab(fstab) if directory.is_relative_to(point)]
    if expected:
        point, device = max(expected)  # the deepest
        return None if point in mounted else MissingMount(str(point), device)
    for place in REMOVABLE:
        if directory.is_relative_to(place) and directory != place:
            above = [each for each in (directory, *directory.parents) if each.is_relative_to(place)]
            if not any(each in mounted for each in above):
                return MissingMount(str(above[-2]))
    return None


def _mounts(text: str) -> Iterator[_Mount]:
    for line in text.splitlines():
        words = line.split()
        if len(words) > 5:
            yield _Mount(words[2], _unescaped(words[3]), Path(_unescaped(words[4])))


def _fstab(text: str) -> Iterator[tuple[str, Path]]:
    """The device and the mount point of each entry but the root's (fstab(5))."""
    for line in text.splitlines():
        words = line.split()
        if len(words) > 2 and not words[0].startswith("#") and words[1].startswith("/") and words[1] != "/":
            yield _unescaped(words[0]), Path(_unescaped(words[1]))


def _is_bound_to_itself(mount: _Mount, root: _Mount) -> bool:
    """Whether a directory of the root file system is mounted at its own place."""
    own = f"{root.root.rstrip('/')}{mount.point}"
    return mount.point != Path("/") and mount.device == root.device and mount.root == own


def _unescaped(word: str) -> str:
    """The word with the octal escapes of blanks and backslashes resolved."""
    for escape, character in ((r"\040", " "), (r"\011", "\t"), (r"\012", "\n"), (r"\134", "\\")):
        word = word.replace(escape, character)
    return word
