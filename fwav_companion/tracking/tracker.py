"""The tracker of many targets: predict, associate, update, begin, end. One frame in, all tracks out."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.small_matrices import horizontal_sigma
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.self_calibration.calibrator import Calibrator
from fwav_companion.self_calibration.report import CalibrationReport
from fwav_companion.tracking.association import Candidate, associate
from fwav_companion.tracking.filters.base import Filter, TargetState
from fwav_companion.tracking.lifecycle import unseen
from fwav_companion.tracking.self_calibrated import CalibratedTargetState, MisplacedTargetState
from fwav_companion.tracking.track_merging import TrackMerging
from fwav_companion.tracking.track_state import LiveTrack, initiate, innovation
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import FrameView, GroundFix, Reason, Track, TrackState

MAX_TRACKS = 20
"""Live at once: twice what a pilot can care for, and what the assignment is sized for."""


class Snapshot(msgspec.Struct, frozen=True):
    """All that a tracker knows: references to immutable things."""

    alive: tuple[LiveTrack, ...] = ()
    """By id."""
    next_id: int = 1
    calibrator: Calibrator | None = None
    """With self-calibration."""
    beside: Snapshot | None = None
    """Of the tracker that calibrates in the place of this one."""
    doubles: TrackMerging = TrackMerging()


class Tracker:
    """Follows targets through frames that come in the order of their capture; :class:`Reorder` sees to that."""

    __slots__ = ("_beside", "_corrects", "_filter", "_keep_ns", "_patience_ns", "_state", "reports_innovations")

    def __init__(
        self,
        belief_filter: Filter,
        keep_ns: int,
        calibrator: Calibrator | None = None,
        *,
        corrects: bool = True,
        patience_ns: int = 0,
        beside: Tracker | None = None,
    ) -> None:
        """``corrects``: what self-calibration finds moves the tracks; otherwise it is only told.

        ``patience_ns``: how old a track must be before it teaches. ``beside``: a tracker of the same frames that
        calibrates in the place of this one.
        """
        self.reports_innovations = False
        """Whether tracks tell how little their fixes were expected: work that flying has no use for."""
        self._filter = belief_filter
        self._keep_ns = keep_ns
        self._corrects = corrects
        self._patience_ns = patience_ns
        self._beside = beside
        self._state = Snapshot(calibrator=calibrator, beside=None if beside is None else beside.snapshot())

    @property
    def calibration(self) -> CalibrationReport | None:
        """What self-calibration knows; None without it."""
        calibrator = self._calibrator
        return None if calibrator is None else calibrator.report()

    @property
    def _calibrator(self) -> Calibrator | None:
        return self._state.calibrator if self._beside is None else self._beside._calibrator

    def snapshot(self) -> Snapshot:
        """The present state, to come back to."""
        return self._state

    def restore(self, snapshot: Snapshot) -> None:
        """Back to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot
        if self._beside is not None and snapshot.beside is not None:
            self._beside.restore(snapshot.beside)

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id; those that it ended are in it, told once."""
        if self._beside is not None:
            self._beside.on_frame(view)
        alive = tuple(
            msgspec.structs.replace(track, belief=track.belief.predict(view.host_ns), fix=None, innovation=None)
            for track in self._state.alive
        )
        taken = self._associated(alive, view.fixes)
        kept = [self._after(track, taken.get(track.id), view) for track in alive]
        doubles = self._state.doubles.seen(alive, kept, self._seen_as)
        kept = doubles.settled(kept)
        used = {id(fix) for fix, _ in taken.values()}
        tracks, next_id = self._with_newborn(kept, [fix for fix in view.fixes if id(fix) not in used], view.host_ns)
        living = tuple(track for track in tracks if track.life.state is not TrackState.DROPPED)
        self._state = Snapshot(living, next_id, self._learned(view, living), self._besides(), doubles)
        return tuple(self._told(track, view) for track in tracks)

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """End every track, as of the newest frame; their ids are not used again."""
        dropped = tuple(
            msgspec.structs.replace(track.ended(reason), fix=None, innovation=None) for track in self._state.alive
        )
        told = tuple(self._told(track, view) for track in dropped)
        calibrator = self._state.calibrator
        restarted = None if calibrator is None else calibrator.restarted()
        if self._beside is not None:
            self._beside.drop_all(reason, view)
        self._state = Snapshot((), self._state.next_id, restarted, self._besides())
        return told

    def _besides(self) -> Snapshot | None:
        return None if self._beside is None else self._beside.snapshot()

    def _associated(
        self, alive: tuple[LiveTrack, ...], fixes: tuple[GroundFix, ...]
    ) -> dict[int, tuple[GroundFix, float]]:
        """Track id -> its fix, and how much likelier it is than a false one.

        Newborns yield to believed tracks: they must not take a known target's fix.
        """
        if not (alive and fixes):
            return {}
        candidates = [
            Candidate(
                track.label,
                track.belief,
                track.detector_id,
                self._calibrated(track),
                track.life.confirmed_ns is not None,
            )
            for track in alive
        ]
        return {alive[i].id: (fixes[j], likelier) for i, (j, likelier) in associate(candidates, fixes).items()}

    def _after(self, track: LiveTrack, taken: tuple[GroundFix, float] | None, view: FrameView) -> LiveTrack:
        if taken is None:
            place_ned = self._seen_as(track).position_ned
            looked = is_missed_detection(view, track.label, place_ned, self._margin_m(track))
            life = unseen(track.life, view.host_ns, looked=looked, keep_ns=self._keep_ns)
            return msgspec.structs.replace(track, life=life)
        after = track.seen_in(view.host_ns, *taken)
        if not self.reports_innovations:
            return after
        return msgspec.structs.replace(after, innovation=innovation(self._seen_as(track), taken[0]))

    def _margin_m(self, track: LiveTrack) -> float:
        """How far beside the track the target may show: by what is not known of the mount, or by what was found."""
        calibrator = self._calibrator if self._corrects else None
        return 0.0 if calibrator is None else calibrator.mount_off * track.slant_m

    def _with_newborn(
        self, tracks: list[LiveTrack], fixes: list[GroundFix], host_ns: HostNs
    ) -> tuple[list[LiveTrack], int]:
        """New tracks for fixes that belong to none; where the table is full the least certain tentative one yields."""
        next_id = self._state.next_id
        newborn_from = next_id
        for fix in fixes:
            if _living(tracks) >= MAX_TRACKS and not _make_room(tracks, newborn_from):
                break
            tracks.append(initiate(next_id, fix, self._filter.initiate(fix), host_ns))
            next_id += 1
        return tracks, next_id

    def _learned(self, view: FrameView, living: tuple[LiveTrack, ...]) -> Calibrator | None:
        calibrator = self._state.calibrator
        if calibrator is None:
            return None
        old = [track for track in living if view.host_ns - track.life.first_ns >= self._patience_ns]
        fixes = [(track.id, track.fix) for track in old if track.fix is not None]
        return calibrator.learned(view.host_ns, view.fixes, fixes, {track.id for track in old})

    def _calibrated(self, track: LiveTrack) -> CalibratedTargetState | None:
        """The track by the joint estimate, where that holds the target and may correct it."""
        calibrator = self._state.calibrator if self._corrects else None
        placed = None if calibrator is None else calibrator.placed(track.id)
        if calibrator is None or placed is None:
            return None
        return CalibratedTargetState(calibrator, track.id, placed, track.belief)

    def _told(self, track: LiveTrack, view: FrameView) -> Track:
        """As others see it. While the mount is known to be wrong it is told in doubt, and single fixes are not told."""
        misplaced_m = 0.0 if self._calibrator is None else self._calibrator.misplaced_m
        if misplaced_m == 0.0:
            return track.told(self._seen_as(track), view)
        doubted = msgspec.structs.replace(track, fix=None, innovation=None)
        return doubted.told(MisplacedTargetState(self._seen_as(track), misplaced_m), view)

    def _seen_as(self, track: LiveTrack) -> TargetState:
        """The track by the surer of its own filter and the joint estimate: a flight may show the latter little.

        A filter that rests on a prior which the flight denies is sure of nothing.
        """
        calibrated, calibrator = self._calibrated(track), self._calibrator
        if calibrated is None or calibrator is None:
            return track.belief
        surer = horizontal_sigma(track.belief.cov) < horizontal_sigma(calibrated.cov)
        return track.belief if surer and not calibrator.denied else calibrated


def _living(tracks: list[LiveTrack]) -> int:
    return sum(track.life.state is not TrackState.DROPPED for track in tracks)


def _make_room(tracks: list[LiveTrack], newborn_from: int) -> bool:
    """End a track that this frame did not see: the least certain tentative one, else the one that was out of sight the
    longest, so that what is remembered does not blind to what is there. False where all were seen, or just born.
    """
    unseen_now = [i for i, track in enumerate(tracks) if track.fix is None and track.id < newborn_from]
    tentative = [i for i in unseen_now if tracks[i].life.state is TrackState.TENTATIVE]
    coasting = [i for i in unseen_now if tracks[i].life.state is TrackState.COASTING]
    if tentative:
        yields = max(tentative, key=lambda i: horizontal_sigma(tracks[i].belief.cov))
    elif coasting:
        yields = min(coasting, key=lambda i: tracks[i].life.last_seen_ns)
    else:
        return False
    tracks[yields] = tracks[yields].ended(Reason.TOO_MANY_TRACKS)
    return True
