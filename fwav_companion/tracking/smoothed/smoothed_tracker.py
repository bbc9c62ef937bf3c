"""The tracker by the smoother: its live filter predicts, gates and answers for every track, from the first sighting on.

A detection that no track explains begins a tentative track, whose target begins in the live filter at the present
calibration. Tracks are confirmed, coast and are deleted by the rules of ``lifecycle``. All sightings of a confirmed
static track go to the solves. Of targets that may move, only those teach that were still for long (``still_targets``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

import msgspec
import numpy as np

from fwav_companion.estimation.common_errors import common_errors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.solve import Estimate
from fwav_companion.estimation.wander import SMOOTH
from fwav_companion.estimation.whole_flight import WholeFlight
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration import CalibrationReport, KeptCalibration
from fwav_companion.tracking.crowd import NEW_TARGETS, Crowd
from fwav_companion.tracking.motions import Motions
from fwav_companion.tracking.smoothed.flight_clock import FlightClock
from fwav_companion.tracking.smoothed.flight_errors import sample_noise, shared_priors
from fwav_companion.tracking.smoothed.flight_ground import (
    ReferenceNow,
    height_wander_m,
    level_at_home,
    surface_of,
    target_height,
)
from fwav_companion.tracking.smoothed.flight_model import follow_ground, follow_receiver
from fwav_companion.tracking.smoothed.flight_samples import FlightSamples, sightings_of
from fwav_companion.tracking.smoothed.picture_samples import PictureSamples
from fwav_companion.tracking.smoothed.sample_source import SampleSource
from fwav_companion.tracking.smoothed.smoothed_frame import FrameTracks
from fwav_companion.tracking.smoothed.smoothed_landmarks import SmoothedLandmarks
from fwav_companion.tracking.smoothed.smoothed_merging import merged
from fwav_companion.tracking.smoothed.smoothed_report import smoothed_report
from fwav_companion.tracking.smoothed.smoothed_state import SmoothedState
from fwav_companion.tracking.smoothed.smoothed_target import FrameAnswers, SmoothedTarget
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.tracking.smoothed.solve_jobs import PendingSolve, SmootherOptions, SolveCounts
from fwav_companion.tracking.smoothed.stored_calibration import StoredCalibration
from fwav_companion.tracking.smoothed.teaching import forget_ended, teach, teach_displaced
from fwav_companion.tracking.track_table import detector_after
from fwav_companion.types import (
    ErrorPriors,
    FrameView,
    Landmark,
    LandmarkAltitude,
    LandmarkRecord,
    Reason,
    Track,
    TrackState,
)
from fwav_companion.types.flight_status import SolveReport
from fwav_companion.types.tracks import CommonErrors, FinalPlace

TAKE_OVER_S = 0.5
"""Time from a solve's start to its take-over, on the clock of captures: fixed, so that a replay gives the same answers,
and longer than a solve takes on a small board (40 to 120 M instructions at 500 M a second)."""
SEARCH_TAKE_OVER_S = 1.5
"""The same for a solve with a search of the delay: about 350 M instructions with one target, 800 M with ten. These are
606 M and 1 266 M, counted before the search left out hopeless starts, less the share of CPU time that this saves. Until
the first one the answers are those of the live filter by the priors."""
STAMP_SIGMA_S = 0.0007
"""One sigma of a picture's instant before the first state is known: stamps of attitudes come 0 to 2.5 ms late."""

NO_ESTIMATE = Estimate(0.0, np.full(1, np.nan), {}, np.zeros(0), np.zeros((0, 3)), SMOOTH)


class SmoothedTracker:
    """Tracks targets through frames in capture order."""

    __slots__ = (
        "_answers",
        "_begun_s",
        "_clock",
        "_consider",
        "_ground",
        "_host_ns",
        "_known",
        "_lever_m",
        "_motions",
        "_own_poses",
        "_priors",
        "_samples",
        "_smoother",
        "_solves",
        "_start",
        "_state",
        "reports_innovations",
    )

    def __init__(
        self, priors: ErrorPriors, source: SampleSource | None, *, lever_m: Vector3,
        kept: KeptCalibration | None = None, consider: bool = False, smoother: SmootherOptions | None = None,
        landmarks: Sequence[Landmark] = (), motions: Motions | None = None, ground: ReferenceNow = level_at_home,
        own_poses: bool = False,
    ) -> None:  # fmt: skip
        """``source``: the vehicle's telemetry; None: each picture has its own pose.

        ``own_poses``: whether each frame's pose has errors of its own, as those of pictures and videos have.

        ``consider``: no self-calibration; the priors of all parameters count in every covariance.

        ``smoother``: starts each solve; its estimate is taken over at a fixed later instant of the captures.
        """
        self.reports_innovations = False
        self._priors, self._consider, self._smoother = priors, consider, smoother or SmootherOptions()
        configured = shared_priors(priors, None)
        self._start = configured if kept is None else shared_priors(priors, kept)
        self._lever_m, self._motions = lever_m, motions or Motions()
        self._known = () if all(self._motions.moves(each.label) for each in landmarks) else tuple(landmarks)
        self._ground, self._solves, self._own_poses = ground, SolveCounts(), own_poses
        clock = self._clock = FlightClock()
        self._samples: FlightSamples | PictureSamples = PictureSamples(clock)
        if source is not None:
            self._samples = FlightSamples(source, clock, lever_m, priors, has_gimbal=priors.gimbal is not None)
        self._state = self._begun(StoredCalibration(configured), 1)
        self._answers: FrameAnswers | None = None
        self._host_ns, self._begun_s = HostNs(0), -inf
        """Capture of the frame with which the live filter began; before that, of the newest frame."""

    def _begun(self, stored: StoredCalibration, next_id: int, *, relative: bool = False) -> SmoothedState:
        """The state before the first frame. Without a position nothing calibrates: targets move as the vehicle does."""
        reference, start = self._ground(), stored.configured if stored.dropped else self._start
        noise = sample_noise(
            self._priors, None, STAMP_SIGMA_S, height_wander_m(reference, self._priors), relative=relative
        )
        estimator = Estimator(
            start, noise, ground=surface_of(reference), consider=self._consider or relative,
            whole_flight=WholeFlight() if self._smoother.whole_flight else None,
            pictures=isinstance(self._samples, PictureSamples),
        )  # fmt: skip
        return SmoothedState(estimator, SmoothedLandmarks(self._known), reference, stored, relative, next_id)

    @property
    def calibration(self) -> CalibrationReport | None:
        """The report of self-calibration; None without it."""
        if self._consider:
            return None
        state = self._state
        return smoothed_report(state.estimator, self._host_ns, state.turns.mistake, stored=state.stored)

    @property
    def solves(self) -> SolveReport:
        """Counts of the flight's solves; a return to an earlier state does not change them."""
        return self._solves.report

    def final_places(self) -> dict[int, FinalPlace]:
        """Static targets by the whole flight, by track id; of targets that may move, those that were still."""
        state, places = self._state, self._state.estimator.final_places()
        return {state.track_of(number): place for number, place in places.items()}

    @property
    def crowd(self) -> Crowd:
        """The labels of which more detections fit no track than new targets explain."""
        return self._state.detector.crowd

    @property
    def landmarks(self) -> tuple[LandmarkRecord, ...]:
        """The record of each landmark's sights so far."""
        return self._state.landmarks.records(self._state.estimator)

    @property
    def landmark_altitude(self) -> LandmarkAltitude | None:
        """Error of the vehicle's altitude by the landmarks; None before one is used."""
        return self._state.landmarks.altitude(self._state.estimator, self._state.reference)

    @property
    def unused_fixes(self) -> Mapping[Reason, int]:
        """Number of fixes of the newest frame that are assigned to no reported track, by reason."""
        return self._state.unused_fixes

    @property
    def next_id(self) -> int:
        """The id of the next new track."""
        return self._state.next_id

    @next_id.setter
    def next_id(self, next_id: int) -> None:
        self._state.next_id = next_id

    @property
    def due_ns(self) -> HostNs | None:
        """Nothing is due between frames."""
        return None

    def catch_up(self, now_ns: HostNs) -> None:
        """Do nothing: nothing is due between frames."""

    def best_targets(self) -> dict[int, SmoothedTarget]:
        """The reported targets of all live tracks, by id."""
        answers = self._answers
        if answers is None:
            return {}
        found = ((track.id, answers.target(track)) for track in self._state.tracks if track.id > 0)
        return {number: target for number, target in found if target is not None}

    def common_errors(self) -> dict[int, CommonErrors]:
        """Errors that the reported targets share with others, by id."""
        live = self._state.estimator.live
        found = ((track.id, common_errors(live, track.id)) for track in self._state.tracks if track.id > 0)
        return {number: shared for number, shared in found if shared is not None}

    def snapshot(self) -> SmoothedState:
        """The present state, for :meth:`restore`."""
        return self._state.copy()

    def restore(self, snapshot: SmoothedState) -> None:
        """Return to an earlier state, ids included: the same frames then give the same tracks again."""
        self._state = snapshot.copy()

    def on_frame(self, view: FrameView) -> tuple[Track, ...]:
        """All tracks after this frame, by id. A track that this frame deleted is included once."""
        state, (added_ns, rebooted) = self._state, self._clock.follow(view.boot_ns, view.host_ns)
        if rebooted:
            self._samples.rewind()
        t = s_from_ns(view.boot_ns + added_ns)
        if view.fixes and view.fixes[0].sighting.relative != state.relative:
            state = self._restart(relative=not state.relative)
        estimator, self._host_ns = state.estimator, view.host_ns
        reference = self._ground()
        self._samples.feed(estimator, reference, view)
        follow_ground(state, reference, self._samples.level_m)
        taken_over = self._take_over(t)
        follow_receiver(state, view, t, STAMP_SIGMA_S)
        if not self._begins(t) or estimator.live is None:
            return ()
        estimator.live.predict(t)
        sights = sightings_of(view.frame, view.fixes, own_poses=self._own_poses, added_ns=added_ns)
        answers = self._answers = FrameAnswers(
            estimator, t, view, self._lever_m, is_mapped=reference.surface is not None
        )
        frame = FrameTracks(
            state, view, answers, self._motions.moves, lambda fix: target_height(fix, self._priors),
            reports_innovations=self.reports_innovations,
        )  # fmt: skip
        before = state.tracks
        after = frame.updated(before, sights)
        tracks, crowd = frame.begun(after, sights), self._crowd_after(view, before, frame)
        if sights is not None:
            teach(state, view, sights, tracks, self._priors, answers.gates)
            teach_displaced(state, sights, frame.displaced, tracks)
        tracks = frame.continued(tracks)
        if taken_over:
            tracks = merged(tracks, estimator)
        state.detector = detector_after(
            state.detector, view.host_ns, before, tracks, refused=frame.refused, id_trust=frame.id_trust, crowd=crowd
        )
        state.unused_fixes = frame.unused(tracks)
        if sights is not None and not estimator.model.consider:
            self._judge_mount(view, sights)
        answers.forget()
        reports = self._reports(tracks, view, answers)
        state.tracks = tuple([track for track in tracks if track.life.state is not TrackState.DROPPED])
        forget_ended(state, tracks)
        if state.pending is None and estimator.is_solve_due(t):
            task = estimator.start_solve(t)
            due_s = t + (SEARCH_TAKE_OVER_S if task.search else TAKE_OVER_S)
            state.pending = PendingSolve(due_s, self._smoother.solver(task))
        return reports

    def _begins(self, t: float) -> bool:
        """Whether the live filter has begun. Where a late frame has earlier ones processed again, those that came too
        early for their telemetry are too early still.
        """
        estimator = self._state.estimator
        if estimator.live is not None:
            return True
        if t < self._begun_s:
            return False
        self._begun_s = t
        return estimator.begin(t)

    def _take_over(self, t: float) -> bool:
        """Take over a solve that is due; whether one was. A late one is counted, and taken over when it is ready."""
        state, pending = self._state, self._state.pending
        if pending is None or t < pending.due_s:
            return False
        try:
            estimate = pending.job.estimate()
        except np.linalg.LinAlgError:  # what no solve can be made of leaves the former estimate
            estimate = NO_ESTIMATE
        if estimate is None:
            self._solves.miss(pending)
            return False
        state.pending = None
        if not estimate.is_finite:
            self._solves.failed += 1
            return False
        state.estimator.adopt(estimate)
        state.stored = state.stored.judged(state.estimator)
        self._solves.taken += 1
        return True

    def _reports(self, tracks: Sequence[SmoothedTrack], view: FrameView, answers: FrameAnswers) -> tuple[Track, ...]:
        misplaced_m = self._state.turns.misplaced_m
        targets = ((track, answers.target(track)) for track in tracks if track.id > 0)
        return tuple([track.report(target, view, misplaced_m) for track, target in targets if target is not None])

    def _judge_mount(self, view: FrameView, sights: Sightings) -> None:
        """Keep the sights of labels that do not move, and try one more turn of the mount."""
        labels = [fix.sighting.detection.label for fix in view.fixes]
        static, turns = [i for i, label in enumerate(labels) if not self._motions.moves(label)], self._state.turns
        if static:
            mount = view.fixes[0].sighting.body_from_camera
            turns.add([labels[i] for i in static], sights.select(np.array(static)), mount, view.host_ns)
        turns.judge(self._state.estimator)

    def _crowd_after(self, view: FrameView, before: Sequence[SmoothedTrack], frame: FrameTracks) -> Crowd:
        """The crowd after a frame; unchanged where tracks took nearly all of its fixes."""
        detector, left = self._state.detector, frame.left
        if not detector.crowd.labels and len(left) <= NEW_TARGETS:
            return detector.crowd
        tentative = [view.fixes[frame.taken[t.id].index] for t in before if t.id in frame.taken and not t.confirmed]
        elapsed_s = None if detector.last_ns is None else detector.elapsed_s(view.host_ns)
        return detector.crowd.after_frame([view.fixes[j] for j in left], tentative, elapsed_s)

    def drop_all(self, reason: Reason, view: FrameView) -> tuple[Track, ...]:
        """Delete every track, as of the newest frame; their ids are not used again."""
        state, answers = self._state, self._answers
        dropped = [msgspec.structs.replace(t.deleted(reason), fix=None, innovation=None) for t in state.tracks]
        reported = () if answers is None else self._reports(dropped, view, answers)
        self._restart(relative=state.relative)
        return reported

    def _restart(self, *, relative: bool) -> SmoothedState:
        """Begin again without a track; returns the new state. What is known of the detector stays."""
        before, self._answers = self._state, None
        self._samples.restart(relative=relative)
        state = self._state = self._begun(before.stored, before.next_id, relative=relative)
        state.detector = before.detector
        return state
