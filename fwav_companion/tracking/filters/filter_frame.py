"""One frame of the tracker by filters of single targets: each filter gates, is updated and begins by itself."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fwav_companion.geometry.vectors import subtract
from fwav_companion.tracking.clutter import clutter
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import GATE, Filter, TargetState
from fwav_companion.tracking.frame_tracks import FrameTracks
from fwav_companion.tracking.lifecycle import are_photographs, initiated
from fwav_companion.tracking.live_track import LiveTrack
from fwav_companion.tracking.pair_assignment import FramePairs, TakenFix
from fwav_companion.types import FrameView
from fwav_companion.types.tracks import GateResult

DISPLACED_SIGMAS = 8.0
"""Largest displacement of a fix from its own target, sigmas: twice the gate. A camera late by three sigma displaces a
fix by that distance."""


class FilterTrack(LiveTrack, frozen=True, kw_only=True, gc=False):
    """One live track of a filter. Immutable."""

    target: TargetState
    """The filter's state, predicted to the newest frame."""


class FilterFrame(FrameTracks[FilterTrack]):
    """The tracks of one frame."""

    gate2 = GATE

    def __init__(
        self, tracks: Sequence[FilterTrack], view: FrameView, detector: DetectorModel, next_id: int,
        target_filter: Filter, *, reports_innovations: bool,
    ) -> None:  # fmt: skip
        """``tracks``: the live tracks, predicted to the frame."""
        super().__init__(tracks, view, detector, next_id, reports_innovations=reports_innovations)
        self._filter = target_filter
        self._gates: dict[tuple[int, int], GateResult] = {}
        """Pairs of a track id and a fix index that the gates accept."""
        if tracks and view.fixes:
            self._associate()

    def _associate(self) -> None:
        view, against = self._view, clutter(self._detector, self._view.image_px2)
        by_label: dict[str, list[int]] = {}
        for j, fix in enumerate(view.fixes):
            by_label.setdefault(fix.sighting.detection.label, []).append(j)
        for track in self._tracks:
            for j in by_label.get(track.label, ()):
                gated = track.target.gate(view.fixes[j])
                if gated.nis < GATE:
                    self._gates[track.id, j] = gated
        clutter_llr = [against.llr_of(fix) + against.detection_odds for fix in view.fixes]
        self._assign(FramePairs(view.fixes, against, self._gates, self._gates, clutter_llr))

    def _target(self, track: FilterTrack) -> TargetState:
        return track.target

    def _accepts(self, track: FilterTrack, fix: int) -> bool:
        return (track.id, fix) in self._gates

    def _is_shared(self, track: FilterTrack, fix: int) -> bool:
        """Whether the gate of another confirmed track accepts this fix, too.

        Static targets that are nearer to one another than their gates come into view one after the other. While
        branches of some of them wait for confirmation, the fixes of the next ones would go to the wrong tracks.
        """
        return any(
            other.confirmed and other.id != track.id and (other.id, fix) in self._gates for other in self._tracks
        )

    def _is_displaced(self, fix: int) -> bool:
        """Whether a fix may be a displaced one of a confirmed track that the frame missed.

        A camera delay beyond its prior displaces fixes by more than the gate. The fixes of one target then alternate
        between its track and a new one, and a displaced fix is no evidence of another target.
        """
        if are_photographs(self._detector):  # few of them: what one shows in a target's place is another target
            return False
        seen, reach2 = self._view.fixes[fix], DISPLACED_SIGMAS**2
        other, label = seen.relative_cov, seen.sighting.detection.label
        for track in [track for track in self.missed if track.label == label]:
            own, (north, east, _) = track.target.relative_cov, subtract(seen.position_ned, track.target.apparent_ned)
            near = north * north <= reach2 * (own[0][0] + other[0][0])
            if near and east * east <= reach2 * (own[1][1] + other[1][1]):
                return True
        return False

    def _seen(self, track: FilterTrack, took: TakenFix) -> FilterTrack:
        target = track.target.update(self._view.fixes[took.index])
        return msgspec.structs.replace(super()._seen(track, took), target=target)

    def _begin(self, fix: int, number: int, coasting: FilterTrack | None) -> FilterTrack:
        seen, life = self._view.fixes[fix], initiated(self._view.host_ns)
        target = self._filter.initiate(seen) if coasting is None else coasting.target.update(seen)
        label, detector_id = seen.sighting.detection.label, seen.sighting.detection.detector_id
        moving = target.velocity_cov is not None
        return FilterTrack(number, label, moving, life, seen, seen, detector_id=detector_id, target=target)
