"""The tracker of many targets: predict, associate, update, begin, end. One frame in, all tracks out."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.nouns import ErrorPriors, FrameView, GroundFix, Reason, Track, TrackState
from fwav_companion.tracking.association import Candidate, associate
from fwav_companion.tracking.base import Belief, Filter
from fwav_companion.tracking.calibrated import CalibratedBelief
from fwav_companion.tracking.calibration import CalibrationReport, KeptCalibration
from fwav_companion.tracking.calibrator import Calibrator
from fwav_companion.tracking.course import StateAt
from fwav_companion.tracking.kalman import StaticKalman
from fwav_companion.tracking.lifecycle import Life, born, ended, seen, unseen
from fwav_companion.tracking.linear import horizontal_sigma
from fwav_companion.tracking.lowpass import LowPass
from fwav_companion.tracking.moving import MovingKalman
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.workshop import Workshop

MAX_TRACKS = 20
"""Live at once: twice what a pilot can care for, and what the assignment is sized for."""
KEEP_STATIC_NS = 300 * NS_PER_S
"""What stood is looked for where it stood, five minutes long: several rounds of any survey."""
KEEP_MOVING_NS = 10 * NS_PER_S
"""What moved can be anywhere within 15 m after that."""


class Alive(msgspec.Struct, frozen=True):
    """One live track. Immutable."""

    id: int
    label: str
    belief: Belief
    life: Life
    detector_id: int | None = None
    last_pixel: tuple[float, float] | None = None
    fix: GroundFix | None = None
    """Of the newest frame."""
    level_sigma_m: float = 0.0
    """Of the ground's level by the newest fix: the same in every fix, so no number of them takes it away."""


class Snapshot(msgspec.Struct, frozen=True):
    """All that a tracker knows: references to immutable things."""

    alive: tuple[Alive, ...] = ()
    """By id."""
    next_id: int = 1
    calibrator: Calibrator | None = None
    """With self-calibration."""


class Tracker:
    """Follows targets through frames that come in the order of their capture; :class:`Reorder` sees to that."""

    __slots__ = ("_filter", "_keep_ns", "_state")

    def __init__(self, belief_filter: Filter, keep_ns: int, calibrator: Calibrator | None = None) -> None:
        self._filter = belief_filter
        self._keep_ns = keep_ns
        self._state = Snapshot(calibrator=calibrator)

    @property
    def calibration(self) -> CalibrationReport | None:
        """What self-calibration knows; None without it."""
        return None if self._state.calibrator is None else self._state.calibrator.report()

    def snapshot(self) -> Snapshot:
        """The present state, to come back to."""
        return self._state

    def restore(self, snapshot: Snapshot) -> None:
        """Back to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id; those that it ended are in it, told once."""
        alive = tuple(
            msgspec.structs.replace(track, belief=track.belief.predicted(view.host_ns), fix=None)
            for track in self._state.alive
        )
        taken = self._associated(alive, view.fixes)
        kept = [self._after(track, taken.get(track.id), view) for track in alive]
        used = {id(fix) for fix, _ in taken.values()}
        tracks, next_id = self._with_newborn(kept, [fix for fix in view.fixes if id(fix) not in used], view.host_ns)
        living = tuple(track for track in tracks if track.life.state is not TrackState.DROPPED)
        self._state = Snapshot(living, next_id, self._learned(view, living))
        return tuple(self._told(track, view.frame, view.host_ns, view.boot_ns) for track in tracks)

    def drop_all(self, reason: Reason, frame: int, host_ns: HostNs, boot_ns: BootNs) -> tuple[Track, ...]:
        """End every track; their ids are not used again."""
        dropped = tuple(
            msgspec.structs.replace(track, life=ended(track.life, reason), fix=None) for track in self._state.alive
        )
        told = tuple(self._told(track, frame, host_ns, boot_ns) for track in dropped)
        calibrator = self._state.calibrator
        self._state = Snapshot((), self._state.next_id, None if calibrator is None else calibrator.restarted())
        return told

    def _associated(self, alive: tuple[Alive, ...], fixes: tuple[GroundFix, ...]) -> dict[int, tuple[GroundFix, float]]:
        """Track id -> its fix, and how much likelier it is than a false one.

        Believed tracks choose first: a newborn must not take a known target's fix.
        """
        taken: dict[int, tuple[GroundFix, float]] = {}
        free = list(fixes)
        for believed in (True, False):
            group = [track for track in alive if (track.life.confirmed_ns is not None) is believed]
            if not (group and free):
                continue
            candidates = [
                Candidate(track.label, track.belief, track.detector_id, self._calibrated(track)) for track in group
            ]
            pairs = associate(candidates, free)
            taken |= {group[i].id: (free[j], likelier) for i, (j, likelier) in pairs.items()}
            gone = {j for j, _ in pairs.values()}
            free = [fix for j, fix in enumerate(free) if j not in gone]
        return taken

    def _after(self, track: Alive, taken: tuple[GroundFix, float] | None, view: FrameView) -> Alive:
        if taken is None:
            looked = view.could_see(self._seen_as(track).position_ned)
            life = unseen(track.life, view.host_ns, looked=looked, keep_ns=self._keep_ns)
            return msgspec.structs.replace(track, life=life)
        fix, likelier = taken
        detection = fix.sighting.detection
        return Alive(
            track.id,
            track.label,
            track.belief.updated(fix),
            seen(track.life, view.host_ns, likelier),
            detection.detector_id if detection.detector_id is not None else track.detector_id,
            (detection.u, detection.v),
            fix,
            fix.level_sigma_m,
        )

    def _with_newborn(self, tracks: list[Alive], fixes: list[GroundFix], host_ns: HostNs) -> tuple[list[Alive], int]:
        """New tracks for fixes that belong to none; where the table is full the least certain tentative one yields."""
        next_id = self._state.next_id
        newborn_from = next_id
        for fix in fixes:
            if _living(tracks) >= MAX_TRACKS and not _make_room(tracks, newborn_from):
                break
            detection = fix.sighting.detection
            pixel = (detection.u, detection.v)
            belief = self._filter.started(fix)
            life, level_sigma_m = born(host_ns), fix.level_sigma_m
            newborn = Alive(next_id, detection.label, belief, life, detection.detector_id, pixel, fix, level_sigma_m)
            tracks.append(newborn)
            next_id += 1
        return tracks, next_id

    def _told(self, track: Alive, frame: int, host_ns: HostNs, boot_ns: BootNs) -> Track:
        belief, life = self._seen_as(track), track.life
        return Track(
            id=track.id,
            label=track.label,
            state=life.state,
            reason=life.reason,
            host_ns=host_ns,
            boot_ns=boot_ns,
            frame=frame,
            position_ned=belief.position_ned,
            cov=_with_level(belief.cov, track.level_sigma_m),
            relative_cov=_with_level(belief.relative_cov, track.level_sigma_m),
            velocity_ned=belief.velocity_ned,
            velocity_cov=belief.velocity_cov,
            fix=track.fix,
            first_host_ns=life.first_ns,
            confirmed_host_ns=life.confirmed_ns,
            last_seen_host_ns=life.last_seen_ns,
            last_pixel=track.last_pixel,
        )

    def _learned(self, view: FrameView, living: tuple[Alive, ...]) -> Calibrator | None:
        calibrator = self._state.calibrator
        if calibrator is None:
            return None
        before = {track.id: track.life.last_seen_ns for track in self._state.alive}
        fixes = [
            (track.id, track.fix, s_from_ns(view.host_ns - before.get(track.id, view.host_ns)))
            for track in living
            if track.fix is not None
        ]
        return calibrator.learned(view.host_ns, view.fixes, fixes, {track.id for track in living})

    def _calibrated(self, track: Alive) -> CalibratedBelief | None:
        """The track by the joint estimate, where that holds the target."""
        calibrator = self._state.calibrator
        placed = None if calibrator is None else calibrator.placed(track.id)
        if calibrator is None or placed is None:
            return None
        return CalibratedBelief(calibrator, track.id, placed, track.belief)

    def _seen_as(self, track: Alive) -> Belief:
        """The track by the surer of its own filter and the joint estimate: a flight may show the latter little."""
        calibrated = self._calibrated(track)
        if calibrated is None or horizontal_sigma(calibrated.cov) > horizontal_sigma(track.belief.cov):
            return track.belief
        return calibrated


def make_tracker(
    options: TrackingOptions,
    priors: ErrorPriors,
    state_at: StateAt | None = None,
    kept: KeptCalibration | None = None,
) -> Tracker:
    """The tracker that [tracking] asks for.

    ``state_at`` tells the vehicle's state at an instant of the last second or so; self-calibration finds a large time
    offset only with it. ``kept``: a calibration of an earlier flight with this camera.
    """
    if options.filter == "lowpass":
        return Tracker(LowPass(options.alpha, options.alpha_rate_hz, priors), KEEP_STATIC_NS)
    if options.motion == "moving":
        return Tracker(MovingKalman(priors), KEEP_MOVING_NS)
    calibrator = Calibrator(Workshop(priors, state_at, kept)) if options.self_calibration else None
    return Tracker(StaticKalman(priors), KEEP_STATIC_NS, calibrator)


def _with_level(cov: Matrix3, level_sigma_m: float) -> Matrix3:
    """What is not known of the ground's own level stands in every fix, and so in the track."""
    north, east, (down_north, down_east, down_down) = cov
    return (north, east, (down_north, down_east, down_down + level_sigma_m * level_sigma_m))


def _living(tracks: list[Alive]) -> int:
    return sum(track.life.state is not TrackState.DROPPED for track in tracks)


def _make_room(tracks: list[Alive], newborn_from: int) -> bool:
    """End the least certain tentative track that was not born in this very frame; False where there is none."""
    yielding = [
        i
        for i, track in enumerate(tracks)
        if track.life.state is TrackState.TENTATIVE and track.id < newborn_from and track.fix is None
    ]
    if not yielding:
        return False
    worst = max(yielding, key=lambda i: horizontal_sigma(tracks[i].belief.cov))
    tracks[worst] = msgspec.structs.replace(tracks[worst], life=ended(tracks[worst].life, Reason.TOO_MANY_TRACKS))
    return True
