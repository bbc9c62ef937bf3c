"""The tracker of many targets: predict, associate, update, initiate, delete. One frame in, all tracks out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration import CalibrationReport
from fwav_companion.tracking import reacquisition
from fwav_companion.tracking.crowd import NEW_TARGETS, Crowd
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.filters.base import Filter, TargetEstimate
from fwav_companion.tracking.frame_association import FrameAssociation, associated
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.tracking.frame_update import FrameUpdate
from fwav_companion.tracking.joint_compatibility import JointGate
from fwav_companion.tracking.new_tracks import Begun, unused_fixes, with_new, without_strays
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.snapshot import Snapshot
from fwav_companion.tracking.track_state import LiveTrack, opened, teaches, with_shared_evidence
from fwav_companion.tracking.track_table import detector_after
from fwav_companion.types import FrameView, LandmarkAltitude, LandmarkRecord, Reason, Track, TrackState, VehicleState
from fwav_companion.types.flight_status import SolveReport
from fwav_companion.types.tracks import CommonErrors, FinalPlace

if TYPE_CHECKING:
    from fwav_companion.self_calibration.calibrator import Calibrator
    from fwav_companion.tracking.landmarks.landmark_target import LandmarkTracking


class Tracker:
    """Tracks targets through frames in capture order, which :class:`Reorder` ensures."""

    __slots__ = (
        "_calibrated_by",
        "_calibrating",
        "_corrects",
        "_filter",
        "_patience_ns",
        "_state",
        "reports_innovations",
    )

    def __init__(
        self,
        target_filter: Filter,
        calibrator: Calibrator | None = None,
        *,
        corrects: bool = True,
        patience_ns: int = 0,
        calibrating: FrameTracker | None = None,
        landmarks: LandmarkTracking | None = None,
    ) -> None:
        """``corrects``: whether self-calibration corrects the tracks, or only reports its result. ``patience_ns``:
        least age of a track that self-calibration uses, ns. ``calibrating``: a second tracker of the same frames that
        self-calibrates instead of this one. ``landmarks``: initiates and corrects the targets instead of
        ``target_filter``.
        """
        self.reports_innovations = False
        """Whether tracks report innovations. A flight does not use them."""
        self._filter = target_filter
        self._corrects = corrects
        self._patience_ns = patience_ns
        self._calibrating = calibrating
        self._calibrated_by: Tracker = calibrating if isinstance(calibrating, Tracker) else self
        self._state = Snapshot(calibrator=calibrator, landmarks=landmarks)

    @property
    def calibration(self) -> CalibrationReport | None:
        """The report of self-calibration; None without it."""
        if self._calibrating is not None:
            return self._calibrating.calibration
        calibrator = self._calibrated_by._state.calibrator
        return None if calibrator is None else calibrator.report()

    @property
    def solves(self) -> SolveReport | None:
        """Counts of the smoother's solves; None without a smoother."""
        return None if self._calibrating is None else self._calibrating.solves

    def final_places(self) -> dict[int, FinalPlace]:
        """Targets by the whole flight, by id: only a smoother has them."""
        return {}

    def best_targets(self) -> dict[int, TargetEstimate]:
        """The reported targets of all live tracks, by id."""
        target = self._choice().target
        return {track.id: target(track) for track in self._state.alive if track.id > 0}

    def common_errors(self) -> dict[int, CommonErrors]:
        """None: only a smoother has them."""
        return {}

    @property
    def crowd(self) -> Crowd:
        """The labels of which more detections fit no track than new targets explain."""
        return self._state.detector.crowd

    @property
    def next_id(self) -> int:
        """The id of the next new track."""
        return self._state.next_id

    @next_id.setter
    def next_id(self, next_id: int) -> None:
        self._state = msgspec.structs.replace(self._state, next_id=next_id)

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """The record of each landmark's sights so far."""
        landmarks = self._state.landmarks
        return () if landmarks is None else landmarks.records

    @property
    def landmark_altitude(self) -> LandmarkAltitude | None:
        """The vehicle's altitude relative to a landmark's; None before a landmark was seen often enough."""
        landmarks = self._state.landmarks
        return None if landmarks is None else landmarks.altitude

    @property
    def unused_fixes(self) -> Mapping[Reason, int]:
        """Number of fixes of the newest frame that are assigned to no reported track, by reason."""
        return self._state.unused_fixes

    def _choice(self, vehicle: VehicleState | None = None) -> TargetChoice:
        """The rule by which targets are reported now. ``vehicle``: the vehicle's report at this instant."""
        state = self._state
        shown = state.landmarks is not None and state.landmarks.shows
        return TargetChoice(
            self._calibrated_by._state.calibrator, state.calibrator if self._corrects else None, shown, vehicle
        )

    def snapshot(self) -> Snapshot:
        """The present state, for :meth:`restore`."""
        if self._calibrating is None:
            return self._state
        return msgspec.structs.replace(self._state, calibrating=self._calibrating.snapshot())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot
        if self._calibrating is not None and snapshot.calibrating is not None:
            self._calibrating.restore(snapshot.calibrating)

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id. A track that this frame deleted is included once."""
        if self._calibrating is not None:
            self._calibrating.on_frame(view)
        if self._state.calibrator is not None:
            self._state = _calibration_predicted(self._state, self._state.calibrator, view)
        state, choice = self._state, self._choice(view.vehicle)
        landmarks = None if state.landmarks is None else state.landmarks.predicted(view)
        predicted, joint = self._predicted(view, landmarks), JointGate(state.biases)
        found = associated(predicted, view, choice, joint, state.detector)
        update = FrameUpdate(view, choice, state.detector, self._corrects, self.reports_innovations, found.id_trust)
        after, missed = update.after(predicted, found.taken)
        elapsed_ns = view.host_ns - (state.detector.last_ns or view.host_ns)
        merging = state.merging.after_frame(
            after, [track.id for track in missed], elapsed_ns, choice.target, ids=state.detector.ids
        )
        begun = Begun(merging.merged(after, choice.target), state.next_id)
        if len(found.taken) < len(view.fixes):
            begun = self._begun(begun, predicted, found, view, landmarks)
        detector = detector_after(
            state.detector,
            view.host_ns,
            predicted,
            begun.tracks,
            refused=begun.refused,
            id_trust=found.id_trust,
            crowd=_crowd_after(state.detector, view, predicted, found),
        )
        tracks = begun.tracks
        if landmarks is not None:
            tracks, landmarks = _by_landmarks(tracks, view, landmarks)
        tracks, next_id = reacquisition.independent(tracks, begun.next_id)
        living = tuple([track for track in tracks if track.life.state is not TrackState.DROPPED])
        living, wander = with_shared_evidence(living, state.wander)
        self._state = Snapshot(
            living,
            next_id,
            self._taught(view, living),
            merging=merging,
            detector=detector,
            unused_fixes=unused_fixes(tracks, begun),
            landmarks=landmarks,
            wander=wander,
            biases=joint.biases,
        )
        return self._choice(view.vehicle).reports(tracks, view)

    def _begun(
        self,
        before: Begun,
        predicted: Sequence[LiveTrack],
        found: FrameAssociation,
        view: FrameView,
        landmarks: LandmarkTracking | None,
    ) -> Begun:
        """The tracks and those initiated from fixes that no track took. ``predicted``: the tracks before the frame."""
        left = found.unused(view.fixes)
        free = without_strays(left, predicted, found.taken, view.host_ns, ids=self._state.detector.ids)
        target_of = self._filter.initiate if landmarks is None else landmarks.initiate
        begun = with_new(
            before, free, view.host_ns, target_of=target_of, branchings=found.branchings, detector=self._state.detector
        )
        return msgspec.structs.replace(begun, strays=len(left) - len(free))

    def _predicted(self, view: FrameView, landmarks: LandmarkTracking | None) -> list[LiveTrack]:
        """The live tracks, predicted to the instant of a frame."""
        predicted, opens = [], view.jumped_m or view.placed_sigma_m
        for track in self._state.alive:
            target = (opened(track.target, view) if opens else track.target).predict(view.host_ns)
            target = target if landmarks is None else landmarks.corrected(target)
            predicted.append(msgspec.structs.replace(track, target=target, fix=None, looked_for=False, innovation=None))
        return predicted

    @property
    def due_ns(self) -> HostNs | None:
        """Instant at which self-calibration catches up even if no further frame comes."""
        calibrator = self._calibrated_by._state.calibrator
        return None if calibrator is None else calibrator.due_ns

    def catch_up(self, now_ns: HostNs) -> None:
        """Let self-calibration process its due fixes while no frame comes."""
        if self._calibrating is not None:
            self._calibrating.catch_up(now_ns)
        calibrator, living = self._state.calibrator, self._state.alive
        if calibrator is not None and calibrator.due_ns is not None and calibrator.due_ns <= now_ns:
            caught_up = calibrator.caught_up(now_ns, {track.id for track in self._teachers(living, now_ns)})
            self._state = msgspec.structs.replace(self._state, calibrator=caught_up)

    def _teachers(self, living: Sequence[LiveTrack], now_ns: HostNs) -> list[LiveTrack]:
        """The tracks that self-calibration uses."""
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

    def _taught(self, view: FrameView, living: tuple[LiveTrack, ...]) -> Calibrator | None:
        """Self-calibration after this frame; None without self-calibration.

        It uses confirmed tracks only, because others may be clutter. It does not use targets whose height is not
        exactly known, because the joint estimate has one height error for all targets.
        """
        calibrator = self._state.calibrator
        if calibrator is None:
            return None
        old = self._teachers(living, view.host_ns)
        fixes = [(track.id, track.fix) for track in old if track.fix is not None and teaches(track.fix)]
        seen = [fix for fix in view.fixes if teaches(fix)]
        return calibrator.updated(view.host_ns, seen, fixes, {track.id for track in old})


def _crowd_after(
    detector: DetectorModel, view: FrameView, predicted: Sequence[LiveTrack], found: FrameAssociation
) -> Crowd:
    """The crowd after a frame; unchanged, without a look at the fixes, where tracks took nearly all of them."""
    crowd = detector.crowd
    if not crowd.labels and len(view.fixes) - len(found.taken) <= NEW_TARGETS:
        return crowd
    tentative = [found.taken[t.id][0] for t in predicted if t.id in found.taken and not (t.confirmed or t.branch_of)]
    elapsed_s = None if detector.last_ns is None else detector.elapsed_s(view.host_ns)
    return crowd.after_frame(found.unused(view.fixes), tentative, elapsed_s)


def _calibration_predicted(state: Snapshot, calibrator: Calibrator, view: FrameView) -> Snapshot:
    """The state with self-calibration predicted to the instant of a frame."""
    predicted = calibrator.predicted(view.host_ns)
    predicted.expect(view.fixes)
    return msgspec.structs.replace(state, calibrator=predicted)


def _by_landmarks(
    tracks: Sequence[LiveTrack], view: FrameView, landmarks: LandmarkTracking
) -> tuple[list[LiveTrack], LandmarkTracking]:
    """The tracks of a frame, corrected by its sights of landmarks, and the landmarks after that frame."""
    after = landmarks.tracked(view.landmarks, [t.fix for t in tracks if t.confirmed and t.fix is not None])
    return [msgspec.structs.replace(track, target=after.corrected(track.target)) for track in tracks], after
