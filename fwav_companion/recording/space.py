"""SHELL: how much of the disk recordings may take, and which folder goes first where the user allows that."""

from __future__ import annotations

import os
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import msgspec

from fwav_companion.errors import CompanionError

BYTES_PER_MB: Final = 1_000_000
FOLDER_NAME: Final = re.compile(r"(\d{5})-\d{8}T\d{6}Z")
"""A number that only grows, then UTC: a board without a clock of its own starts in 1970 again and again, so that names
by time alone would not even be in order."""


class SpaceError(CompanionError):
    """The recording would take more of the disk than it may."""


class SpacePolicy(msgspec.Struct, frozen=True):
    """[record] in bytes."""

    most_used_bytes: int
    """Of all recordings in the directory; 0: no limit."""
    least_free_bytes: int
    """That stays free on the disk for everybody else."""
    remove_oldest: bool
    """Whether older recordings may be removed for a new one. A recording may be the only one of its flight: nothing is
    removed unless the user said so."""


def recordings(directory: Path) -> list[Path]:
    """The folders that recorders made, oldest first."""
    try:
        return sorted(path for path in directory.iterdir() if FOLDER_NAME.fullmatch(path.name) and path.is_dir())
    except OSError:
        return []


def new_folder(directory: Path) -> Path:
    """The next number, and UTC as far as the wall clock knows it. OSError where no folder can be made."""
    directory.mkdir(parents=True, exist_ok=True)
    stem = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    existing = recordings(directory)
    number = int(existing[-1].name[:5]) + 1 if existing else 1
    while True:
        folder = directory / f"{number:05d}-{stem}"
        try:
            folder.mkdir()
        except FileExistsError:  # another recorder was faster
            number += 1
            continue
        return folder


class Space:
    """Asked before every write. Its own count of what is used spares a walk over the disk each second."""

    def __init__(self, directory: Path, policy: SpacePolicy) -> None:
        self._directory = directory
        self._policy = policy
        self._used = sum(map(_size, recordings(directory)))

    def take(self, count: int, current: Path) -> list[Path]:
        """Claim so many bytes. The folders that were removed for them; SpaceError where that is not enough."""
        removed: list[Path] = []
        while (complaint := self._complaint(count)) is not None:
            oldest = next((path for path in recordings(self._directory) if path != current), None)
            if oldest is None or not self._policy.remove_oldest:
                raise SpaceError(complaint)
            freed = _size(oldest)
            shutil.rmtree(oldest)
            self._used -= freed
            removed.append(oldest)
        self._used += count
        return removed

    def has_room(self, count: int) -> bool:
        """So many bytes would fit without anything being removed."""
        return self._complaint(count) is None

    def _complaint(self, count: int) -> str | None:
        policy = self._policy
        if policy.most_used_bytes and self._used + count > policy.most_used_bytes:
            self._used = sum(map(_size, recordings(self._directory)))  # somebody may have made room meanwhile
        if policy.most_used_bytes and self._used + count > policy.most_used_bytes:
            most = policy.most_used_bytes // BYTES_PER_MB
            return f"recordings take {self._used // BYTES_PER_MB} of {most} MB ([record] max_used_mb)"
        disk = os.statvfs(self._directory)
        free = disk.f_bavail * disk.f_frsize
        if free - count < policy.least_free_bytes:
            least = policy.least_free_bytes // BYTES_PER_MB
            stay = f", {least} MB are to stay so ([record] min_free_mb)" if least else ": the disk is full"
            return f"{free / BYTES_PER_MB:.1f} MB are free{stay}"
        return None


def _size(folder: Path) -> int:
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size
        except OSError:  # gone meanwhile
            continue
    return total
