"""SHELL: carries messages between the pipeline, the recording and the camera process."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.service.journal import Journal
from fwav_companion.service.log import warn
from fwav_companion.service.timer import HostClock
from fwav_companion.types import Frame
from fwav_companion.types.spots import SpotMessage, SpotRefused
from fwav_companion.vision.supervisor import VisionProcess
from fwav_companion.vision.wire import parse_frame

_encode = msgspec.json.Encoder().encode


class CameraDesk:
    """Answers the camera process, records its pictures, and hands it the pipeline's orders."""

    def __init__(self, pipeline: Pipeline, clock: HostClock, journal: Journal, flush: Callable[[HostNs], None]) -> None:
        """``flush``: sends the pipeline's outputs."""
        self._pipeline = pipeline
        self._clock = clock
        self._journal = journal
        self._flush = flush
        self.vision: VisionProcess | None = None
        """The camera process, once it is made."""

    def on_question(self, data: bytes) -> None:
        """Answer where a picture of the camera process, a frame in the wire format, shows the spots."""
        now = self._clock.now()
        frame = self._frame(data, now)
        if frame is not None and self.vision is not None:
            self.vision.send(_encode(self._pipeline.spot_views(frame, now)))
            self._flush(now)

    def on_shown(self, data: bytes) -> None:
        """Answer where a picture of the preview, a frame in the wire format, shows the tracks."""
        now = self._clock.now()
        frame = self._frame(data, now)
        if frame is not None and self.vision is not None:
            self.vision.send(_encode(self._pipeline.track_marks(frame, now)))
            self._flush(now)

    def on_picture(self, data: bytes, jpeg: bytes) -> None:
        """Record a picture. ``data``: its frame in the wire format."""
        frame = self._frame(data, self._clock.now())
        if frame is not None:
            self._journal.picture(frame, jpeg)

    def on_refused(self, refused: SpotRefused) -> None:
        """Report a spot that the camera process cannot follow to the pipeline."""
        now = self._clock.now()
        self._pipeline.on_spot_refused(refused, now)
        self._flush(now)

    def send(self, orders: Iterable[SpotMessage]) -> None:
        """Send the pipeline's orders to the camera process."""
        for order in orders:
            if self.vision is not None and not self.vision.send(_encode(order)):
                warn("the camera process takes no order: the click is not followed")

    def restart(self) -> None:
        """Replace the camera process: internal faults repeated, and its messages may be their cause."""
        if self.vision is not None:
            self.vision.restart()

    def _frame(self, data: bytes, now: HostNs) -> Frame | None:
        frame = parse_frame(data, now, self._clock.wall)
        return frame if isinstance(frame, Frame) else None
