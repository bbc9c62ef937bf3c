"""SHELL: the files of a recording on the disk: where they lie, how much they may take, and when they are safe there."""

from __future__ import annotations

import os
from collections.abc import Mapping
from errno import ENOENT
from pathlib import Path
from typing import BinaryIO, Literal

import msgspec

from fwav_companion.recording.space import BYTES_PER_MB, Space, SpacePolicy, new_folder
from fwav_companion.recording.spans import SpanRecord

TELEMETRY, DETECTIONS, TARGETS = "telemetry.tlog", "detections.jsonl", "targets.jsonl"
FILES = (TELEMETRY, DETECTIONS, TARGETS)


class RecordingPlan(msgspec.Struct, frozen=True, kw_only=True):
    """What is recorded where, and how much of the disk it may take."""

    directory: Path
    when: Literal["always", "armed"] = "always"
    sync_s: float = 1.0
    """A power cut loses at most this."""
    space: SpacePolicy = SpacePolicy(4096 * BYTES_PER_MB, 200 * BYTES_PER_MB, False)
    retry_s: float = 10.0
    """So often a recording that stopped looks whether it can go on."""
    beside: Mapping[str, bytes] = {}
    """Small files that are kept with every recording, by name: configuration, camera."""


def has_room(plan: RecordingPlan, count: int) -> bool:
    """So many bytes could be recorded, as far as can be seen without writing any."""
    try:
        plan.directory.mkdir(parents=True, exist_ok=True)
        return Space(plan.directory, plan.space).has_room(count)
    except OSError:
        return False


class RecordingFiles:
    """The open files of one folder after the other. Everything here may raise OSError."""

    def __init__(self, plan: RecordingPlan) -> None:
        self._plan = plan
        self._space: Space | None = None
        self._open: dict[str, BinaryIO] = {}
        self._unsynced: set[str] = set()
        self.folder: Path | None = None
        """The open one."""

    def prepare(self) -> None:
        """Whether there is a directory shows at once, not when the vehicle is armed."""
        self._plan.directory.mkdir(parents=True, exist_ok=True)
        self._space = Space(self._plan.directory, self._plan.space)

    def begin(self) -> None:
        """The next folder, with what is kept beside. SpaceError where there is no room for it."""
        self.end()
        if self._space is not None:
            self._space.take(sum(map(len, self._plan.beside.values())), self._plan.directory)
        self.folder = folder = new_folder(self._plan.directory)
        for name, content in self._plan.beside.items():
            (folder / name).write_bytes(content)
        self._open = {name: (folder / name).open("ab", buffering=0) for name in FILES}
        # The names themselves must outlive a power cut too.
        for directory in (folder, self._plan.directory):
            _sync_directory(directory)

    def write(self, record: SpanRecord) -> list[Path]:
        """The folders that were removed to make room; SpaceError where that is not enough."""
        if self._space is None or self.folder is None:
            return []
        removed = self._space.take(len(record.data), self.folder)
        _write_all(self._open[record.file], record.data)
        self._unsynced.add(record.file)
        return removed

    def sync(self) -> None:
        """What was written is on the disk after this."""
        for name in sorted(self._unsynced):
            descriptor = self._open[name].fileno()
            os.fdatasync(descriptor)
            if os.fstat(descriptor).st_nlink == 0 and self.folder is not None:
                raise FileNotFoundError(ENOENT, "was removed while it was recorded to", str(self.folder / name))
        self._unsynced.clear()

    def end(self) -> None:
        """The folder is complete."""
        self.sync()
        self.close()
        self.folder = None

    def close(self) -> None:
        """Whatever became of it."""
        for file in self._open.values():
            file.close()
        self._open = {}
        self._unsynced.clear()


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
