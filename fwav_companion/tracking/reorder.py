"""Reordering of frames by capture time, with one final line of output for each frame.

Frames may come late and out of order. Each frame is inserted at its capture time: the tracker returns to its state
before that instant and processes the later frames again. So a late frame has exactly the effect that it would have had
in time. Half a second after its capture the line of a frame is settled. A frame that comes later than that is refused,
unless later frames are allowed and it is newer than all settled ones: the camera is late as a whole.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from typing import Any

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.types import FrameView, NoFrame, Reason, Track

WINDOW_NS = 500 * NS_PER_MS
MAX_WAITING = 128
"""Maximum number of frames in the window: half a second of the fastest camera a small board can read (240 frames/s)."""


class Settled(msgspec.Struct, frozen=True):
    """A frame with its final tracks: its line may be written."""

    view: FrameView
    tracks: tuple[Track, ...]
    unused_fixes: Mapping[Reason, int] = {}
    """Number of fixes that are assigned to no reported track, by reason."""


class _Placed(msgspec.Struct):
    """A frame inside the window."""

    host_ns: HostNs
    """Capture, host clock."""
    before: Any
    """State of the tracker before this frame."""
    after: Settled
    """The line of this frame, final if no earlier frame comes."""


class Reorder:
    """A window of half a second that puts frames in capture order for the tracker."""

    __slots__ = ("_latest_ns", "_placed", "_put_ns", "_settled", "_settled_to_ns", "tracker")

    def __init__(self, tracker: FrameTracker, latest_ns: int = WINDOW_NS) -> None:
        """``latest_ns``: age of a frame beyond which it is refused, at least the window."""
        self.tracker = tracker
        self._latest_ns = latest_ns
        self._put_ns = HostNs(0)
        """Instant at which the latest frame came."""
        self._placed: list[_Placed] = []
        """Frames in the window by capture; equal captures in the order of arrival."""
        self._settled: list[Settled] = []
        self._settled_to_ns: HostNs | None = None

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which the next line settles; None without a waiting frame."""
        if self._settled:
            return self._settled[0].view.host_ns
        return HostNs(max(self._placed[0].host_ns + WINDOW_NS, self._put_ns)) if self._placed else None

    def put(self, view: FrameView, now_ns: HostNs) -> tuple[Track, ...] | NoFrame:
        """The tracks at the newest capture, after all frames so far; or the reason why the frame is refused."""
        self._settle(now_ns)
        self._put_ns = now_ns
        refusal = self._refusal(view, now_ns)
        if refusal is not None:
            return NoFrame(refusal)
        place, views = len(self._placed), [view]
        if self._placed and view.host_ns < self._placed[-1].host_ns:
            place = bisect_right(self._placed, view.host_ns, key=lambda placed: placed.host_ns)
            views += [placed.after.view for placed in self._placed[place:]]
            self.tracker.restore(self._placed[place].before)
            del self._placed[place:]
        for each in views:
            before, tracks = self.tracker.snapshot(), self.tracker.on_frame(each)
            self._placed.append(_Placed(each.host_ns, before, Settled(each, tracks, self.tracker.unused_fixes)))
        return self._placed[-1].after.tracks

    def close(self, now_ns: HostNs) -> list[Settled]:
        """The lines that have settled by now, in the order of capture, each once."""
        self._settle(now_ns)
        settled, self._settled = self._settled, []
        return settled

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """Delete every track and settle all waiting frames. No earlier frame can be inserted after that."""
        self._settled.extend(placed.after for placed in self._placed)
        self._placed = []
        self._settled_to_ns = max(view.host_ns, self._settled_to_ns or view.host_ns)
        return self.tracker.drop_all(reason, view)

    def _settle(self, now_ns: HostNs) -> None:
        due = 0
        for placed in self._placed:  # by capture
            if placed.host_ns > now_ns - WINDOW_NS:
                break
            self._settled.append(placed.after)
            self._settled_to_ns = placed.host_ns
            due += 1
        del self._placed[:due]

    def _refusal(self, view: FrameView, now_ns: HostNs) -> Reason | None:
        settled_to_ns = self._settled_to_ns
        if view.host_ns <= now_ns - self._latest_ns or (settled_to_ns is not None and view.host_ns < settled_to_ns):
            return Reason.TOO_LATE
        for placed in reversed(self._placed):  # by capture
            if placed.host_ns < view.host_ns:
                break
            if placed.host_ns == view.host_ns and placed.after.view.frame == view.frame:
                return Reason.DUPLICATE_FRAME
        return Reason.TOO_MANY_FRAMES if len(self._placed) >= MAX_WAITING else None
