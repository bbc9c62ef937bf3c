"""One frame of the tracker by filters of single targets: which track has which fix, which begin, continue and end.

A fix whose evidence is weak does not confirm a coasting track again, whose gate may be metres wide: it begins a branch,
a tentative track from the coasting state and this fix. A confirmed branch becomes its track (track splitting; Smith &
Buechler 1975). A static target has no branches near other targets, nor in photographs, where one missed detection makes
a track coast.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, log

import msgspec

from fwav_companion.geometry.vectors import subtract
from fwav_companion.tracking.clutter import clutter
from fwav_companion.tracking.detector_ids import CERTAIN, IdTrust
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import GATE, Filter
from fwav_companion.tracking.filters.filter_track import FilterTrack
from fwav_companion.tracking.id_pairs import IdPairs
from fwav_companion.tracking.lifecycle import are_photographs, detected, initiated, is_steady, not_detected
from fwav_companion.tracking.pair_assignment import FramePairs, TakenFix, assigned, possible_costs
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.tracking.track_table import MAX_TRACKS, weakest_first
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import FrameView, GroundFix, Innovation, Reason, TrackState
from fwav_companion.types.tracks import GateResult

WIDE = 4.0 * log(3.0)
"""Log determinant ratio of a gate three times as wide as the noise of a fix. In a narrower gate a false fix does little
harm, because a small gain moves the estimate by only a part of that noise."""
STATIC_REACQUISITION_LLR = log(20.0)
"""Log-likelihood ratio of a fix that confirms a static target again: with equal priors the fix is the target's at 95 %.
"""
DISPLACED_SIGMAS = 8.0
"""Largest displacement of a fix from its own target, sigmas: twice the gate. A camera late by three sigma displaces a
fix by that distance."""


class FilterFrame:
    """The tracks of one frame."""

    def __init__(
        self, tracks: Sequence[FilterTrack], view: FrameView, detector: DetectorModel, *, reports_innovations: bool
    ) -> None:
        """``tracks``: the live tracks, predicted to the frame."""
        self._tracks, self._view, self._detector = tracks, view, detector
        self._reports_innovations = reports_innovations
        self._branchings: dict[int, tuple[FilterTrack, float]] = {}
        """Coasting tracks by the index of a fix that is weak evidence for them, with its log-likelihood ratio."""
        self._gates: dict[tuple[int, int], GateResult] = {}
        """Pairs of a track id and a fix index that the gates accept."""
        self.taken: dict[int, TakenFix] = {}
        """By track id."""
        self.id_trust: dict[int, IdTrust] = {}
        """Trust in the detector's id of the fix that a track took, by track id."""
        self.missed: list[FilterTrack] = []
        """The tracks, before the frame, that it covers without a fix for them."""
        self.refused = self._strays = 0
        if tracks and view.fixes:
            self._associate()
        used = {took.index for took in self.taken.values()}
        self.left = [j for j in range(len(view.fixes)) if j not in used]
        """Indices of the fixes that no track took."""

    def _associate(self) -> None:
        tracks, view, detector = self._tracks, self._view, self._detector
        against = clutter(detector, view.image_px2)
        by_label: dict[str, list[int]] = {}
        for j, fix in enumerate(view.fixes):
            by_label.setdefault(fix.sighting.detection.label, []).append(j)
        for track in tracks:
            for j in by_label.get(track.label, ()):
                gated = track.target.gate(view.fixes[j])
                if gated.nis < GATE:
                    self._gates[track.id, j] = gated
        clutter_llr = [against.llr_of(fix) + against.detection_odds for fix in view.fixes]
        pairs = FramePairs(view.fixes, against, self._gates, self._gates, clutter_llr)
        # A branch has its first fix as evidence. Its coasting track would take every fix from it, for one more branch.
        branched = {track.branch_of for track in tracks if track.branch_of}
        preferred = {t.id for t in tracks if t.branch_of or (t.confirmed and t.id not in branched)}
        targets, costs = {t.id: t.target for t in tracks}, possible_costs(tracks, pairs, view.host_ns, GATE)
        by_id = IdPairs(
            {track.id: track for track in tracks}, view.fixes, detector.ids,
            lambda track: targets[track.id].relative_cov,
        )  # fmt: skip
        self.taken = assigned(
            tracks, costs, pairs, preferred, lambda track: view.could_see(targets[track.id].apparent_ned),
            by_id.with_bonus,
        )  # fmt: skip
        self.id_trust = by_id.trust_after({number: took.index for number, took in self.taken.items()}, costs)
        if len(tracks) + len(view.fixes) <= MAX_TRACKS:  # else a branch would take the place of a target
            self._branch_off()

    def _branch_off(self) -> None:
        """Take fixes that are weak evidence from coasting tracks: each begins a branch."""
        detector, weak = self._detector, []
        for track in self._tracks:
            took = self.taken.get(track.id)
            if took is None or track.life.state is not TrackState.COASTING or took.gate.log_det_ratio <= WIDE:
                continue
            needed = detector.confirming_llr(track.label) - log(detector.detection_probability)
            if not track.moving:
                needed = min(-inf if are_photographs(detector) else STATIC_REACQUISITION_LLR, needed)
            if took.log_likelihood_ratio < needed and (track.moving or not self._is_shared(track, took.index)):
                weak.append(track)
        for track in weak:
            took = self.taken.pop(track.id)
            self._branchings[took.index] = (track, took.log_likelihood_ratio)

    def _is_shared(self, track: FilterTrack, fix: int) -> bool:
        """Whether the gate of another confirmed track accepts this fix, too.

        Static targets that are nearer to one another than their gates come into view one after the other. While
        branches of some of them wait for confirmation, the fixes of the next ones would go to the wrong tracks.
        """
        return any(
            other.confirmed and other.id != track.id and (other.id, fix) in self._gates for other in self._tracks
        )

    def updated(self) -> list[FilterTrack]:
        """The tracks after the frame: each is detected, missed, or out of view; branches and their tracks are one."""
        unseen = {track.id: self._unseen(track) for track in self._tracks if track.id not in self.taken}
        self.missed = [t for t in self._tracks if t.id in unseen and unseen[t.id].life.misses > t.life.misses]
        return self._reacquired([unseen.get(track.id) or self._seen(track) for track in self._tracks])

    def _seen(self, track: FilterTrack) -> FilterTrack:
        """The track after a frame with a fix for it."""
        view, took = self._view, self.taken[track.id]
        fix, llr = view.fixes[took.index], took.log_likelihood_ratio
        number = fix.sighting.detection.detector_id
        if not (track.confirmed or track.branch_of) and self._may_be_displaced(fix):
            llr = min(llr, 0.0)
        innovation = None
        if self._reports_innovations:
            north_m, east_m, _ = subtract(fix.position_ned, track.target.apparent_ned)
            innovation = Innovation(north_m, east_m, took.gate.nis)
        return msgspec.structs.replace(
            track,
            target=track.target.update(fix),
            life=detected(track.life, view.host_ns, llr, self._detector, track.label),
            last_fix=fix,
            fix=fix,
            innovation=innovation,
            detector_id=track.detector_id if number is None else number,
            id_trust=track.id_trust if number is None else self.id_trust.get(track.id, CERTAIN).trust,
        )

    def _may_be_displaced(self, fix: GroundFix) -> bool:
        """Whether a tentative track's fix may be a displaced one of a confirmed track that the frame missed.

        A camera delay beyond its prior displaces fixes by more than the gate. The fixes of one target then alternate
        between its track and a new one, and a displaced fix is no evidence of another target.
        """
        if are_photographs(self._detector):  # few of them: what one shows in a target's place is another target
            return False
        label, reach2, other = fix.sighting.detection.label, DISPLACED_SIGMAS**2, fix.relative_cov
        for track in self.missed:
            if not track.confirmed or track.label != label:
                continue
            own, (north, east, _) = track.target.relative_cov, subtract(fix.position_ned, track.target.apparent_ned)
            near = north * north <= reach2 * (own[0][0] + other[0][0])
            if near and east * east <= reach2 * (own[1][1] + other[1][1]):
                return True
        return False

    def _unseen(self, track: FilterTrack) -> FilterTrack:
        """The track after a frame without a fix for it."""
        view = self._view
        # A tentative track needs its place alone: the likelihood ratio of clutter is 1 only if every look counts.
        missed = is_missed_detection(view, track.label, track.target, 0.0 if track.confirmed else None)
        missed = missed and not self._is_in_a_crowd(track)
        life = not_detected(track.life, view.host_ns, missed=missed, moving=track.moving, detector=self._detector)
        return track if life is track.life else msgspec.structs.replace(track, life=life, looked_for=missed)

    def _is_in_a_crowd(self, track: FilterTrack) -> bool:
        """Whether a confirmed track has a fix in its gate that association did not take, as false detections are dense.

        It may be the target's or not, so the frame shows neither a detection nor a miss.
        """
        return (
            track.confirmed
            and track.label in self._detector.crowd.labels
            and any((track.id, j) in self._gates for j in range(len(self._view.fixes)))
        )

    def _reacquired(self, tracks: list[FilterTrack]) -> list[FilterTrack]:
        """The tracks. A branch that this frame confirmed becomes its coasting track, and is deleted.

        The other branches of a track that is confirmed again are deleted too, because the track explains their fixes.
        """
        branches = [i for i, t in enumerate(tracks) if t.branch_of and t.life.state is not TrackState.DROPPED]
        places, host_ns = {track.id: i for i, track in enumerate(tracks)}, self._view.host_ns
        for i in sorted(branches, key=lambda i: tracks[i].life.confirmed_ns != host_ns):
            place = places.get(tracks[i].branch_of or 0)
            if place is None:
                continue
            if tracks[place].life.state is TrackState.CONFIRMED:
                tracks[i] = tracks[i].deleted(Reason.NEVER_CONFIRMED)
            elif tracks[i].life.confirmed_ns == host_ns and tracks[place].life.state is TrackState.COASTING:
                tracks[place], tracks[i] = tracks[place].reacquired(tracks[i])
        return tracks

    def begun(self, before: Sequence[FilterTrack], target_filter: Filter, next_id: int) -> list[FilterTrack]:
        """The tracks, and one begun from each fix that no track took and that has room in the table."""
        tracks, view, detector = list(before), self._view, self._detector
        free = [j for j in self.left if not self._is_stray(j)]
        self._strays = len(self.left) - len(free)
        room = MAX_TRACKS - sum(track.life.state is not TrackState.DROPPED for track in tracks)
        if len(free) > room:
            calm = sum(view.fixes[j].sighting.detection.label not in detector.crowd.labels for j in free)
            for k in weakest_first(tracks, most_coasting=calm)[: len(free) - room]:
                tracks[k] = tracks[k].deleted(Reason.TOO_MANY_TRACKS)
                room += 1
        branch_id = min([0, *(track.id for track in tracks)])
        for j in free[:room]:
            if j in self._branchings:
                branch_id -= 1
                tracks.append(self._branch(j, branch_id))
            else:
                tracks.append(self._new(j, next_id, target_filter))
                next_id += 1
        self.refused = max(0, len(free) - room)
        return tracks

    def _is_stray(self, j: int) -> bool:
        """Whether a fix is in the gate of a steady track without a fix in this frame: it is no evidence of another
        target, and a track begun with it would take the next fixes from the steady one.
        """
        number, ids = self._view.fixes[j].sighting.detection.detector_id, self._detector.ids
        return any(
            track.id not in self.taken
            and is_steady(track.life, self._view.host_ns)
            and not ids.distinguish(track.detector_id, number)
            and (track.id, j) in self._gates
            for track in self._tracks
        )

    def _new(self, j: int, number: int, target_filter: Filter) -> FilterTrack:
        fix, host_ns = self._view.fixes[j], self._view.host_ns
        target, detection = target_filter.initiate(fix), fix.sighting.detection
        return FilterTrack(
            number, detection.label, target.velocity_cov is not None, initiated(host_ns), fix, fix,
            detector_id=detection.detector_id, target=target,
        )  # fmt: skip

    def _branch(self, j: int, number: int) -> FilterTrack:
        """A tentative track from a coasting one and a fix."""
        (track, llr), fix = self._branchings[j], self._view.fixes[j]
        score = llr + log(self._detector.detection_probability)
        life = msgspec.structs.replace(initiated(self._view.host_ns), log_likelihood_ratio=score)
        return FilterTrack(
            number, track.label, track.moving, life, fix, fix,
            detector_id=fix.sighting.detection.detector_id, branch_of=track.id, target=track.target.update(fix),
        )  # fmt: skip

    def unused(self, tracks: Sequence[SmoothedTrack]) -> dict[Reason, int]:
        """Number of fixes that are assigned to no reported track, by reason. ``tracks``: after the frame."""
        weak = self._strays + sum([track.id < 0 and track.fix is not None for track in tracks])
        counts = {Reason.TOO_MANY_TRACKS: self.refused, Reason.WEAK_EVIDENCE: weak}
        return {reason: count for reason, count in counts.items() if count}
