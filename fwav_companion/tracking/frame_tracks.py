"""One frame of a tracker: which track has which fix, and which tracks begin, continue and end by it.

A coasting track whose gate is wide is not confirmed again by one detection, which may be false: the detection begins a
branch, a tentative track from the coasting one and this fix. A confirmed branch becomes its track (track splitting;
Smith & Buechler 1975).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import inf, log
from typing import ClassVar, Generic, TypeVar

import msgspec

from fwav_companion.geometry.vectors import ZERO33, Matrix3, subtract
from fwav_companion.tracking.crowd import NEW_TARGETS, Crowd
from fwav_companion.tracking.detector_ids import CERTAIN, IdTrust
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import ReportedTarget
from fwav_companion.tracking.id_pairs import IdPairs
from fwav_companion.tracking.lifecycle import are_photographs, detected, is_steady, not_detected
from fwav_companion.tracking.live_track import LiveTrack
from fwav_companion.tracking.pair_assignment import FramePairs, TakenFix, assigned, possible_costs
from fwav_companion.tracking.track_table import MAX_TRACKS, weakest_first
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import FrameView, Innovation, Reason, TrackState

WIDE = 4.0 * log(3.0)
"""Log determinant ratio of a gate three times as wide as the noise of a fix. In a narrower gate a false fix does little
harm, because a small gain moves the estimate by only a part of that noise."""
STATIC_REACQUISITION_LLR = log(20.0)
"""Log-likelihood ratio of a fix that confirms a static target again: with equal priors the fix is the target's at 95 %.
A higher threshold would cost self-calibration the first sights from each side."""

TrackT = TypeVar("TrackT", bound=LiveTrack)


class FrameTracks(ABC, Generic[TrackT]):
    """The tracks of one frame. A subclass knows their targets."""

    gate2: ClassVar[float]
    """Squared distance from which a fix is not a track's."""

    def __init__(
        self, tracks: Sequence[TrackT], view: FrameView, detector: DetectorModel, next_id: int,
        *, reports_innovations: bool,
    ) -> None:  # fmt: skip
        """``tracks``: the live tracks before the frame. ``next_id``: id of the next new track."""
        self._tracks, self._view, self._detector = tracks, view, detector
        self._reports_innovations = reports_innovations
        self.next_id = next_id
        self._branchings: dict[int, tuple[TrackT, float]] = {}
        """Coasting tracks by the index of a fix that is weak evidence for them, with its log-likelihood ratio."""
        self.taken: dict[int, TakenFix] = {}
        """By track id."""
        self.id_trust: dict[int, IdTrust] = {}
        """Trust in the detector's id of the fix that a track took, by track id."""
        self.left: list[int] = list(range(len(view.fixes)))
        """Indices of the fixes that no track took."""
        self.refused = self._strays = 0
        self.missed: list[TrackT] = []
        """Confirmed tracks, before the frame, that it covers without a fix for them."""

    @abstractmethod
    def _target(self, track: TrackT) -> ReportedTarget | None:
        """The target of a track at this frame; None where it has none."""

    @abstractmethod
    def _accepts(self, track: TrackT, fix: int) -> bool:
        """Whether the gate of a track accepts a fix."""

    def _margin_m(self, track: TrackT) -> float:  # noqa: ARG002 - a subclass knows errors of the camera
        """Largest likely displacement of a confirmed track's target in the image by errors of the camera, metres."""
        return 0.0

    @abstractmethod
    def _is_displaced(self, fix: int) -> bool:
        """Whether a tentative track's fix may be a displaced one of a track that the frame missed."""

    @abstractmethod
    def _begin(self, fix: int, number: int, coasting: TrackT | None, /) -> TrackT | None:
        """A tentative track from a fix; None where there can be none. ``coasting``: the track that it may continue."""

    def _branched_from(self, fix: int) -> tuple[TrackT | None, float]:
        """The track of which a fix begins a branch, if any, and the fix's log-likelihood ratio."""
        return self._branchings.get(fix, (None, 0.0))

    def _is_shared(self, track: TrackT, fix: int) -> bool:  # noqa: ARG002 - a subclass knows other tracks' gates
        """Whether a static track's fix may be another confirmed track's, so that it begins no branch."""
        return False

    def _renumber(self, branch: TrackT, new: int) -> None:
        """Count a branch as the track with the ``new`` id."""

    def _assign(self, pairs: FramePairs) -> None:
        """Assign the fixes to tracks."""
        tracks, view, ids = self._tracks, self._view, self._detector.ids
        costs = possible_costs(tracks, pairs, view.host_ns, self.gate2)
        # A branch has its first fix as evidence. Its coasting track would take every fix from it, for one more branch.
        branched = {track.branch_of for track in tracks if track.branch_of}
        preferred = {t.id for t in tracks if t.branch_of or (t.confirmed and t.id not in branched)}
        by_id = {track.id: track for track in tracks}

        def place_cov(track: LiveTrack) -> Matrix3:
            target = self._target(by_id[track.id])
            return ZERO33 if target is None else target.relative_cov

        def sees(track: LiveTrack) -> bool:
            target = self._target(by_id[track.id])
            return target is not None and view.could_see(target.apparent_ned)

        by_ids = IdPairs(by_id, view.fixes, ids, place_cov)
        self.taken = assigned(tracks, costs, pairs, preferred, sees, by_ids.with_bonus)
        self.id_trust = by_ids.trust_after({number: took.index for number, took in self.taken.items()}, costs)
        self._branch_off()
        used = {each.index for each in self.taken.values()}
        self.left = [j for j in range(len(view.fixes)) if j not in used]

    def _branch_off(self) -> None:
        """Take fixes that are weak evidence from coasting tracks: each begins a branch."""
        detector = self._detector
        if len(self._tracks) + len(self._view.fixes) > MAX_TRACKS:  # a branch must not take the place of a target
            return
        weak = []
        for track in self._tracks:
            took = self.taken.get(track.id)
            if took is None or track.life.state is not TrackState.COASTING or took.gate.log_det_ratio <= WIDE:
                continue
            needed = detector.confirming_llr(track.label) - log(detector.detection_probability)
            if not track.moving:  # of photographs one missed detection makes a track coast
                needed = min(-inf if are_photographs(detector) else STATIC_REACQUISITION_LLR, needed)
            if took.log_likelihood_ratio < needed and (track.moving or not self._is_shared(track, took.index)):
                weak.append(track)
        for track in weak:
            took = self.taken.pop(track.id)
            self._branchings[took.index] = (track, took.log_likelihood_ratio)

    def updated(self) -> list[TrackT]:
        """The tracks after the frame's fixes: each is detected, missed, or out of view."""
        unseen = {track.id: self._unseen(track) for track in self._tracks if track.id not in self.taken}
        self.missed = [
            t for t in self._tracks if t.id in unseen and t.confirmed and unseen[t.id].life.misses > t.life.misses
        ]
        return [unseen.get(track.id) or self._seen(track, self.taken[track.id]) for track in self._tracks]

    def _seen(self, track: TrackT, took: TakenFix) -> TrackT:
        """The track after a frame with a fix for it."""
        view, fix, llr = self._view, self._view.fixes[took.index], took.log_likelihood_ratio
        if not (track.confirmed or track.branch_of) and self._is_displaced(took.index):
            llr = min(llr, 0.0)
        number, innovation = fix.sighting.detection.detector_id, None
        target = self._target(track) if self._reports_innovations else None
        if target is not None:
            north_m, east_m, _ = subtract(fix.position_ned, target.apparent_ned)
            innovation = Innovation(north_m, east_m, took.gate.nis)
        return msgspec.structs.replace(
            track,
            life=detected(track.life, view.host_ns, llr, self._detector, track.label),
            last_fix=fix, fix=fix, looked_for=False, innovation=innovation,
            detector_id=track.detector_id if number is None else number,
            id_trust=track.id_trust if number is None else self.id_trust.get(track.id, CERTAIN).trust,
        )  # fmt: skip

    def _unseen(self, track: TrackT) -> TrackT:
        """The track after a frame without a fix for it."""
        view, target = self._view, self._target(track)
        missed = target is not None
        if target is not None:
            # A tentative track needs its place alone: the likelihood ratio of clutter is 1 only if every look counts.
            margin_m = self._margin_m(track) if track.confirmed else None
            missed = is_missed_detection(view, track.label, target, margin_m) and not self._is_in_a_crowd(track)
        life = not_detected(track.life, view.host_ns, missed=missed, moving=track.moving, detector=self._detector)
        return msgspec.structs.replace(track, life=life, fix=None, looked_for=missed, innovation=None)

    def _is_in_a_crowd(self, track: TrackT) -> bool:
        """Whether a confirmed track has a fix in its gate that association did not take, as false detections are dense.

        It may be the target's or not, so the frame shows neither a detection nor a miss.
        """
        if not (track.confirmed and track.label in self._detector.crowd.labels):
            return False
        return any(self._accepts(track, j) for j in range(len(self._view.fixes)))

    def begun(self, before: Sequence[TrackT]) -> list[TrackT]:
        """The tracks, and one begun from each fix that no track took and that has room in the table."""
        tracks, view, crowd = list(before), self._view, self._detector.crowd
        free = [j for j in self.left if not self._is_stray(j)]
        self._strays = len(self.left) - len(free)
        room = MAX_TRACKS - len([track for track in tracks if track.life.state is not TrackState.DROPPED])
        if len(free) > room:
            calm = sum(view.fixes[j].sighting.detection.label not in crowd.labels for j in free)
            for k in weakest_first(tracks, most_coasting=calm)[: len(free) - room]:
                tracks[k] = tracks[k].deleted(Reason.TOO_MANY_TRACKS)
                room += 1
        branch_id = min([0, *(track.id for track in tracks)])
        for j in free[:room]:
            coasting, llr = self._branched_from(j)
            track = self._begin(j, self.next_id if coasting is None else branch_id - 1, coasting)
            if track is None:
                continue
            if coasting is None:
                self.next_id += 1
            else:
                branch_id -= 1
                score = llr + log(self._detector.detection_probability)
                life = msgspec.structs.replace(track.life, log_likelihood_ratio=score)
                track = msgspec.structs.replace(track, life=life, branch_of=coasting.id)
            tracks.append(track)
        self.refused = max(0, len(free) - room)
        return tracks

    def _is_stray(self, j: int) -> bool:
        """Whether a fix is in the gate of a steady track without a fix in this frame: it is no evidence of another
        target, and a track begun with it would take the next fixes from the steady one.
        """
        if j in self._branchings:
            return False
        number, ids = self._view.fixes[j].sighting.detection.detector_id, self._detector.ids
        return any(
            track.id not in self.taken
            and is_steady(track.life, self._view.host_ns)
            and self._accepts(track, j)
            and not ids.distinguish(track.detector_id, number)
            for track in self._tracks
        )

    def continued(self, tracks: Sequence[TrackT]) -> list[TrackT]:
        """The tracks. A branch that this frame confirmed becomes its coasting track; other branches of a track that is
        confirmed again are deleted; those of a track that has ended become tracks of their own.
        """
        after, places, host_ns = list(tracks), {track.id: k for k, track in enumerate(tracks)}, self._view.host_ns
        branches = [k for k, t in enumerate(tracks) if t.branch_of and t.life.state is not TrackState.DROPPED]
        for k in sorted(branches, key=lambda k: tracks[k].life.confirmed_ns != host_ns):
            branch, place = after[k], places.get(tracks[k].branch_of or 0)
            old = None if place is None else after[place]
            if place is None or old is None or old.life.state is TrackState.DROPPED:
                after[k] = msgspec.structs.replace(branch, id=self.next_id, branch_of=None)
                self._renumber(branch, self.next_id)
                self.next_id += 1
            elif branch.life.confirmed_ns == host_ns and old.fix is None:
                after[place], after[k] = old.reacquired(branch)
                self._renumber(branch, old.id)
            elif branch.confirmed or (old.fix is not None and not old.moving):
                after[k] = branch.deleted(Reason.NEVER_CONFIRMED)
        return after

    def unused(self, tracks: Sequence[TrackT]) -> dict[Reason, int]:
        """Number of fixes that are assigned to no reported track, by reason. ``tracks``: after the frame."""
        weak = self._strays + sum([track.id < 0 and track.fix is not None for track in tracks])
        counts = {Reason.TOO_MANY_TRACKS: self.refused, Reason.WEAK_EVIDENCE: weak}
        return {reason: count for reason, count in counts.items() if count}

    def crowd_after(self) -> Crowd:
        """The crowd after a frame; unchanged where tracks took nearly all of its fixes."""
        detector, view = self._detector, self._view
        if not detector.crowd.labels and len(self.left) <= NEW_TARGETS:
            return detector.crowd
        tentative = [self.taken[t.id].index for t in self._tracks if t.id in self.taken and not t.confirmed]
        elapsed_s = None if detector.last_ns is None else detector.elapsed_s(view.host_ns)
        return detector.crowd.after_frame(
            [view.fixes[j] for j in self.left], [view.fixes[j] for j in tentative], elapsed_s
        )
