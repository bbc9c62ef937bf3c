"""SHELL: recording folders on the disk: their files, their space limits, and when data is safe from a power cut."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from datetime import UTC, datetime
from errno import ENOENT
from pathlib import Path
from typing import BinaryIO, Final, Literal

import msgspec

from fwav_companion.errors import CompanionError
from fwav_companion.on_disk import created
from fwav_companion.recording.spans import PictureRecord, SpanRecord

BYTES_PER_MB: Final = 1_000_000
FOLDER_NAME: Final = re.compile(r"(\d{5})-\d{8}T\d{6}Z")
"""A number that only grows, then UTC. A board without a clock of its own starts in 1970 at each boot, so that names by
time alone would not be in order."""
TELEMETRY, DETECTIONS, TARGETS = "telemetry.tlog", "detections.jsonl", "targets.jsonl"
FILES = (TELEMETRY, DETECTIONS, TARGETS)
PICTURES = "pictures"
"""Folder of the kept pictures in a recording; ``detect`` reads it."""
STAMPS = f"{PICTURES}/stamps.jsonl"
FOLDER_MODE, FILE_MODE = 0o750, 0o640
"""Recordings show places and people: only the owner and the group may read them."""


PICTURE_SHARE: Final = 0.9
"""Share of [record] max_used_mb that pictures may fill. The rest is for the flight's data: 400 MB of 4096, hours."""
PICTURES_LEAVE_BYTES: Final = 20 * BYTES_PER_MB
"""Space that pictures leave free beyond [record] min_free_mb: some minutes of the flight's data."""


class SpaceError(CompanionError):
    """The recording would exceed its limits on the disk."""


class SpacePolicy(msgspec.Struct, frozen=True):
    """Space limits of [record], in bytes."""

    most_used_bytes: int
    """Limit for all recordings in the directory; 0: no limit."""
    least_free_bytes: int
    """Free bytes that must remain on the disk."""
    remove_oldest: bool
    """Whether older recordings may be removed for a new one. A recording may be the only one of its flight, so this
    happens only if the user has enabled it."""


class RecordingPlan(msgspec.Struct, frozen=True, kw_only=True):
    """Where and when to record, and the space limits."""

    directory: Path
    when: Literal["always", "armed"] = "always"
    sync_s: float = 1.0
    """Longest time whose data a power cut loses, seconds."""
    space: SpacePolicy = SpacePolicy(4096 * BYTES_PER_MB, 200 * BYTES_PER_MB, False)
    retry_s: float = 5.0
    """Interval at which a stopped recording tests whether it can continue, seconds."""
    extra_files: Mapping[str, bytes] = {}
    """Small files that are stored with every recording, by name: configuration, camera."""


def lack_of_room(plan: RecordingPlan, count: int) -> str:
    """Why the limits or the disk do not permit this number of bytes; "" if they do. At most the directory is made."""
    try:
        plan.directory.mkdir(parents=True, exist_ok=True)
        # A file system that is mounted read-only has room, too.
        if not os.access(plan.directory, os.W_OK | os.X_OK):
            return f"{plan.directory}: may not be written"
        return Space(plan.directory, plan.space).lack(count)
    except OSError as error:
        return f"{error.filename or plan.directory}: {error.strerror or error}"


class RecordingFiles:
    """The open files of the present recording folder. Every method may raise OSError."""

    def __init__(self, plan: RecordingPlan) -> None:
        self._plan = plan
        self._space: Space | None = None
        self._open: dict[str, BinaryIO] = {}
        self._unsynced: set[str] = set()
        self._unsynced_pictures: list[Path] = []
        self.folder: Path | None = None
        """The folder whose files are open."""

    def prepare(self) -> None:
        """Create the directory at once, so that a wrong one is reported before the vehicle is armed."""
        self._plan.directory.mkdir(parents=True, exist_ok=True)
        self._space = Space(self._plan.directory, self._plan.space)

    def begin(self) -> None:
        """Create the next folder with the plan's small files. SpaceError if they do not fit."""
        self.end()
        if self._space is not None:
            self._space.take(sum(map(len, self._plan.extra_files.values())), self._plan.directory)
        self.folder = folder = new_folder(self._plan.directory)
        for name, content in self._plan.extra_files.items():
            with created(folder / name, FILE_MODE) as file:
                _write_all(file, content)
        self._open = {name: created(folder / name, FILE_MODE) for name in FILES}
        # The names must survive a power cut, too.
        for directory in (folder, self._plan.directory):
            _sync_directory(directory)

    def write(self, record: SpanRecord) -> list[Path]:
        """Write the record. Returns the folders that were removed to make room; SpaceError if that was not enough."""
        if self._space is None or self.folder is None:
            return []
        removed = self._space.take(len(record.data), self.folder)
        _write_all(self._open[record.file], record.data)
        self._unsynced.add(record.file)
        return removed

    def write_picture(self, picture: PictureRecord) -> list[Path]:
        """Write a picture, then its stamp. Returns the folders that were removed; SpaceError if there is no room."""
        if self._space is None or self.folder is None:
            return []
        removed = self._space.take(picture.size, self.folder, for_picture=True)
        if STAMPS not in self._open:
            (self.folder / PICTURES).mkdir(FOLDER_MODE)
            self._open[STAMPS] = created(self.folder / STAMPS, FILE_MODE)
            _sync_directory(self.folder)
        path = self.folder / PICTURES / picture.file
        with created(path, FILE_MODE) as file:
            _write_all(file, picture.jpeg)
        _write_all(self._open[STAMPS], picture.line)
        self._unsynced_pictures.append(path)
        self._unsynced.add(STAMPS)
        return removed

    def sync(self) -> None:
        """Flush all written data to the disk, pictures before their stamps."""
        for path in self._unsynced_pictures:
            with path.open("rb") as file:
                os.fdatasync(file.fileno())
        if self._unsynced_pictures and self.folder is not None:
            _sync_directory(self.folder / PICTURES)
        self._unsynced_pictures.clear()
        for name in sorted(self._unsynced):
            descriptor = self._open[name].fileno()
            os.fdatasync(descriptor)
            if os.fstat(descriptor).st_nlink == 0 and self.folder is not None:
                raise FileNotFoundError(ENOENT, "was removed while it was recorded to", str(self.folder / name))
        self._unsynced.clear()

    def end(self) -> None:
        """Complete the folder."""
        self.sync()
        self.close()
        self.folder = None

    def close(self) -> None:
        """Close the files, also after an error."""
        for file in self._open.values():
            file.close()
        self._open = {}
        self._unsynced.clear()
        self._unsynced_pictures.clear()


def _write_all(file: BinaryIO, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]


def _sync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def recordings(directory: Path) -> list[Path]:
    """The recording folders in a directory, oldest first."""
    try:
        return sorted(path for path in directory.iterdir() if FOLDER_NAME.fullmatch(path.name) and path.is_dir())
    except OSError:
        return []


def new_folder(directory: Path) -> Path:
    """A new folder, named by the next number and the wall clock's UTC. OSError if it cannot be created."""
    directory.mkdir(parents=True, exist_ok=True)
    stem = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    existing = recordings(directory)
    number = int(existing[-1].name[:5]) + 1 if existing else 1
    while True:
        folder = directory / f"{number:05d}-{stem}"
        try:
            folder.mkdir(FOLDER_MODE)
        except FileExistsError:  # another recorder was faster
            number += 1
            continue
        return folder


class Space:
    """Checks the space limits before every write. It counts the used bytes itself to avoid a disk walk each second."""

    def __init__(self, directory: Path, policy: SpacePolicy) -> None:
        self._directory = directory
        self._policy = policy
        self._used = sum(map(_size, recordings(directory)))

    def take(self, count: int, current: Path, *, for_picture: bool = False) -> list[Path]:
        """Reserve bytes. Returns the folders that were removed for them; SpaceError if that was not enough.

        Pictures leave some room for the flight's data.
        """
        removed: list[Path] = []
        while (complaint := self._complaint(count, for_picture=for_picture)) is not None:
            oldest = next((path for path in recordings(self._directory) if path != current), None)
            if oldest is None or not self._policy.remove_oldest:
                raise SpaceError(complaint)
            freed = _size(oldest)
            shutil.rmtree(oldest)
            self._used -= freed
            removed.append(oldest)
        self._used += count
        return removed

    def lack(self, count: int) -> str:
        """Why the bytes do not fit without removing a recording; "" if they fit."""
        return self._complaint(count) or ""

    def _complaint(self, count: int, *, for_picture: bool = False) -> str | None:
        policy = self._policy
        most_bytes = policy.most_used_bytes * (PICTURE_SHARE if for_picture else 1.0)
        least_free_bytes = policy.least_free_bytes + (PICTURES_LEAVE_BYTES if for_picture else 0)
        if policy.most_used_bytes and self._used + count > most_bytes:
            self._used = sum(map(_size, recordings(self._directory)))  # the user may have made room meanwhile
        if policy.most_used_bytes and self._used + count > most_bytes:
            most = policy.most_used_bytes // BYTES_PER_MB
            return f"recordings take {self._used // BYTES_PER_MB} of {most} MB ([record] max_used_mb)"
        disk = os.statvfs(self._directory)
        free = disk.f_bavail * disk.f_frsize
        if free - count < least_free_bytes:
            least = policy.least_free_bytes // BYTES_PER_MB
            limit = f", {least} MB must stay free ([record] min_free_mb)" if least else ": the disk is full"
            if count >= BYTES_PER_MB and free >= least_free_bytes:  # asked before it goes on, not for one record
                limit = f", {(least_free_bytes + count) // BYTES_PER_MB} are needed to go on"
            return f"{free / BYTES_PER_MB:.1f} MB are free{limit}"
        return None


def _size(folder: Path) -> int:
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size
        except OSError:  # removed meanwhile
            continue
    return total
