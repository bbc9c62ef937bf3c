"""Selects the target by the operator's click, else by the configuration's rule. Pure.

A click refers to the picture that was on the operator's screen, :attr:`PublishOptions.video_delay_s` ago. It selects
the track whose mark it hits in that picture, or the track nearest to the clicked place on the ground.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import chain
from math import hypot
from typing import Protocol, TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import Vector3, add, larger_semi_axis, scale
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.types.sightings import GroundFix
from fwav_companion.types.spots import CLICK_LABEL
from fwav_companion.types.tracks import Track, TrackState

Locate: TypeAlias = Callable[[float, float, float, HostNs], GroundFix | None]
"""(u, v, sigma_px, host_ns) -> fix of the ground at that pixel of a picture of that instant; None where unknown."""


class Spots(Protocol):
    """Follows any spot of the picture by its appearance."""

    def follow(self, point: tuple[float, float], host_ns: HostNs, sigma_px: float) -> int | None:
        """Follow the spot at a pixel of the picture of this instant; returns its number, None where not possible."""

    def release_all(self) -> None:
        """Stop following every spot."""


PixelFromNed: TypeAlias = Callable[[Vector3], tuple[float, float] | None]
"""Pixel of a place in the image of the frame just processed; None outside the image."""

REPORTED_STATES = frozenset({TrackState.CONFIRMED, TrackState.COASTING})
MAX_PICTURES = 512
MAX_APART_NS = 100 * NS_PER_MS
"""Time from the clicked picture beyond which a picture shows another scene: half a beat at 5 Hz."""
FINGER = 0.03
"""Accuracy of a finger or mouse on a video, as a share of the image's width."""
GATE_SIGMAS = 3.0
DELAY_TOLERANCE_NS = 150 * NS_PER_MS
"""Error of [publish] video_delay_s, which people estimate by eye."""
TIE = 0.25
"""Difference of two distances, as a share of a click's accuracy, below which they count as equal."""


class Selection:
    """Chooses the selected target among the confirmed and coasting tracks of the newest frame."""

    def __init__(self, options: PublishOptions):
        self._by_rule = options.select == "best"
        self._label = options.label
        self._reported_tracks: dict[int, Track] = {}
        self._clicked: int | None = None
        self._awaited: int | None = None
        self._spot: int | None = None
        self._stopped = False

    @property
    def reported_tracks(self) -> dict[int, Track]:
        """Confirmed and coasting tracks after the newest frame, by id."""
        return self._reported_tracks

    @property
    def by_click(self) -> bool:
        """Whether the operator chose the selected track."""
        return self._clicked is not None or self._awaited is not None

    @property
    def awaits_spot(self) -> bool:
        """Whether a clicked spot has no track yet, or has none again."""
        return self._awaited is not None

    @property
    def selected(self) -> Track | None:
        """The selected track; None where no track is eligible, or the operator stopped the tracking."""
        if self._clicked is not None:
            return self._reported_tracks.get(self._clicked)
        if self._stopped or self._awaited is not None or not self._by_rule:
            return None
        eligible = (track for track in self._reported_tracks.values() if self._label in {"", track.label})
        return min(eligible, key=seniority, default=None)

    def on_tracks(self, tracks: tuple[Track, ...]) -> None:
        """Take the tracks after a frame."""
        self._reported_tracks = {track.id: track for track in tracks if track.state in REPORTED_STATES}
        if self._clicked is not None and self._clicked not in self._reported_tracks:
            self._clicked = successor(self._clicked, self._reported_tracks.values())
            if self._clicked is None:
                self._awaited = self._spot
        if self._awaited is not None:
            found = next((track for track in self._reported_tracks.values() if shows_spot(track, self._awaited)), None)
            if found is not None:
                self._clicked, self._awaited = found.id, None

    def click(self, track_id: int) -> None:
        """Select this track by the operator's choice."""
        self._clicked, self._awaited, self._spot, self._stopped = track_id, None, None, False

    def click_spot(self, spot: int) -> None:
        """Select the track of a clicked spot once the spot has a confirmed track; no track until then."""
        self._clicked, self._awaited, self._spot, self._stopped = None, spot, spot, False

    def forget_spot(self, spot: int) -> None:
        """Undo the choice of a spot that cannot be followed: the choice is as before any click."""
        if self._spot == spot:
            self._awaited, self._spot = None, None

    def stop(self) -> None:
        """Select no track until the next click."""
        self._clicked, self._awaited, self._spot, self._stopped = None, None, None, True


def shows_spot(track: Track, spot: int) -> bool:
    """Whether the track's fix in the newest frame is a detection of this clicked spot."""
    return track.fix is not None and track.label == CLICK_LABEL and track.fix.sighting.detection.detector_id == spot


def successor(ended: int, tracks: Iterable[Track]) -> int | None:
    """Id of the track that an ended track was merged into; None where it was not merged."""
    return next((track.id for track in tracks if ended in track.replaces), None)


def seniority(track: Track) -> tuple[int, int]:
    """Sort key by the instant of confirmation: the oldest first."""
    confirmed_ns = track.confirmed_host_ns if track.confirmed_host_ns is not None else track.host_ns
    return (confirmed_ns, track.id)


# Clicks.


class Mark(msgspec.Struct, frozen=True, gc=False):
    """Mark of one track in one picture."""

    track: int
    at: tuple[float, float]
    """Position in the image, pixels."""
    box: tuple[float, float, float, float] | None


class Pictures:
    """Marks of the tracks in the last few hundred pictures."""

    def __init__(self, size: tuple[int, int]):
        self._size = size
        self._pictures: deque[tuple[HostNs, tuple[Mark, ...]]] = deque(maxlen=MAX_PICTURES)

    @property
    def finger_px(self) -> float:
        """Accuracy of a click, pixels."""
        return FINGER * self._size[0]

    def add(self, host_ns: HostNs, marks: Iterable[Mark]) -> None:
        """Keep the marks of a processed frame."""
        self._pictures.append((host_ns, tuple(marks)))

    def track_at(self, host_ns: HostNs, point: tuple[float, float], reach_px: float) -> int | None:
        """The nearest track whose mark or box is within reach of the point, in the picture of that instant."""
        hits = [
            (hypot(mark.at[0] - point[0], mark.at[1] - point[1]), mark.track)
            for mark in self._marks(host_ns)
            if _distance(mark, point) <= max(reach_px, self.finger_px)
        ]
        return min(hits)[1] if hits else None

    def tracks_about(self, host_ns: HostNs, point: tuple[float, float], reach_px: float) -> list[int]:
        """Tracks within reach in the pictures around that instant, because the delay of the video is not exact.

        Either the nearest track alone, or all tracks that a click cannot distinguish from it. The newest picture is
        included if it is later than the instant.
        """
        nearest: dict[int, float] = {}
        about = [marks for at, marks in self._pictures if abs(at - host_ns) <= DELAY_TOLERANCE_NS]
        reported = [marks for at, marks in list(self._pictures)[-1:] if at >= host_ns]
        for mark in chain.from_iterable(about + reported):
            apart_px = _distance(mark, point)
            if apart_px <= max(reach_px, self.finger_px):
                nearest[mark.track] = min(apart_px, nearest.get(mark.track, apart_px))
        least = min(nearest.values(), default=0.0)
        return [track for track, apart_px in nearest.items() if apart_px <= least + TIE * self.finger_px]

    def track_in(self, host_ns: HostNs, low: tuple[float, float], high: tuple[float, float]) -> int | None:
        """The track nearest to the rectangle's middle among those inside it, with a tolerance of a finger's width."""
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
    """The track nearest to a clicked place on the ground, within three sigma of both errors."""
    hits = []
    for track in tracks:
        place = track.apparent_ned
        if track.velocity_ned is not None:
            place = add(place, scale(track.velocity_ned, s_from_ns(host_ns - track.host_ns)))
        apart_m = hypot(place[0] - fix.position_ned[0], place[1] - fix.position_ned[1])
        reach_m = GATE_SIGMAS * hypot(larger_semi_axis(fix.relative_cov), larger_semi_axis(track.relative_cov))
        if apart_m <= reach_m:
            hits.append((apart_m, track.id))
    return min(hits)[1] if hits else None


def moment_of_click(now: HostNs, video_delay_s: float) -> HostNs:
    """Capture time of the picture that the operator saw."""
    return HostNs(now - ns_from_s(video_delay_s))


def _distance(mark: Mark, point: tuple[float, float]) -> float:
    """Distance from the point to the mark's box in pixels, 0 inside; to the mark where it has no box."""
    left, top, right, bottom = mark.box if mark.box is not None else (*mark.at, *mark.at)
    u, v = point
    return hypot(max(left - u, 0.0, u - right), max(top - v, 0.0, v - bottom))
