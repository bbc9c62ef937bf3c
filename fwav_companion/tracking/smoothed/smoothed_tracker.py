"""The tracker whose targets and gates are the smoother's.

Tracks begin, are confirmed, coast and end by the rules of ``tracking``. A confirmed track's detections go to the
smoother, those from before its confirmation, too. From the first solve that holds a target on, its gate, its place and
its covariance are the live filter's; before, they are those of a filter of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.solve import Estimate
from fwav_companion.estimation.wander import SMOOTH
from fwav_companion.estimation.whole_flight import WholeFlight
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration import CalibrationReport, KeptCalibration
from fwav_companion.tracking.filters.base import Filter
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.smoothed.flight_errors import sample_noise, shared_priors
from fwav_companion.tracking.smoothed.flight_ground import (
    ReferenceNow,
    height_wander_m,
    level_at_home,
    surface_of,
    target_height,
)
from fwav_companion.tracking.smoothed.flight_samples import FlightSamples, SampleSource, sightings_of
from fwav_companion.tracking.smoothed.smoothed_landmarks import SmoothedLandmarks
from fwav_companion.tracking.smoothed.smoothed_report import smoothed_report
from fwav_companion.tracking.smoothed.smoothed_target import FrameAnswers, SmoothedChoice
from fwav_companion.tracking.smoothed.solve_jobs import PendingSolve, SmootherOptions, SolveCounts
from fwav_companion.tracking.snapshot import Snapshot
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.tracking.tracker import Tracker
from fwav_companion.types import (
    ErrorPriors,
    FrameView,
    GroundReference,
    HeightReference,
    Landmark,
    LandmarkAltitude,
    LandmarkRecord,
    Reason,
    Track,
    VehicleState,
)
from fwav_companion.types.flight_status import SolveReport
from fwav_companion.types.tracks import FinalPlace

TAKE_OVER_S = 0.5
"""Time from a solve's start to its take-over, on the clock of captures: fixed, so that a replay gives the same answers,
and longer than a solve takes on a small board (40 to 120 M instructions at 500 M a second)."""
SEARCH_TAKE_OVER_S = 1.5
"""The same for a solve with a search of the delay: about 350 M instructions with one target, 800 M with ten. These are
606 M and 1 266 M, counted before the search left out hopeless starts, less the share of CPU time that this saves. Until
the first one the answers are those of the targets' own filters, which consider the priors."""
MOST_WAITING = 64
"""Detections of a tentative track that are kept for the smoother."""
STAMP_SIGMA_S = 0.0007
"""One sigma of a picture's instant before the first state is known: stamps of attitudes come 0 to 2.5 ms late."""

NO_ESTIMATE = Estimate(0.0, np.full(1, np.nan), {}, np.zeros(0), np.zeros((0, 3)), SMOOTH)


@dataclass
class Smoothing:
    """The smoother between two frames."""

    estimator: Estimator
    pending: PendingSolve | None
    waiting: dict[int, tuple[Sightings, ...]]
    """Detections of tentative tracks, by track id."""
    landmarks: SmoothedLandmarks
    reference: GroundReference
    """The ground of the estimator's model."""
    renamed: frozenset[int] = frozenset()
    """Ids of merged tracks whose detections are counted as the senior's."""

    def copy(self) -> Smoothing:
        """A snapshot."""
        return replace(
            self, estimator=self.estimator.copy(), waiting=dict(self.waiting), landmarks=self.landmarks.copy()
        )


class SmoothedTracker(Tracker):
    """Tracks targets through frames in capture order."""

    __slots__ = (
        "_answers",
        "_consider",
        "_ground",
        "_host_ns",
        "_known",
        "_priors",
        "_samples",
        "_sights",
        "_smoother",
        "_smoothing",
        "_solves",
        "_start",
    )

    def __init__(
        self, target_filter: Filter, keep_ns: int, priors: ErrorPriors, source: SampleSource, *, lever_m: Vector3,
        kept: KeptCalibration | None = None, consider: bool = False, smoother: SmootherOptions | None = None,
        patience_ns: int = 0, landmarks: Sequence[Landmark] = (), ground: ReferenceNow = level_at_home,
    ) -> None:  # fmt: skip
        """``consider``: no self-calibration; the priors of all parameters count in every covariance.

        ``smoother``: starts each solve; its estimate is taken over at a fixed later instant of the captures.
        """
        super().__init__(target_filter, keep_ns, patience_ns=patience_ns)
        self._priors, self._consider, self._smoother = priors, consider, smoother or SmootherOptions()
        self._start = shared_priors(priors, kept)
        self._known, self._ground = tuple(landmarks), ground
        self._samples = FlightSamples(source, lever_m, priors, has_gimbal=priors.gimbal is not None)
        self._smoothing = self._begin_smoothing()
        self._answers: FrameAnswers | None = None
        self._sights: Sightings | None = None
        self._host_ns = HostNs(0)
        self._solves = SolveCounts()

    def _begin_smoothing(self) -> Smoothing:
        reference = self._ground()
        noise = sample_noise(self._priors, None, STAMP_SIGMA_S, height_wander_m(reference, self._priors))
        whole_flight = WholeFlight() if self._smoother.whole_flight else None
        estimator = Estimator(
            self._start, noise, ground=surface_of(reference), consider=self._consider, whole_flight=whole_flight
        )
        return Smoothing(estimator, None, {}, SmoothedLandmarks(self._known), reference)

    @property
    def calibration(self) -> CalibrationReport | None:
        """The report of self-calibration; None without it."""
        return None if self._consider else smoothed_report(self._smoothing.estimator, self._host_ns)

    @property
    def solves(self) -> SolveReport:
        """Counts of the flight's solves; a return to an earlier state does not change them."""
        return self._solves.report

    def final_places(self) -> dict[int, FinalPlace]:
        """Static targets by the whole flight, by track id."""
        return self._smoothing.estimator.final_places()

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """The record of each landmark's sights so far."""
        return self._smoothing.landmarks.records(self._smoothing.estimator)

    @property
    def landmark_altitude(self) -> LandmarkAltitude | None:
        """Error of the vehicle's altitude by the landmarks; None before one is used."""
        smoothing = self._smoothing
        return smoothing.landmarks.altitude(smoothing.estimator, smoothing.reference)

    def snapshot(self) -> Snapshot:
        """The present state, for :meth:`restore`."""
        return msgspec.structs.replace(self._state, smoothing=self._smoothing.copy())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot
        if isinstance(snapshot.smoothing, Smoothing):
            self._smoothing = snapshot.smoothing.copy()

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id. A track that this frame deleted is included once."""
        smoothing, t = self._smoothing, s_from_ns(view.boot_ns)
        estimator, self._host_ns = smoothing.estimator, view.host_ns
        reference = self._ground()
        self._samples.feed(estimator, reference)
        self._follow_ground(reference)
        self._take_over(t)
        self._follow_receiver(view)
        self._answers = FrameAnswers(estimator, t, view, is_mapped=reference.surface is not None)
        self._sights = sightings_of(view.frame, view.fixes) if view.fixes else None
        if self._sights is not None:
            prediction = estimator.predict(self._sights)
            if prediction is not None:
                self._answers.add_gates(view.fixes, prediction)
        return super().on_frame(view)

    def _follow_ground(self, reference: GroundReference) -> None:
        """Take a home or an elevation model that was moved, or a rangefinder's first reading, as the ground."""
        smoothing, level_m = self._smoothing, self._samples.level_m
        if reference.height is HeightReference.RANGE and level_m is not None:
            reference = msgspec.structs.replace(reference, level_m=level_m)
        if reference != smoothing.reference:
            smoothing.reference = reference
            smoothing.estimator.model = replace(smoothing.estimator.model, ground=surface_of(reference))

    def _take_over(self, t: float) -> None:
        """Take over a solve that is due. One that is late is counted, and taken over at the first frame after it."""
        smoothing, pending = self._smoothing, self._smoothing.pending
        if pending is None or t < pending.due_s:
            return
        try:
            estimate = pending.job.estimate()
        except np.linalg.LinAlgError:  # what no solve can be made of leaves the former estimate
            estimate = NO_ESTIMATE
        if estimate is None:
            self._solves.miss(pending)
            return
        smoothing.pending = None
        if not estimate.is_finite:
            self._solves.failed += 1
            return
        smoothing.estimator.adopt(estimate)
        self._solves.taken += 1

    def _follow_receiver(self, view: FrameView) -> None:
        """Take the receiver's own accuracy now, and the stamps' noise, from the next solve on."""
        state, estimator = view.vehicle, self._smoothing.estimator
        if state is None:
            return
        path, noise = estimator.carrier.path, estimator.model.noise
        if state.position_bias_m is not None:
            path.add_accuracy(s_from_ns(view.boot_ns), state.position_bias_m)
        worst_m = max((each.sigma_m for each in path.accuracies), default=noise.position_wander_m)
        stamp_sigma_s = max(STAMP_SIGMA_S, state.stamp_sigma_s)
        new = replace(noise, position_wander_m=worst_m, stamp_jitter_s=stamp_sigma_s)
        if new != noise:
            estimator.model = replace(estimator.model, noise=new)

    def _choice(self, vehicle: VehicleState | None = None) -> TargetChoice:
        if self._answers is None:
            return TargetChoice(None, None, False, vehicle)
        return SmoothedChoice(None, None, False, vehicle, frame=self._answers)

    def _taught(self, view: FrameView, living: tuple[LiveTrack, ...]) -> None:
        """Hand the frame's detections of confirmed tracks to the smoother, and start a solve where one is due."""
        smoothing, sights = self._smoothing, self._sights
        estimator = smoothing.estimator
        self._rename(living)
        if sights is not None:
            index = {id(fix): i for i, fix in enumerate(view.fixes)}
            taught: list[tuple[int, int]] = []
            confirmed = {track.id for track in self._teachers(living, view.host_ns)}
            surveyed = {sight.fix.sighting.index: sight for sight in view.landmarks}
            for track in living:
                if track.fix is None or track.id <= 0 or not _is_usable(track):
                    continue
                i = index[id(track.fix)]
                if track.id in confirmed:
                    self._release(track)
                    taught.append((i, track.id))
                    sight = surveyed.get(track.fix.sighting.index)
                    if sight is not None:
                        smoothing.landmarks.add(sight, track.id, estimator, smoothing.reference)
                else:
                    own = sights.select(np.array([i])).with_targets(np.array([track.id]))
                    before = smoothing.waiting.get(track.id, ())
                    smoothing.waiting[track.id] = (*before, own)[-MOST_WAITING:]
            if taught:
                taught.sort()
                rows, targets = np.array(taught, np.int64).T
                estimator.update(sights.select(rows).with_targets(targets))
        live = {track.id for track in living}
        smoothing.waiting = {k: each for k, each in smoothing.waiting.items() if k in live}
        now = s_from_ns(view.boot_ns)
        if smoothing.pending is None and estimator.is_solve_due(now):
            task = estimator.start_solve(now)
            due_s = now + (SEARCH_TAKE_OVER_S if task.search else TAKE_OVER_S)
            smoothing.pending = PendingSolve(due_s, self._smoother.solver(task))

    def _release(self, track: LiveTrack) -> None:
        """Hand over the detections of a track from before its confirmation, and the height of its target."""
        smoothing = self._smoothing
        for sights in smoothing.waiting.pop(track.id, ()):
            smoothing.estimator.update(sights)
        height_m, sigma_m = target_height(track.last_fix, self._priors)
        if (height_m or sigma_m) and track.id not in smoothing.landmarks.tracks:
            smoothing.estimator.targets[track.id] = TargetPrior(height_m=height_m, height_sigma_m=sigma_m)

    def _rename(self, living: tuple[LiveTrack, ...]) -> None:
        smoothing = self._smoothing
        for track in living:
            for old in track.replaces:
                if old not in smoothing.renamed:
                    smoothing.estimator.rename(old, track.id)
                    smoothing.renamed |= {old}

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """Delete every track, as of the newest frame; their ids are not used again."""
        reported = super().drop_all(reason, view)
        self._samples.restart()
        self._smoothing = self._begin_smoothing()
        self._answers = None
        return reported


def _is_usable(track: LiveTrack) -> bool:
    """Whether the smoother may use the track's fix: a world with positions."""
    return track.fix is not None and not track.fix.sighting.relative
