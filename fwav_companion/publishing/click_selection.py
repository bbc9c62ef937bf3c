"""What was under the operator's finger: a click means the picture that was on the screen, some time ago."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from math import hypot
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import Vector3, add, larger_semi_axis, scale
from fwav_companion.types.sightings import GroundFix
from fwav_companion.types.tracks import Track

Locate: TypeAlias = Callable[[float, float, float, HostNs], GroundFix | None]
"""(u, v, sigma_px, host_ns) -> the ground under that pixel of a picture taken then, None where there is no telling."""
PixelFromNed: TypeAlias = Callable[[Vector3], tuple[float, float] | None]
"""Where a place would be in the image of the frame just processed; None outside."""

MAX_PICTURES = 512
MAX_APART_NS = 100 * NS_PER_MS
"""A picture further than this from the one that was clicked shows another scene: half a flap at 5 Hz."""
FINGER = 0.03
"""Of the image's width: how well a finger or a mouse on a video hits."""
GATE_SIGMAS = 3.0


class Mark(msgspec.Struct, frozen=True, gc=False):
    """One track in one picture."""

    track: int
    at: tuple[float, float]
    """Pixels."""
    box: tuple[float, float, float, float] | None


class Pictures:
    """Where the tracks were in the last few hundred pictures, and which of them a click meant."""

    def __init__(self, size: tuple[int, int]):
        self._size = size
        self._pictures: deque[tuple[HostNs, tuple[Mark, ...]]] = deque(maxlen=MAX_PICTURES)

    @property
    def finger_px(self) -> float:
        """How far a click may miss."""
        return FINGER * self._size[0]

    def add(self, host_ns: HostNs, marks: Iterable[Mark]) -> None:
        """Remember a processed frame."""
        self._pictures.append((host_ns, tuple(marks)))

    def track_at(self, host_ns: HostNs, point: tuple[float, float], reach_px: float) -> int | None:
        """The track nearest to the point in the picture of that moment, if its mark or its box is within reach."""
        hits = [
            (hypot(mark.at[0] - point[0], mark.at[1] - point[1]), mark.track)
            for mark in self._marks(host_ns)
            if _distance(mark, point) <= max(reach_px, self.finger_px)
        ]
        return min(hits)[1] if hits else None

    def track_in(self, host_ns: HostNs, low: tuple[float, float], high: tuple[float, float]) -> int | None:
        """The track nearest to the middle of the rectangle, if it lies inside, a finger's width allowed."""
        middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))
        slack = self.finger_px
        hits = [
            (hypot(mark.at[0] - middle[0], mark.at[1] - middle[1]), mark.track)
            for mark in self._marks(host_ns)
            if all(a - slack <= at <= b + slack for a, at, b in zip(low, mark.at, high, strict=True))
        ]
        return min(hits)[1] if hits else None

    def _marks(self, host_ns: HostNs) -> tuple[Mark, ...]:
        nearest = min(self._pictures, key=lambda picture: abs(picture[0] - host_ns), default=None)
        return nearest[1] if nearest is not None and abs(nearest[0] - host_ns) <= MAX_APART_NS else ()


def track_on_ground(fix: GroundFix, host_ns: HostNs, tracks: Iterable[Track]) -> int | None:
    """The track nearest to a clicked place on the ground, where both could be one target: within three sigma."""
    hits = []
    for track in tracks:
        place = track.position_ned
        if track.velocity_ned is not None:
            place = add(place, scale(track.velocity_ned, s_from_ns(host_ns - track.host_ns)))
        apart_m = hypot(place[0] - fix.position_ned[0], place[1] - fix.position_ned[1])
        reach_m = GATE_SIGMAS * hypot(larger_semi_axis(fix.relative_cov), larger_semi_axis(track.relative_cov))
        if apart_m <= reach_m:
            hits.append((apart_m, track.id))
    return min(hits)[1] if hits else None


def moment_of_click(now: HostNs, video_delay_s: float) -> HostNs:
    """When the picture that the operator saw was taken."""
    return HostNs(now - ns_from_s(video_delay_s))


def _distance(mark: Mark, point: tuple[float, float]) -> float:
    """From the point to the mark's box, 0 inside; to the mark itself where it has no box."""
    left, top, right, bottom = mark.box if mark.box is not None else (*mark.at, *mark.at)
    u, v = point
    return hypot(max(left - u, 0.0, u - right), max(top - v, 0.0, v - bottom))
