"""SHELL: the recording of the flight: received messages and frames, sent messages, and the target lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.strip_signature import unsigned, without_signature
from fwav_companion.recording.events import began_with_line, end_line, refused_line
from fwav_companion.recording.line_types import Line
from fwav_companion.recording.recorder import Recorder
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.service.timer import HostClock
from fwav_companion.types import Frame, NoFrame, Reason
from fwav_companion.vision.wire import encode_frame, stamp_line


class Journal:
    """Passes events to the recorder, on the recording's clock, in the order in which a replay repeats them."""

    def __init__(self, recorder: Recorder | None, clock: HostClock) -> None:
        """``recorder``: None if recording is off."""
        self._recorder = recorder
        self.records = recorder is not None
        """Whether recording is on."""
        self._clock = clock
        self._refused: Counter[Reason] = Counter()
        self._pictures = 0

    def start(self, kept: KeptCalibration | None) -> None:
        """Start the recorder. ``kept``: calibration of an earlier flight, with which this one starts."""
        if self._recorder is None:
            return
        self._recorder.start()
        if kept is not None:
            unix_us = self._clock.unix_us(self._clock.now())
            self._recorder.detection(unix_us, began_with_line(unix_us, msgspec.to_builtins(kept)))

    def close(self, timeout_s: float) -> None:
        """Write the waiting data, for at most this time."""
        if self._recorder is not None:
            self._recorder.close(timeout_s)

    def received(self, frames: Sequence[RawFrame], now: HostNs) -> None:
        """Record received frames, without signatures and SETUP_SIGNING: no trace of a key."""
        if self._recorder is not None:
            for frame in frames:
                self._recorder.telemetry(self._clock.unix_us(now), unsigned(frame))

    def sent(self, frame: bytes, now: HostNs) -> None:
        """Record a message of the service once, whatever the number of its links."""
        if self._recorder is not None:
            self._recorder.telemetry(self._clock.unix_us(now), without_signature(frame))

    def frame(self, frame: Frame | NoFrame, now: HostNs) -> None:
        """Record a frame of detections; count a refused one for the next :meth:`tick`."""
        if isinstance(frame, NoFrame):
            self._refused[frame.reason] += 1
        elif self._recorder is not None:
            self._recorder.detection(self._clock.unix_us(now), encode_frame(frame, self._clock.unix_offset_ns))

    def picture(self, frame: Frame, jpeg: bytes) -> None:
        """Record a picture of the service's own camera. ``frame``: its stamp and number."""
        if self._recorder is not None:
            self._pictures += 1
            file = f"{self._pictures:06d}.jpg"
            self._recorder.picture(file, jpeg, stamp_line(frame, file, self._clock.unix_offset_ns))

    def found(self, lines: Sequence[Line], now: HostNs) -> None:
        """Record lines of the targets file."""
        if self._recorder is not None:
            for line in lines:
                self._recorder.target(self._clock.unix_us(now), line)

    def armed(self, armed: bool, now: HostNs) -> None:
        """Set the armed state, which may decide what is recorded; repeated calls have no effect."""
        if self._recorder is not None:
            self._recorder.on_armed(armed, self._clock.unix_us(now))

    def tick(self, now: HostNs) -> None:
        """Record the counts of refused frames, once a second."""
        if self._refused and self._recorder is not None:
            self._recorder.detection(self._clock.unix_us(now), refused_line(self._clock.unix_us(now), self._refused))
        self._refused.clear()

    def end(self, now: HostNs) -> None:
        """Record the end of the flight: no event follows."""
        if self._recorder is not None:
            self._recorder.detection(self._clock.unix_us(now), end_line(self._clock.unix_us(now)))

    @property
    def state(self) -> str | None:
        """State for the status file: the folder, why recording failed, or what it waits for; None if it is off."""
        return None if self._recorder is None else self._recorder.state
