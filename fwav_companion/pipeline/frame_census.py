"""Census of all frames, used or refused: labels, the best score, and the age of the stamps at arrival. Pure."""

from __future__ import annotations

from collections import deque

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.pairing import TwoClocks
from fwav_companion.pipeline.stamp_series import StampSeries
from fwav_companion.types import Frame, StampClock
from fwav_companion.types.flight_status import HeardReport

MOST_LABELS = 16
"""Most labels that are counted: enough for a line of text. A detector may send any number."""
WINDOW_NS = 2 * NS_PER_S
WINDOWS = 6
"""Number of windows whose least age is kept. Jitter only adds to an age, and twelve seconds show a growing queue."""


class FrameCensus:
    """Counts labels and scores over all frames, and keeps the ages of the stamps of the last seconds."""

    def __init__(self) -> None:
        self._labels: dict[str, int] = {}
        self._best_score: float | None = None
        self._ages_ns: deque[int] = deque(maxlen=WINDOWS)
        self._window_ns: HostNs | None = None
        self._least_ns: int | None = None
        self._stamps = StampSeries()

    def add(self, frame: Frame, clock: TwoClocks) -> None:
        """Take one frame as it arrived."""
        for detection in frame.detections:
            label = detection.label
            if label in self._labels or len(self._labels) < MOST_LABELS:
                self._labels[label] = self._labels.get(label, 0) + 1
            if detection.score is not None and (self._best_score is None or detection.score > self._best_score):
                self._best_score = detection.score
        if frame.arrival_ns is not None:
            self._stamps.add(frame, frame.arrival_ns)
            self._add_age(frame, frame.arrival_ns, clock)

    def status(self) -> HeardReport:
        """Return the census for the status; ages of the finished windows, the oldest first."""
        ages_s = [age_ns / NS_PER_S for age_ns in self._ages_ns]
        return HeardReport(
            labels=dict(self._labels),
            best_score=self._best_score,
            stamp_ages_s=ages_s,
            repeated_stamps=self._stamps.repeated,
            jumped_stamps=self._stamps.jump_count,
        )

    def _add_age(self, frame: Frame, arrival_ns: HostNs, clock: TwoClocks) -> None:
        on_host = frame.stamp_clock is StampClock.HOST
        stamp_ns = frame.stamp_ns if on_host else clock.host_from_boot(BootNs(frame.stamp_ns))
        if not isinstance(stamp_ns, int):
            return
        age_ns = arrival_ns - stamp_ns
        if self._window_ns is None:
            self._window_ns = arrival_ns
        if arrival_ns - self._window_ns >= WINDOW_NS:
            if self._least_ns is not None:
                self._ages_ns.append(self._least_ns)
            self._window_ns, self._least_ns = arrival_ns, None
        self._least_ns = age_ns if self._least_ns is None else min(self._least_ns, age_ns)
