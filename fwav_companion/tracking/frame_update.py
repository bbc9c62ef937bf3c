"""Update of the live tracks by one frame: each track is detected, missed, or out of view.

A camera delay beyond its prior displaces fixes by more than the gate. The fixes of one target then alternate between
its track and a new one. Such an error displaces all targets of a frame by about the same distance, and a displaced fix
is not evidence of another target.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import dist, hypot

import msgspec

from fwav_companion.geometry.vectors import subtract
from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.detector_ids import CERTAIN, IdTrust
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.standing import gates_of
from fwav_companion.tracking.frame_association import Taken
from fwav_companion.tracking.lifecycle import are_photographs, not_detected
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.track_state import LiveTrack, innovation
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import FrameView, GroundFix

DISPLACED_SIGMAS = 8.0
"""Largest displacement, sigmas: twice the gate. A camera late by three sigma displaces a fix by that distance."""
OFF_RATIO = 2.0
"""Largest ratio of two displacements in a frame. An angle displaces a fix in proportion to the square of the range over
the height: twice as far at 45 degrees as below the vehicle."""


class Absent(msgspec.Struct, frozen=True):
    """Confirmed tracks that a frame missed."""

    tracks: Sequence[LiveTrack]
    seen_off_m: float | None
    """Least distance of a fix from its own confirmed track in this frame, metres; None without such a fix."""

    def may_explain(self, fix: GroundFix) -> bool:
        """Whether the fix may be a displaced fix of one of these tracks."""
        label = fix.sighting.detection.label
        return any(_may_be_displaced(each.target, fix, self.seen_off_m) for each in self.tracks if each.label == label)


NONE_ABSENT = Absent((), None)
"""A frame that missed no track."""


class FrameUpdate(msgspec.Struct, frozen=True):
    """The update of all tracks by one frame."""

    view: FrameView
    choice: TargetChoice
    detector: DetectorModel
    corrects: bool
    """Whether self-calibration moves the tracks."""
    reports_innovations: bool
    id_trust: Mapping[int, IdTrust] = {}
    """Trust in the detector's id of the fix that a track took, by track id."""

    def after(self, predicted: Sequence[LiveTrack], taken: Taken) -> tuple[list[LiveTrack], list[LiveTrack]]:
        """The tracks after the frame, and the tracks of ``predicted`` that the frame missed."""
        unseen, missed, displaced = dict[int, LiveTrack](), list[LiveTrack](), NONE_ABSENT
        if len(taken) < len(predicted):
            unseen = {track.id: self._unseen(track) for track in predicted if track.id not in taken}
            missed = [t for t in predicted if t.id in unseen and unseen[t.id].life.misses > t.life.misses]
        if missed:
            displaced = absent(predicted, missed, taken, photographs=are_photographs(self.detector))
        after = [
            unseen[track.id] if track.id in unseen else self._seen(track, *taken[track.id], displaced)
            for track in predicted
        ]
        return reacquisition.reacquired(after, self.view.host_ns), missed

    def _unseen(self, track: LiveTrack) -> LiveTrack:
        """The track after a frame without a fix for it."""
        missed = is_missed_detection(self.view, track.label, self.choice.target(track), self._margin_m(track))
        missed = missed and not self._is_in_a_crowd(track)
        moving = track.target.velocity_cov is not None
        life = not_detected(track.life, self.view.host_ns, missed=missed, moving=moving, detector=self.detector)
        return track if life is track.life else msgspec.structs.replace(track, life=life, looked_for=missed)

    def _is_in_a_crowd(self, track: LiveTrack) -> bool:
        """Whether a confirmed track has a fix in its gate that association did not take, as false detections are dense.

        It may be the target's or not, so the frame shows neither a detection nor a miss.
        """
        if not (track.confirmed and track.label in self.detector.crowd.labels):
            return False
        fixes = [fix for fix in self.view.fixes if fix.sighting.detection.label == track.label]
        return any(gated.nis < GATE for gated in gates_of(track.target, fixes))

    def _margin_m(self, track: LiveTrack) -> float | None:
        """Largest likely displacement of the target in the image by the mount error, known and unknown, metres.

        None for a tentative track, because the likelihood ratio of clutter is 1 on average only if every look counts.
        """
        if not track.confirmed:
            return None
        calibrator = self.choice.calibrator if self.corrects else None
        return 0.0 if calibrator is None else calibrator.mount_off * track.slant_m

    def _seen(self, track: LiveTrack, fix: GroundFix, llr: float, missed: Absent) -> LiveTrack:
        """The track after a frame with a fix for it. ``missed``: confirmed tracks whose displaced fix this may be."""
        if not (track.confirmed or track.branch_of) and missed.may_explain(fix):
            llr = min(llr, 0.0)
        trust = self.id_trust.get(track.id, CERTAIN).trust
        after = track.updated(self.view.host_ns, fix, llr, self.detector, id_trust=trust)
        if not self.reports_innovations:
            return after
        apparent = msgspec.structs.replace(self.choice, vehicle=None)
        return msgspec.structs.replace(after, innovation=innovation(apparent.target(track), fix))


def absent(
    tracks: Sequence[LiveTrack],
    missed: Sequence[LiveTrack],
    taken: Taken,
    *,
    photographs: bool,
) -> Absent:
    """The confirmed tracks that a frame missed.

    Displacements are compared only in ``photographs``: among many frames, some show a displaced target in the place of
    another target.
    """
    confirmed = [track for track in missed if track.confirmed]
    if not (confirmed and photographs):
        return Absent(confirmed, None)
    seen = [track for track in tracks if track.confirmed and track.id in taken]
    off_m = [dist(taken[track.id][0].position_ned[:2], track.target.apparent_ned[:2]) for track in seen]
    return Absent(confirmed, min(off_m, default=None))


def _may_be_displaced(target: TargetState, fix: GroundFix, seen_off_m: float | None) -> bool:
    """Whether a fix lies within DISPLACED_SIGMAS of a target on both axes, without the vehicle's position errors.

    It must also be at most OFF_RATIO times as far from the target as ``seen_off_m``, the least distance of another fix
    from its own target.
    """
    own, other, reach2 = target.relative_cov, fix.relative_cov, DISPLACED_SIGMAS**2
    north, east, _ = subtract(fix.position_ned, target.apparent_ned)
    if seen_off_m is not None and hypot(north, east) > OFF_RATIO * seen_off_m:
        return False
    return north * north <= reach2 * (own[0][0] + other[0][0]) and east * east <= reach2 * (own[1][1] + other[1][1])
