"""One frame of the smoothing tracker: which track has which fix, and which tracks begin, continue and end by it.

A coasting track whose gate is wide is not confirmed again by one detection, which may be false: the detection begins a
branch, a tentative track with a velocity of its own. So does one near a moving target that the frame missed, which may
have turned. A confirmed branch becomes its track (track splitting; Smith & Buechler 1975).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, log

import msgspec
import numpy as np

from fwav_companion.estimation.frame_prediction import GATE2
from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.estimation.initiation import begin_target
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.geometry.vectors import subtract
from fwav_companion.tracking.clutter import Clutter, clutter
from fwav_companion.tracking.detector_ids import CERTAIN, CERTAIN_TRUST, IdTrust
from fwav_companion.tracking.lifecycle import (
    are_photographs,
    detected,
    is_steady,
    not_detected,
)
from fwav_companion.tracking.smoothed.smoothed_association import (
    Costs,
    FramePairs,
    TakenFix,
    assigned,
    frame_pairs,
    label_pairs,
    possible_costs,
)
from fwav_companion.tracking.smoothed.smoothed_state import SmoothedState
from fwav_companion.tracking.smoothed.smoothed_target import FrameAnswers
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack, new_track
from fwav_companion.tracking.track_table import MAX_TRACKS, weakest_first
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import FrameView, GroundFix, Innovation, Reason, TrackState

WIDE = 4.0 * log(3.0)
"""Log determinant ratio of a gate three times as wide as the noise of a fix. In a narrower gate a false fix does little
harm, because a small gain moves the estimate by only a part of that noise."""
STATIC_REACQUISITION_LLR = log(20.0)
"""Log-likelihood ratio of a fix that confirms a static target again: with equal priors the fix is the target's at 95 %.
A higher threshold would cost self-calibration the first sights from each side."""
DISPLACED2 = 64.0
"""Squared distance up to which a fix may be one of a missed track that is displaced, by a camera late by three sigmas
more than its prior, or that has turned: a walker who turns around is as far away after three frames at 30 Hz."""


class FrameTracks:
    """The tracks of one frame."""

    def __init__(
        self, state: SmoothedState, view: FrameView, answers: FrameAnswers, moves: Callable[[str], bool],
        height: Callable[[GroundFix], tuple[float, float]], *, reports_innovations: bool,
    ) -> None:  # fmt: skip
        """``moves``: whether targets of a label may move.

        ``height``: height of a fix's target above the surface, and its one sigma, metres.
        """
        self._height = height
        self._state, self._view, self._answers, self._moves = state, view, answers, moves
        self._reports_innovations = reports_innovations
        self._against: Clutter = clutter(state.detector, view.image_px2)
        self._branchings: dict[int, tuple[SmoothedTrack, float]] = {}
        """Coasting tracks by the index of a fix that is weak evidence for them, with its log-likelihood ratio."""
        self._pairs: FramePairs | None = None
        self.taken: dict[int, TakenFix] = {}
        self.id_trust: dict[int, IdTrust] = {}
        self.left: list[int] = list(range(len(view.fixes)))
        """Indices of the fixes that no track took."""
        self.displaced: dict[int, int] = {}
        """Static tracks without a fix, by the index of a fix beyond their gate that may be theirs: the solve decides,
        whose weights are robust."""
        self.refused = self._strays = 0
        self._missed: list[SmoothedTrack] = []

    def updated(self, tracks: Sequence[SmoothedTrack], sights: Sightings | None) -> list[SmoothedTrack]:
        """The tracks after the frame's fixes: each is detected, missed, or out of view."""
        view, detector = self._view, self._state.detector
        if tracks and sights is not None:
            self._associate(tracks, sights)
        after = []
        for track in tracks:
            took = self.taken.get(track.id)
            after.append(self._unseen(track) if took is None else track)
        self._missed = [
            old for old, now in zip(tracks, after, strict=True) if old.confirmed and now.life.misses > old.life.misses
        ]
        if not are_photographs(detector):
            self._find_displaced(tracks)
        for k, track in enumerate(tracks):
            took = self.taken.get(track.id)
            if took is None:
                continue
            llr = took.log_likelihood_ratio
            if not (track.confirmed or track.branch_of) and took.index in self.displaced:
                llr = min(llr, 0.0)
            after[k] = self._seen(track, view.fixes[took.index], llr, took)
        return self._seen_together(after)

    def _associate(self, tracks: Sequence[SmoothedTrack], sights: Sightings) -> None:
        state, view = self._state, self._view
        alike = label_pairs(tracks, view.fixes)
        # A coasting track leaves the fixes to its branch; else it would take each of them for one more branch.
        by_id = {track.id: track for track in tracks}
        branched = {t.branch_of for t in tracks if t.branch_of and by_id[t.branch_of].life.state is TrackState.COASTING}
        alike &= np.array([track.id not in branched for track in tracks], np.bool_)
        targets = np.array([track.id for track in tracks], np.int64)
        still = {track: each.number for track, each in state.still.items()}
        prediction = state.estimator.predict(sights, targets, alike, still)
        steady = {t.id for t in tracks if is_steady(t.life, view.host_ns)}
        pairs = self._pairs = frame_pairs(view.fixes, prediction, steady, self._against)
        self._answers.gates = pairs.alone
        costs = possible_costs(tracks, pairs, view.host_ns)
        preferred = {track.id for track in tracks if track.confirmed or track.branch_of}
        self.taken = assigned(tracks, costs, pairs, preferred, self._sees, lambda prior: self._with_ids(prior, tracks))
        self._branch_off(tracks)
        used = {each.index for each in self.taken.values()}
        self.left = [j for j in range(len(view.fixes)) if j not in used]

    def _with_ids(self, prior: Costs, tracks: Sequence[SmoothedTrack]) -> Costs:
        """The costs, less the bonus of pairs whose track and fix have one id by the detector."""
        ids, by_id = self._state.detector.ids, {track.id: track for track in tracks}
        found = dict(prior)
        for i, j in prior:
            own, now = by_id[i].detector_id, self._view.fixes[j].sighting.detection.detector_id
            if own is not None and own == now:
                found[i, j] -= 0.5 * min(CERTAIN_TRUST, by_id[i].id_trust, ids.most_trust(0.0))
        return found

    def _sees(self, track: SmoothedTrack) -> bool:
        target = self._answers.target(track)
        return target is not None and self._view.could_see(target.apparent_ned)

    def _branch_off(self, tracks: Sequence[SmoothedTrack]) -> None:
        """Take fixes that are weak evidence from coasting tracks: each begins a branch."""
        detector = self._state.detector
        if len(tracks) + len(self._view.fixes) > MAX_TRACKS:  # a branch must not take the place of a target
            return
        for track in tracks:
            took = self.taken.get(track.id)
            if took is None or track.life.state is not TrackState.COASTING or took.gate.log_det_ratio <= WIDE:
                continue
            needed = detector.confirming_llr(track.label) - log(detector.detection_probability)
            least = -inf if are_photographs(detector) else STATIC_REACQUISITION_LLR
            if took.log_likelihood_ratio < (needed if track.moving else min(least, needed)):
                self._branchings[took.index] = (track, took.log_likelihood_ratio)
                del self.taken[track.id]

    def _find_displaced(self, tracks: Sequence[SmoothedTrack]) -> None:
        """Find the fixes that may be displaced ones of confirmed static tracks without a fix, the nearest first.

        A tentative track may have taken such a fix: it is then no evidence of another target.
        """
        confirmed = {track.id for track in tracks if track.confirmed}
        missed = {t.id for t in tracks if t.confirmed and not t.moving and t.id not in self.taken}
        if not missed or self._pairs is None:
            return
        taken = {took.index for number, took in self.taken.items() if number in confirmed}
        near = sorted(
            (gate.nis, number, fix)
            for (number, fix), gate in self._pairs.alone.items()
            if number in missed and fix not in taken and GATE2 <= gate.nis < DISPLACED2
        )
        for _, number, fix in near:
            if number in missed and fix not in self.displaced:
                self.displaced[fix] = number
                missed.discard(number)

    def _turned(self, fix: int) -> SmoothedTrack | None:
        """The moving track, missed by the frame, that may have turned to this fix; the nearest."""
        alone = {} if self._pairs is None else self._pairs.alone
        near = [(alone[t.id, fix].nis, t.id, t) for t in self._missed if t.moving and (t.id, fix) in alone]
        nis, _, track = min(near, default=(inf, 0, None))
        return track if nis < DISPLACED2 else None

    def _seen(self, track: SmoothedTrack, fix: GroundFix, llr: float, took: TakenFix) -> SmoothedTrack:
        """The track after a frame with a fix for it."""
        view, number = self._view, fix.sighting.detection.detector_id
        innovation = None
        target = self._answers.target(track) if self._reports_innovations else None
        if target is not None:
            north_m, east_m, _ = subtract(fix.position_ned, target.apparent_ned)
            innovation = Innovation(north_m, east_m, took.gate.nis)
        return msgspec.structs.replace(
            track,
            life=detected(track.life, view.host_ns, llr, self._state.detector, track.label),
            last_fix=fix, fix=fix, looked_for=False, innovation=innovation,
            detector_id=track.detector_id if number is None else number,
            id_trust=track.id_trust if number is None else self.id_trust.get(track.id, CERTAIN).trust,
        )  # fmt: skip

    def _unseen(self, track: SmoothedTrack) -> SmoothedTrack:
        """The track after a frame without a fix for it."""
        view, target = self._view, self._answers.target(track)
        missed = target is not None
        if target is not None:
            # A tentative track needs its place alone: the likelihood ratio of clutter is 1 only if every look counts.
            margin_m = self._answers.displaced_m(track) if track.confirmed else None
            missed = is_missed_detection(view, track.label, target, margin_m) and not self._is_in_a_crowd(track)
        life = not_detected(track.life, view.host_ns, missed=missed, moving=track.moving, detector=self._state.detector)
        return msgspec.structs.replace(track, life=life, fix=None, looked_for=missed, innovation=None)

    def _is_in_a_crowd(self, track: SmoothedTrack) -> bool:
        """Whether a confirmed track has a fix in its gate that association did not take, as false detections are dense.

        It may be the target's or not, so the frame shows neither a detection nor a miss.
        """
        if self._pairs is None or not (track.confirmed and track.label in self._state.detector.crowd.labels):
            return False
        return any(self._answers.gate(track.id, j).nis < GATE2 for j in range(len(self._view.fixes)))

    def _seen_together(self, tracks: list[SmoothedTrack]) -> list[SmoothedTrack]:
        """The tracks, with the ids of those of one label that this frame shows together: they are not one."""
        by_label: dict[str, set[int]] = {}
        for track in tracks:
            if track.fix is not None and track.id > 0 and track.confirmed:
                by_label.setdefault(track.label, set()).add(track.id)
        for k, track in enumerate(tracks):
            together = by_label.get(track.label, set())
            if track.id in together and not track.together >= together:
                tracks[k] = msgspec.structs.replace(track, together=track.together | together)
        return tracks

    def begun(self, before: Sequence[SmoothedTrack], sights: Sightings | None) -> list[SmoothedTrack]:
        """The tracks, and one begun from each fix that no track took and that has room in the table."""
        tracks, state, view = list(before), self._state, self._view
        if sights is None or not self.left:
            return tracks
        free = [j for j in self.left if j not in self.displaced and not self._is_stray(j, before)]
        self._strays = len(self.left) - len(free)
        room = MAX_TRACKS - sum(track.life.state is not TrackState.DROPPED for track in tracks)
        if len(free) > room:
            calm = sum(view.fixes[j].sighting.detection.label not in state.detector.crowd.labels for j in free)
            for k in weakest_first(tracks, most_coasting=calm)[: len(free) - room]:
                tracks[k] = tracks[k].deleted(Reason.TOO_MANY_TRACKS)
                room += 1
        for j in free[:room]:
            track = self._begin(j, sights, min([0, *(t.id for t in tracks)]) - 1)
            if track is not None:
                tracks.append(track)
        self.refused = max(0, len(free) - room)
        return tracks

    def _begin(self, j: int, sights: Sightings, branch_id: int) -> SmoothedTrack | None:
        """A tentative track from a fix; None where its ray has no foot at the present calibration."""
        state, view, fix = self._state, self._view, self._view.fixes[j]
        live, label = state.estimator.live, fix.sighting.detection.label
        coasting, llr = self._branchings.get(j, (self._turned(j), 0.0))
        number = state.next_id if coasting is None else branch_id
        height_m, sigma_m = self._height(fix)
        if height_m or sigma_m:
            state.estimator.targets[number] = TargetPrior(height_m=height_m, height_sigma_m=sigma_m)
        moving, own = self._moves(label), sights.select(np.array([j])).with_targets(np.array([number]))
        if live is None or not begin_target(live, number, own, moving=moving):
            return None
        state.waiting[number] = ()
        track = new_track(number, fix, view.host_ns, moving=moving)
        if coasting is None:
            state.next_id += 1
            return track
        score = llr + log(state.detector.detection_probability)
        life = msgspec.structs.replace(track.life, log_likelihood_ratio=score)
        return msgspec.structs.replace(track, life=life, branch_of=coasting.id)

    def _is_stray(self, j: int, tracks: Sequence[SmoothedTrack]) -> bool:
        """Whether a fix is in the gate of a steady track without a fix in this frame: it is no evidence of another
        target, and a track begun with it would take the next fixes from the steady one.
        """
        if j in self._branchings:
            return False
        return any(
            track.fix is None
            and is_steady(track.life, self._view.host_ns)
            and self._answers.gate(track.id, j).nis < GATE2
            and not self._are_distinguished(track, j)
            for track in tracks
        )

    def _are_distinguished(self, track: SmoothedTrack, j: int) -> bool:
        return self._state.detector.ids.distinguish(
            track.detector_id, self._view.fixes[j].sighting.detection.detector_id
        )

    def continued(self, tracks: Sequence[SmoothedTrack]) -> list[SmoothedTrack]:
        """The tracks. A branch that this frame confirmed becomes its coasting track; other branches of a track that is
        confirmed again are deleted; those of a track that has ended become tracks of their own.
        """
        after, places = list(tracks), {track.id: k for k, track in enumerate(tracks)}
        state, host_ns = self._state, self._view.host_ns
        branches = [k for k, t in enumerate(tracks) if t.branch_of and t.life.state is not TrackState.DROPPED]
        for k in sorted(branches, key=lambda k: tracks[k].life.confirmed_ns != host_ns):
            branch, place = after[k], places.get(tracks[k].branch_of or 0)
            old = None if place is None else after[place]
            if place is None or old is None or old.life.state is TrackState.DROPPED:
                after[k] = msgspec.structs.replace(branch, id=state.next_id, branch_of=None)
                self._renumber(branch, state.next_id)
                state.next_id += 1
            elif branch.life.confirmed_ns == host_ns and old.fix is None:
                after[place], after[k] = old.reacquired(branch)
                self._renumber(branch, old.id)
            elif branch.confirmed or (old.fix is not None and not old.moving):
                after[k] = branch.deleted(Reason.NEVER_CONFIRMED)
        return after

    def _renumber(self, branch: SmoothedTrack, new: int) -> None:
        """Count a branch's sightings as its track's. A moving target goes on as the branch, which opened its velocity;
        a static one is where it was.
        """
        state, old = self._state, branch.id
        live = state.estimator.live
        if live is not None and branch.moving:
            live.forget(new)
            live.rename(old, new)
        state.estimator.rename(old, new)
        if old in state.estimator.targets:
            state.estimator.targets.setdefault(new, state.estimator.targets.pop(old))
        state.waiting[new] = tuple(s.with_targets(np.full(len(s), new)) for s in state.waiting.pop(old, ()))

    def unused(self, tracks: Sequence[SmoothedTrack]) -> dict[Reason, int]:
        """Number of fixes that are assigned to no reported track, by reason."""
        weak = self._strays + sum([track.id < 0 and track.fix is not None for track in tracks])
        counts = {Reason.TOO_MANY_TRACKS: self.refused, Reason.WEAK_EVIDENCE: weak}
        return {reason: count for reason, count in counts.items() if count}
