"""Divides a recording into folders, by arming and by size. PURE: every record comes with its time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, Literal

import msgspec

US_PER_S: Final = 1_000_000
BEFORE_ARMING_US: Final = 30 * US_PER_S
"""Duration of the records held in memory while disarmed with ``when = "armed"``: the clock settles in five seconds, an
autopilot is adopted in three, and rare messages (HOME_POSITION) come every five, so a replay has all of them before the
take-off."""
MOST_BEFORE_BYTES: Final = 2 << 20
"""Most bytes held in memory: 30 s of a busy 921 600 baud link. Memory is scarce: the oldest records are discarded
first."""
AFTER_DISARMING_US: Final = 10 * US_PER_S
"""Time that is recorded after disarming, to show what follows a crash."""
MOST_FOLDER_BYTES: Final = 512 << 20
"""Size at which the next folder begins, about three hours of a flight, so that tools can still open whole files."""


class SpanRecord(msgspec.Struct, frozen=True, gc=False):
    """Bytes for one file of the recording."""

    at_us: int
    file: str
    data: bytes
    is_header: bool = False
    """Whether the bytes are the first line of a targets file."""


class PictureRecord(msgspec.Struct, frozen=True, gc=False):
    """A kept picture: a file of its own, and its line in the file of stamps."""

    file: str
    jpeg: bytes
    line: bytes

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return len(self.jpeg) + len(self.line)


class BeginSpan(msgspec.Struct, frozen=True):
    """Step: create a new folder."""


class EndSpan(msgspec.Struct, frozen=True):
    """Step: complete the folder."""


Step = SpanRecord | PictureRecord | BeginSpan | EndSpan
FrameLine = Callable[[int], SpanRecord | None]
"""The header or the summary of a targets file at an instant; None while it is not known."""


class Spans:
    """Assigns records to folders. ``always``: a folder from the start, and another for each later arming.

    Each folder is complete in itself: its targets file begins with a header and, unless the service is killed, ends
    with a summary. The header contains the origin, and therefore waits for it, at most ten seconds after the first
    attitudes. No target has a position before that. A service that is killed earlier leaves an empty targets file with
    telemetry and detections, from which a replay makes the targets.
    """

    def __init__(
        self,
        when: Literal["always", "armed"],
        header: FrameLine,
        summary: FrameLine,
        most_folder_bytes: int = MOST_FOLDER_BYTES,
    ) -> None:
        self._when = when
        self._header = header
        self._summary = summary
        self._most_folder_bytes = most_folder_bytes
        self._open = False
        self._has_header = False
        self._folder_bytes = 0
        self._before: deque[SpanRecord] = deque()
        self._before_bytes = 0
        self._armed = False
        self._was_armed = False
        self._disarmed_us: int | None = None

    def on_armed(self, armed: bool, now_us: int) -> list[Step]:
        """Steps that follow from the arming state; repeated calls with one state have no effect."""
        if armed == self._armed:
            return []
        self._armed = armed
        if not armed:
            self._disarmed_us = now_us
            return []
        again, self._was_armed, self._disarmed_us = self._was_armed, True, None
        if self._when == "armed":
            return [] if self._open else self._begin(now_us)
        return self._begin(now_us) if again else []

    def on_record(self, record: SpanRecord) -> list[Step]:
        """Steps that follow from a record, in order."""
        steps: list[Step] = []
        if self._open and self._over(record.at_us):
            steps += self._end(record.at_us)
        if not self._open and self._when == "armed":
            self._hold(record)
            return steps
        if not self._open or self._folder_bytes + len(record.data) > self._most_folder_bytes:
            steps += self._begin(record.at_us)
        return steps + self._take(record)

    def on_picture(self, picture: PictureRecord) -> list[Step]:
        """Steps that follow from a picture: it is kept while a folder is open. No picture is held in memory."""
        return [picture] if self._open else []

    def begin_anew(self, now_us: int) -> list[Step]:
        """Steps after a failure to write the open folder: begin another one if records are kept at present."""
        self._open = False
        self._before.clear()
        self._before_bytes = 0
        return self._begin(now_us) if self._when == "always" or self._armed else []

    def _over(self, now_us: int) -> bool:
        return (
            self._when == "armed" and self._disarmed_us is not None and now_us - self._disarmed_us >= AFTER_DISARMING_US
        )

    def _begin(self, now_us: int) -> list[Step]:
        steps = self._end(now_us) if self._open else []
        self._open, self._has_header, self._folder_bytes = True, False, 0
        steps.append(BeginSpan())
        header = self._header(now_us)
        if header is not None:
            steps += self._take(header)
        while self._before:
            steps += self._take(self._before.popleft())
        self._before_bytes = 0
        return steps

    def _take(self, record: SpanRecord) -> list[Step]:
        if record.is_header:
            if self._has_header:
                return []
            self._has_header = True
        self._folder_bytes += len(record.data)
        return [record]

    def _end(self, now_us: int) -> list[Step]:
        self._open = False
        summary = self._summary(now_us) if self._has_header else None
        return [EndSpan()] if summary is None else [summary, EndSpan()]

    def _hold(self, record: SpanRecord) -> None:
        self._before.append(record)
        self._before_bytes += len(record.data)
        while self._before and (
            record.at_us - self._before[0].at_us > BEFORE_ARMING_US or self._before_bytes > MOST_BEFORE_BYTES
        ):
            self._before_bytes -= len(self._before.popleft().data)
