"""SHELL: plays a recording into the picture at 1 to 20 times its speed. The recording's clock is the picture's."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from fwav_companion.errors import InputFileError
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.recorded_lines import PictureLine, RecordedLine, RecordedLines
from fwav_companion.on_disk import open_regular
from fwav_companion.recording.line_decoder import LineDecoder
from fwav_companion.recording.line_types import HeaderLine, line_unix_s

MAX_LINE_BYTES = 4_000_000
TURN_S = 0.03
"""CPU time of a tick, seconds, after which no line is begun, so that the page stays responsive at any density of lines,
and it takes a third of a processor at most."""
LONGEST_PAUSE_S = 86_400.0
"""Longest time between two lines: the time of a line beyond it is damaged, and would hold up all that follow."""
NUMBER_ERRORS = (ValueError, ArithmeticError)
"""Errors that the numbers of a whole line can cause."""
ACCEPTED = "accepted: a targets file of `run`, `replay` or `demo`, or a recording of `ground --record`"


class ReplayReader:
    """Plays one file."""

    def __init__(self, path: str, picture: GroundPicture, speed: float) -> None:
        """InputFileError where the file cannot be read or is not a recording."""
        self._path, self._picture, self._speed = path, picture, speed
        self._lines = RecordedLines(picture)
        self._decoder: LineDecoder[RecordedLine] = LineDecoder(RecordedLine)
        self._implausible = 0
        """Whole lines that were left out for their numbers."""
        try:
            self._file = open_regular(Path(path))  # it is read over the whole run
        except OSError as error:
            raise InputFileError(f"{path}: {error.strerror}; {ACCEPTED}") from None
        self._source = self._lines_by_time(self._file)
        self._next: tuple[float, RecordedLine | None] | None = next((each for each in self._source if each[1]), None)
        if self._next is None:
            self._file.close()
            raise InputFileError(f"{path}: is not a recording, or has no line with a time; {ACCEPTED}")
        self._start_unix = self._newest_unix = self._next[0]
        self._began_s: float | None = None
        self._reported = 0

    def now(self) -> float:
        """Time of the recording."""
        if self._began_s is None:
            return self._start_unix
        if self._next is None:
            return self._newest_unix
        return self._start_unix + (time.monotonic() - self._began_s) * self._speed

    def start(self) -> None:
        """Begin to play."""
        self._began_s = time.monotonic()
        self._say(f"plays at {self._speed:g}x")

    def tick(self, now: float) -> None:
        """Process the lines up to the present instant."""
        ends_s = time.thread_time() + TURN_S
        while self._next is not None and self._next[0] <= now:
            if time.thread_time() >= ends_s:
                return
            self._newest_unix, line = self._next
            self._next = next(self._source, None)
            if line is not None:
                self._take(line)
            if self._damaged != self._reported:
                self._reported = self._damaged
                self._say(f"plays at {self._speed:g}x")
            if self._next is None:
                self._say("has ended: this is its last state")

    @property
    def _damaged(self) -> int:
        """Lines that were left out."""
        return self._decoder.damaged + self._implausible

    def _take(self, line: RecordedLine) -> None:
        """Process a line; one with implausible numbers is left out, and counted."""
        try:
            self._lines.take(line, self._newest_unix)
        except NUMBER_ERRORS:
            self._implausible += 1

    def _say(self, text: str) -> None:
        damaged = f"; {self._damaged} damaged lines were left out" if self._damaged else ""
        self._picture.on_source(self._path, works=not self._damaged, text=text + damaged)

    def close(self) -> None:
        """Release the file."""
        self._file.close()

    def _lines_by_time(self, file: BinaryIO) -> Iterator[tuple[float, RecordedLine | None]]:
        """Lines with their times, which never decrease; a line without one belongs to the line before. None for each
        that is left out: any number of them may follow one another.
        """
        newest: float | None = None
        waiting: list[RecordedLine] = []
        while data := file.readline(MAX_LINE_BYTES):
            line = self._decoder.decode(data)
            if line is None:
                if newest is None and self._decoder.damaged:
                    return  # another kind of file
                yield newest or 0.0, None
                continue
            at = line.time_unix if isinstance(line, PictureLine) else line_unix_s(line, self._lines.offset_s)
            if at is not None and newest is not None and at > newest + LONGEST_PAUSE_S:
                self._implausible += 1
                yield newest, None
                continue
            if isinstance(line, HeaderLine):
                self._lines.offset_s = line.unix_offset_s
            if at is None and newest is None:
                waiting.append(line)
                continue
            newest = max(at or 0.0, newest or 0.0)
            for early in waiting:
                yield newest, early
            waiting.clear()
            yield newest, line
