"""SHELL: writes recordings in a thread of its own, so that a slow or full disk never delays the loop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from fwav_companion.recording.folder import (
    BYTES_PER_MB,
    DETECTIONS,
    FILES,
    TARGETS,
    TELEMETRY,
    RecordingFiles,
    RecordingPlan,
    SpaceError,
    lack_of_room,
)
from fwav_companion.recording.line_types import HeaderLine, Line
from fwav_companion.recording.lines import encode_line
from fwav_companion.recording.spans import BeginSpan, PictureRecord, SpanRecord, Spans, Step
from fwav_companion.recording.tlog import tlog_record

MAX_WAITING_BYTES = 8 << 20
"""Largest queue, for a disk that hangs: over a minute of a busy 921 600 baud link with all its lines."""
MOST_PICTURE_BYTES = MAX_WAITING_BYTES // 2
"""Size of the queue from which pictures are left out, so that room remains for the flight's data."""
ROOM_TO_GO_ON_BYTES = 20 * BYTES_PER_MB
"""Free space with which a stopped recording continues: some minutes, so that it does not stop again within seconds."""

WAITS: Final = {
    "armed": 'waits for the vehicle to be armed ([record] when = "armed")',
    "always": "waits for something to record",
}
"""Texts on the event that a recording waits for, by [record] when."""


def _no_line() -> Line | None:
    """None: no header or summary is known."""
    return None


class Recorder:
    """Records flights into folders. Methods only queue; ``on_failure`` is called once when data is lost.

    After a stop, for example on a full disk, the recording continues in a new folder when there is room again.
    """

    def __init__(
        self,
        plan: RecordingPlan,
        on_failure: Callable[[str], None],
        *,
        on_news: Callable[[str], None] | None = None,
        header: Callable[[], Line | None] = _no_line,
        summary: Callable[[], Line | None] = _no_line,
    ) -> None:
        """``on_failure`` is called at each stop, ``on_news`` for each folder that is removed to make room and each
        time the recording continues; both from the recorder's thread.

        ``header`` and ``summary`` give the present first and last line of a targets file, on the caller's thread.
        """
        self._plan = plan
        self._on_failure = on_failure
        self._on_news = on_news or on_failure
        self._spans = Spans(
            plan.when,
            lambda at_us: _frame_record(at_us, header(), is_header=True),
            lambda at_us: _frame_record(at_us, summary()),
        )
        self._waiting: list[Step] = []
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._begins_anew = False
        self._pictures_slow = False
        self._pictures_rest_until_s: float | None = None
        self.failure: str | None = None
        """Reason why the recording is stopped; None while it records."""
        self.folder: Path | None = None
        """The folder that is written; None while the recording waits."""
        # A daemon thread: a disk that hangs must not delay the end of the process.
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Start the recorder's thread."""
        self._thread.start()

    def telemetry(self, unix_us: int, frame: bytes) -> None:
        """Queue one MAVLink frame, sent or received."""
        self._put(SpanRecord(unix_us, TELEMETRY, tlog_record(unix_us, frame)))

    def detection(self, unix_us: int, line: bytes) -> None:
        """Queue one line of the detections."""
        self._put(SpanRecord(unix_us, DETECTIONS, line))

    def target(self, unix_us: int, line: Line) -> None:
        """Queue one line of the targets."""
        self._put(SpanRecord(unix_us, TARGETS, encode_line(line), isinstance(line, HeaderLine)))

    def picture(self, file: str, jpeg: bytes, line: bytes) -> None:
        """Queue a picture and its line of stamps. The picture is left out where the disk is too slow or too full."""
        picture = PictureRecord(file, jpeg, line)
        if self._waiting_bytes + picture.size > MOST_PICTURE_BYTES:
            if not self._pictures_slow:
                self._on_news("recording: pictures are left out: the disk is too slow for them ([record] pictures)")
            self._pictures_slow = True
        elif self.failure is None and not self._begins_anew:
            self._queue(self._spans.on_picture(picture))

    def on_armed(self, armed: bool, unix_us: int) -> None:
        """Begin or end a folder by the arming state; repeated calls with one state have no effect."""
        steps = self._spans.on_armed(armed, unix_us)
        if steps:
            self._queue(steps)

    def close(self, timeout_s: float) -> None:
        """Write the queue and end, within the timeout."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    @property
    def state(self) -> str:
        """Text for people: the folder, the reason of a stop, or what the recording waits for."""
        failure, folder = self.failure, self.folder  # the thread may change them meanwhile
        return failure or (WAITS[self._plan.when] if folder is None else str(folder))

    # On the caller's thread.

    def _put(self, record: SpanRecord) -> None:
        if self.failure is not None:
            return
        if self._begins_anew:
            self._begins_anew = False
            self._queue(self._spans.begin_anew(record.at_us))
        self._queue(self._spans.on_record(record))

    def _queue(self, steps: Iterable[Step]) -> None:
        """Queue the steps, each record completely or not at all."""
        with self._lock:
            if self.failure is not None:
                return
            for step in steps:
                self._waiting_bytes += _size(step)
                self._waiting.append(step)
            full = self._waiting_bytes > MAX_WAITING_BYTES
        if full:
            self._fail(f"the disk did not take {MAX_WAITING_BYTES >> 20} MiB in time")

    # In the recorder's thread.

    def _run(self) -> None:
        while self._write_until_failure():
            if not self._wait_for_room():
                return

    def _write_until_failure(self) -> bool:
        """Write until a failure (True) or until the recorder is closed (False)."""
        files = RecordingFiles(self._plan)
        try:
            files.prepare()
            stopping = False
            while not stopping and self.failure is None:
                # The files are synced twice in sync_s, so that a power cut loses at most that time.
                stopping = self._stop.wait(self._plan.sync_s / 2)
                self._write(files, self._take())
        except SpaceError as error:
            self._fail(str(error))
        except OSError as error:
            self._fail(f"{error.filename or self._plan.directory}: {error.strerror or error}")
        finally:
            files.close()
        return self.failure is not None

    def _wait_for_room(self) -> bool:
        """Wait until the recording can continue (True) or until the recorder is closed (False).

        Meanwhile the failure says what is missing now: figures of the stop would be wrong after room has come back.
        """
        while not self._stop.wait(self._plan.retry_s):
            lack = lack_of_room(self._plan, ROOM_TO_GO_ON_BYTES)
            if lack:
                self.failure = f"recording stopped: {lack}"
            else:
                self._begins_anew, self.failure = True, None
                self._on_news(f"recording continues in {self._plan.directory}")
                return True
        return False

    def _write(self, files: RecordingFiles, steps: list[Step]) -> None:
        for step in _joined(steps):
            if isinstance(step, SpanRecord):
                self._report_removed(files.write(step))
            elif isinstance(step, PictureRecord):
                self._write_picture(files, step)
            elif isinstance(step, BeginSpan):
                files.begin()
            else:
                files.end()
            self.folder = files.folder
        files.sync()

    def _write_picture(self, files: RecordingFiles, picture: PictureRecord) -> None:
        """Write a picture; without room for it the rest of the recording continues."""
        if self._pictures_rest_until_s is not None and time.monotonic() < self._pictures_rest_until_s:
            return
        try:
            self._report_removed(files.write_picture(picture))
        except SpaceError as error:
            if self._pictures_rest_until_s is None:
                self._on_news(f"recording: no more pictures are kept, all else is: {error}")
            self._pictures_rest_until_s = time.monotonic() + self._plan.retry_s

    def _report_removed(self, removed: Iterable[Path]) -> None:
        for folder in removed:
            self._on_news(f"recording: removed the oldest, {folder}, to make room")

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


def _frame_record(at_us: int, line: Line | None, *, is_header: bool = False) -> SpanRecord | None:
    return None if line is None else SpanRecord(at_us, TARGETS, encode_line(line), is_header)


def _size(step: Step) -> int:
    """Bytes of a step in the queue."""
    if isinstance(step, PictureRecord):
        return step.size
    return len(step.data) if isinstance(step, SpanRecord) else 0


def _joined(steps: Iterable[Step]) -> list[Step]:
    """The steps, with consecutive records of each file joined: one system call, not hundreds."""
    joined: list[Step] = []
    pictures: list[PictureRecord] = []
    pieces: dict[str, list[bytes]] = {}

    def settle() -> None:
        # The inputs of a target's line reach the disk before the line does.
        joined.extend(SpanRecord(0, name, b"".join(pieces[name])) for name in FILES if name in pieces)
        joined.extend(pictures)
        pieces.clear()
        pictures.clear()

    for step in steps:
        if isinstance(step, SpanRecord):
            pieces.setdefault(step.file, []).append(step.data)
        elif isinstance(step, PictureRecord):
            pictures.append(step)
        else:
            settle()
            joined.append(step)
    settle()
    return joined
