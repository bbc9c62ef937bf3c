"""The files of a recording that ``export`` reads: targets, pictures, detections and the camera."""

from __future__ import annotations

import heapq
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import msgspec

from fwav_companion.errors import InputFileError, UserError
from fwav_companion.recording.folder import DETECTIONS, PICTURES, STAMPS, TARGETS
from fwav_companion.recording.line_decoder import DAMAGE, targets_decoder
from fwav_companion.recording.line_types import Line, PlausibleSeconds

if TYPE_CHECKING:
    from fwav_companion.recording.exports.viewer_scene import Message

T = TypeVar("T")
FORMATS = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png", ".webp": "webp"}


class _FrameStamp(msgspec.Struct):
    """What the lines of stamps and detections have in common."""

    frame: int | None = None
    time_unix: PlausibleSeconds | None = None
    received_unix: PlausibleSeconds | None = None

    @property
    def unix_ns(self) -> int | None:
        """The exposure, else the arrival, on the recording's clock."""
        seconds = self.received_unix if self.time_unix is None else self.time_unix
        return None if seconds is None else max(0, round(seconds * 1e6) * 1000)


class _PictureStamp(_FrameStamp):
    """A line of stamps, with what export reads of it."""

    file: str = ""

    @property
    def name(self) -> str:
        """The name without its folder."""
        return self.file.rpartition("/")[2]


class _DetectedFrame(_FrameStamp):
    """A line of detections, with what export reads of it."""

    detections: msgspec.Raw = msgspec.Raw(b"[]")


class RecordedFlight:
    """One recording, read line by line. A line that is no JSON is left out and counted: kill -9 cuts the last one."""

    def __init__(self, path: Path) -> None:
        is_folder = path.is_dir()
        self._folder = path if is_folder else None
        self._targets = path / TARGETS if is_folder else path
        self._decoder = targets_decoder()
        self._damaged = 0
        """Lines of stamps and detections that are not whole."""
        if not self._targets.is_file():
            wanted = f"it has no {TARGETS}" if is_folder else "no such file"
            raise InputFileError(f"{path}: {wanted}; accepted: a recording's folder, or a targets file")

    @property
    def files(self) -> set[Path]:
        """The inputs."""
        return {self._targets.resolve()}

    @contextmanager
    def watched(self) -> Iterator[Iterator[Line]]:
        """The lines of the targets file; on a terminal with a bar by bytes."""
        if not sys.stderr.isatty():
            yield self._target_lines(_ignore)
            return
        from rich.console import Console
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task("export", total=self._targets.stat().st_size)
            yield self._target_lines(lambda count: progress.advance(task, count))

    def messages(self, lines: Iterable[Line]) -> Iterator[Message]:
        """All messages for viewers, by time."""
        from fwav_companion.recording.exports.viewer_messages import ViewerMessages

        viewer = ViewerMessages()
        messages = chain.from_iterable(map(viewer.of_line, lines))
        if self._folder is None:
            return messages
        rare = heapq.merge(self._calibrations(), self._pictures(), self._annotations(), key=itemgetter(1))
        return _merged(messages, rare)

    def pictures_by_frame(self) -> dict[int, Path]:
        """The paths of the recorded pictures, by frame number."""
        return {each.frame: file for each, file in self._stamped if each.frame is not None}

    def print_damage(self) -> None:
        """Report lines that were left out."""
        damaged = self._damaged + self._decoder.damaged
        for count, why in (
            (damaged, "incomplete and left out: the recording was cut off"),
            (self._decoder.unknown, "of a type that this version does not know, and left out"),
        ):
            if count:
                print(f"NOTE: {count} {'line is' if count == 1 else 'lines are'} {why}", file=sys.stderr)

    def _target_lines(self, advance: Callable[[int], None]) -> Iterator[Line]:
        with self._targets.open("rb") as file:
            for raw in file:
                advance(len(raw))
                line = self._decoder.decode(raw)
                if line is not None:
                    yield line

    def _decoded(self, path: Path, decoder: msgspec.json.Decoder[T]) -> Iterator[T]:
        with path.open("rb") as file:
            for raw in file:
                try:
                    line = decoder.decode(raw)
                except DAMAGE:
                    self._damaged += 1
                    continue
                yield line

    @cached_property
    def _stamped(self) -> list[tuple[_PictureStamp, Path]]:
        """The stamps of the pictures that exist, with their paths. Read once: three readers want them."""
        if self._folder is None or not (self._folder / STAMPS).is_file():
            return []
        files = (file for file in (self._folder / PICTURES).iterdir() if file.suffix.lower() in FORMATS)
        pictures = {file.name: file for file in files if file.is_file()}  # a pipe would never end
        stamped = self._decoded(self._folder / STAMPS, msgspec.json.Decoder(_PictureStamp))
        return [(each, pictures[each.name]) for each in stamped if each.name in pictures]

    def _pictures(self) -> Iterator[Message]:
        from fwav_companion.recording.exports.viewer_messages import image

        for each, file in self._stamped:
            if (at_ns := each.unix_ns) is not None:
                yield image(at_ns, file.read_bytes(), FORMATS[file.suffix.lower()])

    def _annotations(self) -> Iterator[Message]:
        """The detections of the frames with a picture: drawn into an older picture they would mislead."""
        from fwav_companion.recording.exports.viewer_messages import DrawnDetection, drawn_detections

        kept, decoder = self.pictures_by_frame().keys(), msgspec.json.Decoder(list[DrawnDetection])
        if self._folder is None or not kept or not (self._folder / DETECTIONS).is_file():
            return
        for each in self._decoded(self._folder / DETECTIONS, msgspec.json.Decoder(_DetectedFrame)):
            if each.frame in kept:  # the others are many, and their detections are not looked at
                try:
                    drawn = decoder.decode(each.detections)
                except DAMAGE:
                    self._damaged += 1
                    continue
                if (at_ns := each.unix_ns) is not None:
                    yield drawn_detections(at_ns, drawn)

    def _calibrations(self) -> Iterator[Message]:
        """The lens, at the instant of the first picture; nothing for a lens that viewers have no model of."""
        from fwav_companion.camera.brown_conrady import BrownConrady
        from fwav_companion.config import load
        from fwav_companion.recording.exports.viewer_messages import camera_calibration
        from fwav_companion.service.configured_files import load_calibration, recorded_configuration

        first = next(self._pictures(), None)
        if self._folder is None or first is None:
            return
        try:
            name, camera = recorded_configuration(self._folder)
            lens = load_calibration(load(name, camera)).lens
        except UserError as error:
            print(f"NOTE: without the camera's calibration: {error}", file=sys.stderr)
            return
        if isinstance(lens, BrownConrady) and not any(lens.distortion[5:]):
            (fx, fy), (cx, cy) = lens.focal, lens.principal_point
            matrix = [fx, lens.skew * fx, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
            yield camera_calibration(first[1], lens.image_size, matrix, list(lens.distortion[:5]))


def _ignore(_count: int) -> None:
    """Take the bytes read, without a progress bar."""


def _merged(many: Iterator[Message], rare: Iterator[Message]) -> Iterator[Message]:
    """Both by time, at one comparison a message; of equal times ``many`` comes first."""
    after = next(rare, None)
    for message in many:
        while after is not None and after[1] < message[1]:
            yield after
            after = next(rare, None)
        yield message
    if after is not None:
        yield after
        yield from rare
