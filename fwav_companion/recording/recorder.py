"""Writing a flight down, in a thread of its own: a slow or full disk never holds up the loop."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from fwav_companion.recording.tlog import tlog_record

TELEMETRY, DETECTIONS, TARGETS = "telemetry.tlog", "detections.jsonl", "targets.jsonl"
MAX_WAITING_BYTES = 8 << 20
"""What may wait for a disk that hangs: over a minute of a busy 921 600 baud link with all its lines."""


class Recorder:
    """One flight's folder. ``write`` only queues; what cannot be kept is told once through ``on_failure``."""

    def __init__(
        self, directory: Path, beside: Mapping[str, bytes], sync_s: float, on_failure: Callable[[str], None]
    ) -> None:
        """``beside``: small files that are kept with the recording, by name: configuration, camera.

        ``on_failure`` is called from the recorder's thread, once.
        """
        self._directory = directory
        self._beside = beside
        self._sync_s = sync_s
        self._on_failure = on_failure
        self._waiting: dict[str, bytearray] = {TELEMETRY: bytearray(), DETECTIONS: bytearray(), TARGETS: bytearray()}
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self.failure: str | None = None
        self.folder: Path | None = None
        # A daemon thread: a disk that hangs must not hold up the end of the process.
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin; the folder is made in the thread."""
        self._thread.start()

    def telemetry(self, unix_us: int, frame: bytes) -> None:
        """One MAVLink frame, of either direction."""
        self.write(TELEMETRY, tlog_record(unix_us, frame))

    def write(self, name: str, data: bytes) -> None:
        """Queue bytes for one of the three files. A record is queued whole or not at all."""
        with self._lock:
            if self.failure is not None:
                return
            if self._waiting_bytes + len(data) <= MAX_WAITING_BYTES:
                self._waiting[name] += data
                self._waiting_bytes += len(data)
                return
        self._fail(f"recording stopped: the disk did not take {MAX_WAITING_BYTES >> 20} MiB in time")

    def close(self, timeout_s: float) -> None:
        """Write what waits and end, within the timeout."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self.folder = _new_folder(self._directory)
            for name, content in self._beside.items():
                (self.folder / name).write_bytes(content)
            self._write_until_stopped({name: (self.folder / name).open("ab", buffering=0) for name in self._waiting})
        except OSError as error:
            self._fail(f"recording stopped: {error.filename or self._directory}: {error.strerror or error}")

    def _write_until_stopped(self, files: Mapping[str, BinaryIO]) -> None:
        try:
            stopping = False
            while not stopping:
                # The files are brought to the disk twice in sync_s: what a power cut takes is at most that.
                stopping = self._stop.wait(self._sync_s / 2)
                for name, data in self._take().items():
                    if data:
                        _write_all(files[name], data)
                        os.fdatasync(files[name].fileno())
                if self.failure is not None:
                    return
        finally:
            for file in files.values():
                file.close()

    def _take(self) -> dict[str, bytearray]:
        with self._lock:
            taken, self._waiting = self._waiting, {name: bytearray() for name in self._waiting}
            self._waiting_bytes = 0
        return taken

    def _fail(self, why: str) -> None:
        with self._lock:
            if self.failure is not None:
                return
            self.failure = why
            for waiting in self._waiting.values():
                waiting.clear()
        self._on_failure(why)


def _write_all(file: BinaryIO, data: bytearray) -> None:
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]


def _new_folder(directory: Path) -> Path:
    """A folder named by UTC where the wall clock is right, and never one that exists: it may be wrong."""
    directory.mkdir(parents=True, exist_ok=True)
    stem = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    for count in range(1, 10_000):
        folder = directory / (stem if count == 1 else f"{stem}-{count}")
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        return folder
    raise OSError(f"{directory}: ten thousand recordings of {stem} already")
