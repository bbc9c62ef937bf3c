"""The tracker of many targets: predict, associate, update, initiate, delete. One frame in, all tracks out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration import CalibrationReport
from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.association import associate
from fwav_companion.tracking.clutter import clutter
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.displacement import NONE_ABSENT, Absent, absent
from fwav_companion.tracking.filters.base import Filter, TargetEstimate
from fwav_companion.tracking.filters.wander_evidence import WanderEvidence
from fwav_companion.tracking.joint_compatibility import CommonBiases, JointGate
from fwav_companion.tracking.lifecycle import LOOK_S, MOVING_LOOK_S, are_photographs, is_steady, not_detected
from fwav_companion.tracking.new_tracks import MAX_TRACKS, Begun, unused_fixes, with_new, without_strays
from fwav_companion.tracking.pair_costs import Candidate
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.track_merging import TrackMerging
from fwav_companion.tracking.track_state import (
    LiveTrack,
    detector_after,
    innovation,
    opened,
    teaches,
    with_shared_evidence,
)
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import (
    FrameView,
    GroundFix,
    LandmarkAltitude,
    LandmarkRecord,
    Reason,
    Track,
    TrackState,
    VehicleState,
)

if TYPE_CHECKING:
    from fwav_companion.self_calibration.calibrator import Calibrator
    from fwav_companion.tracking.landmarks.landmark_target import LandmarkTracking


Taken: TypeAlias = dict[int, tuple[GroundFix, float]]
"""The fix of each track that has one, by id, and the fix's log-likelihood ratio against clutter."""


class Snapshot(msgspec.Struct, frozen=True):
    """The state of a tracker: references to immutable objects."""

    alive: tuple[LiveTrack, ...] = ()
    """Live tracks by id."""
    next_id: int = 1
    calibrator: Calibrator | None = None
    """None without self-calibration."""
    calibrating: Snapshot | None = None
    """State of the tracker that calibrates in the place of this one, where it is to return to."""
    merging: TrackMerging = TrackMerging()
    detector: DetectorModel = DetectorModel()
    unused_fixes: Mapping[Reason, int] = {}
    """Fixes of the newest frame that no reported track has, by reason."""
    landmarks: LandmarkTracking | None = None
    """None without landmarks."""
    wander: WanderEvidence | None = None
    """How the vehicle's position wanders; None before the first target showed it."""
    biases: CommonBiases | None = None
    """What the innovations of all targets show of the errors that they share; None before that."""


class Tracker:
    """Follows targets through frames in the order of their capture, which :class:`Reorder` ensures."""

    __slots__ = ("_calibrating", "_corrects", "_filter", "_keep_ns", "_patience_ns", "_state", "reports_innovations")

    def __init__(
        self,
        target_filter: Filter,
        keep_ns: int,
        calibrator: Calibrator | None = None,
        *,
        corrects: bool = True,
        patience_ns: int = 0,
        calibrating: Tracker | None = None,
        landmarks: LandmarkTracking | None = None,
    ) -> None:
        """``corrects``: whether the result of self-calibration moves the tracks, or is only reported.

        ``patience_ns``: least age of a track that teaches. ``calibrating``: a tracker of the same frames that
        calibrates in the place of this one. ``landmarks``: corrects the targets in the place of ``target_filter``.
        """
        self.reports_innovations = False
        """Whether tracks report innovations, which flying does not use."""
        self._filter = target_filter
        self._keep_ns = keep_ns
        self._corrects = corrects
        self._patience_ns = patience_ns
        self._calibrating = calibrating
        self._state = Snapshot(calibrator=calibrator, landmarks=landmarks)

    @property
    def calibration(self) -> CalibrationReport | None:
        """The report of self-calibration; None without it."""
        calibrator = self._calibrator
        return None if calibrator is None else calibrator.report()

    def best_targets(self) -> dict[int, TargetEstimate]:
        """The reported targets of all live tracks, by id."""
        target = self._choice().target
        return {track.id: target(track) for track in self._state.alive if track.id > 0}

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """What each landmark showed so far."""
        landmarks = self._state.landmarks
        return () if landmarks is None else landmarks.records

    @property
    def landmark_altitude(self) -> LandmarkAltitude | None:
        """The vehicle's altitude against a landmark; None before one was seen often enough."""
        landmarks = self._state.landmarks
        return None if landmarks is None else landmarks.altitude

    @property
    def unused_fixes(self) -> Mapping[Reason, int]:
        """Number of fixes of the newest frame that no reported track has, by reason."""
        return self._state.unused_fixes

    def _choice(self, vehicle: VehicleState | None = None) -> TargetChoice:
        """How the present state reports its targets. ``vehicle``: its report at this instant."""
        state = self._state
        shown = state.landmarks is not None and state.landmarks.shows
        return TargetChoice(self._calibrator, state.calibrator if self._corrects else None, shown, vehicle)

    @property
    def _calibrator(self) -> Calibrator | None:
        return (self._calibrating or self)._state.calibrator

    def snapshot(self) -> Snapshot:
        """The present state, to return to."""
        if self._calibrating is None:
            return self._state
        return msgspec.structs.replace(self._state, calibrating=self._calibrating.snapshot())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot
        if self._calibrating is not None and snapshot.calibrating is not None:
            self._calibrating.restore(snapshot.calibrating)

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id; a track that the frame deleted is among them once."""
        if self._calibrating is not None:
            self._calibrating.on_frame(view)
        if self._state.calibrator is not None:
            calibrator = self._state.calibrator.predicted(view.host_ns)
            self._state = msgspec.structs.replace(self._state, calibrator=calibrator)
        state, choice = self._state, self._choice(view.vehicle)
        landmarks = None if state.landmarks is None else state.landmarks.predicted(view)
        predicted, joint = self._predicted(view, landmarks), JointGate(state.biases)
        taken, branchings = self._associated(predicted, view, choice, joint)
        after, missed = self._after(predicted, taken, view, choice)
        elapsed_ns = view.host_ns - (state.detector.last_ns or view.host_ns)
        merging = state.merging.after_frame(after, [track.id for track in missed], elapsed_ns, choice.target)
        begun = Begun(list(merging.merged(after, choice.target)), state.next_id)
        if len(taken) < len(view.fixes):
            begun = self._begun(begun, predicted, taken, branchings, view, landmarks)
        tracks, next_id = begun.tracks, begun.next_id
        detector = detector_after(state.detector, view.host_ns, predicted, tracks, refused=begun.refused)
        if landmarks is not None:
            landmarks = landmarks.tracked(view.landmarks, [t.fix for t in tracks if t.confirmed and t.fix is not None])
            tracks = [msgspec.structs.replace(track, target=landmarks.corrected(track.target)) for track in tracks]
        branches = [track for track in tracks if track.id < 0]
        if branches:
            tracks, next_id = reacquisition.independent(tracks, next_id)
        living = tuple([track for track in tracks if track.life.state is not TrackState.DROPPED])
        living, wander = with_shared_evidence(living, state.wander)
        self._state = Snapshot(
            living,
            next_id,
            self._taught(view, living),
            merging=merging,
            detector=detector,
            unused_fixes=unused_fixes(tracks, begun) if begun.refused or branches or begun.strays else {},
            landmarks=landmarks,
            wander=wander,
            biases=joint.biases,
        )
        return self._choice(view.vehicle).reports(tracks, view)

    def _begun(
        self,
        before: Begun,
        predicted: Sequence[LiveTrack],
        taken: Taken,
        branchings: reacquisition.Branchings,
        view: FrameView,
        landmarks: LandmarkTracking | None,
    ) -> Begun:
        """The tracks with those that begin by the fixes that no track has. ``predicted``: those before the frame."""
        used = {id(fix) for fix, _ in taken.values()}
        left = [fix for fix in view.fixes if id(fix) not in used]
        free = without_strays(left, predicted, taken, view.host_ns)
        target_of = self._filter.initiate if landmarks is None else landmarks.initiate
        begun = with_new(
            before, free, view.host_ns, target_of=target_of, branchings=branchings, detector=self._state.detector
        )
        return msgspec.structs.replace(begun, strays=len(left) - len(free))

    def _predicted(self, view: FrameView, landmarks: LandmarkTracking | None) -> list[LiveTrack]:
        """The live tracks at the instant of a frame, before it."""
        predicted = []
        for track in self._state.alive:
            target = (opened(track.target, view) if view.jumped_m else track.target).predict(view.host_ns)
            target = target if landmarks is None else landmarks.corrected(target)
            predicted.append(msgspec.structs.replace(track, target=target, fix=None, looked_for=False, innovation=None))
        return predicted

    def _after(
        self, predicted: Sequence[LiveTrack], taken: Taken, view: FrameView, choice: TargetChoice
    ) -> tuple[list[LiveTrack], list[LiveTrack]]:
        """The tracks after the frame, and those of ``predicted`` that it should have shown and did not."""
        unseen, missed, displaced = dict[int, LiveTrack](), list[LiveTrack](), NONE_ABSENT
        if len(taken) < len(predicted):
            unseen = {track.id: self._unseen(track, view, choice) for track in predicted if track.id not in taken}
            missed = [t for t in predicted if t.id in unseen and unseen[t.id].life.misses > t.life.misses]
        if missed:
            photographs = are_photographs(self._state.detector)
            displaced = absent(predicted, missed, taken, photographs=photographs)
        after = [
            unseen[track.id] if track.id in unseen else self._seen(track, *taken[track.id], view, displaced)
            for track in predicted
        ]
        return reacquisition.reacquired(after, view.host_ns), missed

    @property
    def due_ns(self) -> HostNs | None:
        """Instant at which self-calibration catches up even if no further frame comes."""
        calibrator = self._calibrator
        return None if calibrator is None else calibrator.due_ns

    def catch_up(self, now_ns: HostNs) -> None:
        """Let self-calibration take the fixes that are due, between frames that come seldom."""
        if self._calibrating is not None:
            self._calibrating.catch_up(now_ns)
        calibrator, living = self._state.calibrator, self._state.alive
        if calibrator is not None and calibrator.due_ns is not None and calibrator.due_ns <= now_ns:
            caught_up = calibrator.caught_up(now_ns, {track.id for track in self._teachers(living, now_ns)})
            self._state = msgspec.structs.replace(self._state, calibrator=caught_up)

    def _teachers(self, living: Sequence[LiveTrack], now_ns: HostNs) -> list[LiveTrack]:
        """The tracks that teach self-calibration."""
        return [t for t in living if t.confirmed and now_ns - t.life.first_ns >= self._patience_ns]

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """Delete every track, as of the newest frame; their ids are not used again."""
        state = self._state
        dropped = [msgspec.structs.replace(track.deleted(reason), fix=None, innovation=None) for track in state.alive]
        reported = self._choice(view.vehicle).reports(dropped, view)
        restarted = None if state.calibrator is None else state.calibrator.restarted()
        if self._calibrating is not None:
            self._calibrating.drop_all(reason, view)
        landmarks = None if state.landmarks is None else state.landmarks.restarted()
        self._state = Snapshot((), state.next_id, restarted, detector=state.detector, landmarks=landmarks)
        return reported

    def _associated(
        self, tracks: Sequence[LiveTrack], view: FrameView, choice: TargetChoice, joint: JointGate
    ) -> tuple[Taken, reacquisition.Branchings]:
        """The fix of each track that has one, by id; and the fixes that begin a branch of a track instead."""
        if not (tracks and view.fixes):
            return {}, {}
        if self._state.calibrator is not None:
            self._state.calibrator.expect(view.fixes)
        against = clutter(self._state.detector, view.image_px2)
        pairs = associate(_candidates(tracks, view.host_ns, choice), view.fixes, against, view.could_see, joint)
        taken = {tracks[i].id: (view.fixes[j], llr) for i, (j, llr) in pairs.items()}
        if len(tracks) + len(view.fixes) > MAX_TRACKS:  # a branch must not take the place of a target
            return taken, {}
        branchings = reacquisition.weak_evidence(tracks, taken, self._state.detector)
        for track, _ in branchings.values():
            del taken[track.id]
        return taken, branchings

    def _unseen(self, track: LiveTrack, view: FrameView, choice: TargetChoice) -> LiveTrack:
        """The track after a frame without a fix of it."""
        missed = is_missed_detection(view, track.label, choice.target(track), self._margin_m(track))
        detector = self._state.detector
        look_s = LOOK_S if track.target.velocity_cov is None else MOVING_LOOK_S
        life = not_detected(
            track.life, view.host_ns, missed=missed, keep_ns=self._keep_ns, detector=detector, look_s=look_s
        )
        return track if life is track.life else msgspec.structs.replace(track, life=life, looked_for=missed)

    def _seen(self, track: LiveTrack, fix: GroundFix, llr: float, view: FrameView, missed: Absent) -> LiveTrack:
        """The track after a frame with a fix of it. ``missed``: confirmed tracks whose fix it may be, displaced."""
        if not (track.confirmed or track.branch_of) and missed.may_explain(fix):
            llr = min(llr, 0.0)
        after = track.updated(view.host_ns, fix, llr, self._state.detector)
        if not self.reports_innovations:
            return after
        return msgspec.structs.replace(after, innovation=innovation(self._choice().target(track), fix))

    def _margin_m(self, track: LiveTrack) -> float | None:
        """Distance by which the mount error, as estimated and as unknown, may move the target in the image, metres.

        None for a tentative track: the likelihood ratio of clutter is 1 on average only where every look counts.
        """
        if not track.confirmed:
            return None
        calibrator = self._calibrator if self._corrects else None
        return 0.0 if calibrator is None else calibrator.mount_off * track.slant_m

    def _taught(self, view: FrameView, living: tuple[LiveTrack, ...]) -> Calibrator | None:
        """Self-calibration after this frame; None without it.

        Confirmed tracks teach: clutter does not. Nor do targets of a height that is not exactly known: the joint
        estimate has one error of the height for all.
        """
        calibrator = self._state.calibrator
        if calibrator is None:
            return None
        old = self._teachers(living, view.host_ns)
        fixes = [(track.id, track.fix) for track in old if track.fix is not None and teaches(track.fix)]
        seen = [fix for fix in view.fixes if teaches(fix)]
        return calibrator.updated(view.host_ns, seen, fixes, {track.id for track in old})


def _candidates(tracks: Sequence[LiveTrack], host_ns: HostNs, choice: TargetChoice) -> list[Candidate]:
    """The tracks as association sees them."""
    first = reacquisition.first_served(tracks)
    return [
        Candidate(
            track.label,
            track.target,
            track.detector_id,
            choice.calibrated(track),
            confirmed=track.id in first,
            steady=is_steady(track.life, host_ns),
        )
        for track in tracks
    ]
