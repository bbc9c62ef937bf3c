"""Writing a flight down, in a thread of its own: a slow or full disk never holds up the loop."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Mapping
from errno import ENOENT
from pathlib import Path
from typing import BinaryIO, Literal

import msgspec

from fwav_companion.recording.lines import Line, encode_line
from fwav_companion.recording.space import BYTES_PER_MB, Space, SpaceError, SpacePolicy, new_folder
from fwav_companion.recording.spans import Begin, Record, Spans, Step
from fwav_companion.recording.tlog import tlog_record

TELEMETRY, DETECTIONS, TARGETS = "telemetry.tlog", "detections.jsonl", "targets.jsonl"
FILES = (TELEMETRY, DETECTIONS, TARGETS)
MAX_WAITING_BYTES = 8 << 20
"""What may wait for a disk that hangs: over a minute of a busy 921 600 baud link with all its lines."""


class RecordingPlan(msgspec.Struct, frozen=True, kw_only=True):
    """What is recorded where, and how much of the disk it may take."""

    directory: Path
    when: Literal["always", "armed"] = "always"
    sync_s: float = 1.0
    """A power cut loses at most this."""
    space: SpacePolicy = SpacePolicy(4096 * BYTES_PER_MB, 200 * BYTES_PER_MB, False)
    beside: Mapping[str, bytes] = {}
    """Small files that are kept with every recording, by name: configuration, camera."""


def _no_line() -> Line | None:
    """Nothing is known of a targets file."""
    return None


class Recorder:
    """A flight's folders. Writing only queues; what cannot be kept is told once through ``on_failure``."""

    def __init__(
        self,
        plan: RecordingPlan,
        on_failure: Callable[[str], None],
        *,
        on_removed: Callable[[str], None] | None = None,
        header: Callable[[], Line | None] = _no_line,
        summary: Callable[[], Line | None] = _no_line,
    ) -> None:
        """``on_failure`` is called once, ``on_removed`` for each folder, both from the recorder's thread.

        ``header`` and ``summary`` tell, on the caller's side, how a targets file begins and ends at present.
        """
        self._plan = plan
        self._on_failure = on_failure
        self._on_removed = on_removed or on_failure
        self._spans = Spans(
            plan.when,
            lambda at_us: _frame_record(at_us, header(), is_header=True),
            lambda at_us: _frame_record(at_us, summary()),
        )
        self._waiting: list[Step] = []
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self.failure: str | None = None
        self.folder: Path | None = None
        """Where it writes now; None while it waits for arming."""
        # A daemon thread: a disk that hangs must not hold up the end of the process.
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def telemetry(self, unix_us: int, frame: bytes) -> None:
        """One MAVLink frame, of either direction."""
        self._put(Record(unix_us, TELEMETRY, tlog_record(unix_us, frame)))

    def detection(self, unix_us: int, line: bytes) -> None:
        """One line of the detections."""
        self._put(Record(unix_us, DETECTIONS, line))

    def target(self, unix_us: int, line: Line) -> None:
        """One line of the targets."""
        self._put(Record(unix_us, TARGETS, encode_line(line), line["type"] == "header"))

    def on_armed(self, armed: bool, unix_us: int) -> None:
        """The vehicle is armed or not; to be told as often as one likes."""
        steps = self._spans.on_armed(armed, unix_us)
        if steps:
            self._queue(steps)

    def close(self, timeout_s: float) -> None:
        """Write what waits and end, within the timeout."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    # On the caller's side.

    def _put(self, record: Record) -> None:
        if self.failure is None:
            self._queue(self._spans.on_record(record))

    def _queue(self, steps: Iterable[Step]) -> None:
        """A record is queued whole or not at all."""
        with self._lock:
            for step in steps:
                self._waiting_bytes += len(step.data) if isinstance(step, Record) else 0
                self._waiting.append(step)
            full = self._waiting_bytes > MAX_WAITING_BYTES
        if full:
            self._fail(f"the disk did not take {MAX_WAITING_BYTES >> 20} MiB in time")

    # In the thread.

    def _run(self) -> None:
        files = _Files(self._plan)
        try:
            files.prepare()
            stopping = False
            while not stopping and self.failure is None:
                # The files are brought to the disk twice in sync_s: what a power cut takes is at most that.
                stopping = self._stop.wait(self._plan.sync_s / 2)
                self._write(files, self._take())
        except SpaceError as error:
            self._fail(str(error))
        except OSError as error:
            self._fail(f"{error.filename or self._plan.directory}: {error.strerror or error}")
        finally:
            files.close()

    def _write(self, files: _Files, steps: list[Step]) -> None:
        for step in _joined(steps):
            if isinstance(step, Record):
                for removed in files.write(step):
                    self._on_removed(f"recording: removed the oldest, {removed}, to make room")
            elif isinstance(step, Begin):
                files.begin()
            else:
                files.end()
            self.folder = files.folder
        files.sync()

    def _take(self) -> list[Step]:
        with self._lock:
            taken, self._waiting, self._waiting_bytes = self._waiting, [], 0
        return taken

    def _fail(self, why: str) -> None:
        with self._lock:
            if self.failure is not None:
                return
            self.failure = f"recording stopped: {why}"
            self._waiting.clear()
            self._waiting_bytes = 0
        self._on_failure(self.failure)


def _frame_record(at_us: int, line: Line | None, *, is_header: bool = False) -> Record | None:
    return None if line is None else Record(at_us, TARGETS, encode_line(line), is_header)


def _joined(steps: Iterable[Step]) -> list[Step]:
    """The same with the records of each file between two other steps as one: one system call, not hundreds."""
    joined: list[Step] = []
    pieces: dict[str, list[bytes]] = {}

    def settle() -> None:
        # What a line of the targets came from is on the disk before the line is.
        joined.extend(Record(0, name, b"".join(pieces[name])) for name in FILES if name in pieces)
        pieces.clear()

    for step in steps:
        if isinstance(step, Record):
            pieces.setdefault(step.file, []).append(step.data)
        else:
            settle()
            joined.append(step)
    settle()
    return joined


class _Files:
    """The open files of one folder after the other. Everything here may raise OSError."""

    def __init__(self, plan: RecordingPlan) -> None:
        self._plan = plan
        self._space: Space | None = None
        self._open: dict[str, BinaryIO] = {}
        self._unsynced: set[str] = set()
        self.folder: Path | None = None

    def prepare(self) -> None:
        """Whether there is a directory shows at once, not when the vehicle is armed."""
        self._plan.directory.mkdir(parents=True, exist_ok=True)
        self._space = Space(self._plan.directory, self._plan.space)

    def begin(self) -> None:
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

    def write(self, record: Record) -> list[Path]:
        if self._space is None or self.folder is None:
            return []
        removed = self._space.take(len(record.data), self.folder)
        _write_all(self._open[record.file], record.data)
        self._unsynced.add(record.file)
        return removed

    def sync(self) -> None:
        for name in sorted(self._unsynced):
            descriptor = self._open[name].fileno()
            os.fdatasync(descriptor)
            if os.fstat(descriptor).st_nlink == 0 and self.folder is not None:
                raise FileNotFoundError(ENOENT, "was removed while it was recorded to", str(self.folder / name))
        self._unsynced.clear()

    def end(self) -> None:
        self.sync()
        self.close()
        self.folder = None

    def close(self) -> None:
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
