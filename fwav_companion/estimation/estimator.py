"""The estimator of one vehicle: telemetry and frames in, answers out; when to solve and when to search."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fwav_companion.estimation.answers import (
    ParameterStatus,
    TargetAnswer,
    camera_tilt,
    parameter_statuses,
)
from fwav_companion.estimation.attitudes import Attitudes
from fwav_companion.estimation.errors import (
    BODY_SHARED,
    CAMERA_DELAY,
    GIMBAL_SHARED,
    HEIGHT,
    Array,
    Bools,
    Ints,
    SampleNoise,
    SharedPriors,
)
from fwav_companion.estimation.final_places import final_places
from fwav_companion.estimation.frame_prediction import FramePrediction
from fwav_companion.estimation.ground import GroundSurface, LevelGround, TargetPrior
from fwav_companion.estimation.initiation import filter_before_solves
from fwav_companion.estimation.kept_sightings import KEPT, Sightings, best_seen, in_order, joined, thinned
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.picture_poses import PictureAttitudes, PicturePath
from fwav_companion.estimation.problem import Model
from fwav_companion.estimation.range_readings import RangeReading
from fwav_companion.estimation.sample_buffer import Span
from fwav_companion.estimation.solve import Estimate, SolveTask
from fwav_companion.estimation.solve_schedule import SolveSchedule
from fwav_companion.estimation.target_answers import target_answers
from fwav_companion.estimation.target_pairs import near_pairs
from fwav_companion.estimation.vehicle_path import VehiclePath
from fwav_companion.estimation.wander import SMOOTH
from fwav_companion.estimation.whole_flight import WholeFlight
from fwav_companion.types.tracks import FinalPlace

_FIRST_FRAMES, _FIRST_SPAN_S = 12, 1.0  # before the first solve, the shorter of the two
REFUSED_WEIGHT = 0.6  # a search after the first ones is due where the solve refuses this much
_RIVAL_COST = 9.0  # of a delay's mode above the best one: three sigmas
_HEIGHT_CHANGE, _LEAST_HEIGHT_M = 0.1, 0.3  # in a descent the picture's scale ages with the height
_SURPRISE = 4.0  # mean squared distance, twice what is expected, that calls for a solve
SOLVED_TARGETS = 24  # columns of a solve are bounded; the best seen are in it
_REPLAYED = 300  # frames between a solve's start and its take-over
_ATTITUDE_MARGIN_S, _PRUNE_S, _PRUNED_AGE_S = 1.0, 30.0, 40.0
NO_TARGETS: Mapping[int, int] = {}


class Estimator:
    """One vehicle and one camera."""

    def __init__(
        self, priors: SharedPriors, noise: SampleNoise, *, ground: GroundSurface | None = None,
        targets: Mapping[int, TargetPrior] | None = None, consider: bool = False, kept: int = KEPT,
        whole_flight: WholeFlight | None = None, pictures: bool = False,
    ) -> None:  # fmt: skip
        """targets: priors of landmarks, pads and roofs by number; consider: no self-calibration.

        whole_flight: keeps sightings for `final_places`. pictures: each has its own pose.
        """
        self.targets = dict(targets or {})
        self.model = Model(priors, noise, ground or LevelGround(), self.targets, consider)
        self._path = PicturePath() if pictures else VehiclePath(noise.position_m, noise.height_m)
        body = (PictureAttitudes if pictures else Attitudes)(noise.attitude_rad, noise.attitude_stamp_delay_s)
        gimbal = Attitudes(noise.attitude_rad, 0.0) if len(priors) == GIMBAL_SHARED else None
        self.carrier = Carrier(body, self._path.samples, gimbal=gimbal)
        self._budget, self._whole_flight = kept, whole_flight
        self.kept: Sightings | None = None
        self._new: list[Sightings] = []
        self._replayed: deque[Sightings] = deque(maxlen=_REPLAYED)
        self.estimate = Estimate(-np.inf, priors.mean, {}, np.zeros(0), np.zeros((0, 3)), SMOOTH)
        self.live: LiveFilter | None = None
        self.solves = 0
        self._dropped: set[int] = set()
        self._solved: set[int] = set()  # numbers of all targets in any solve, also in one under way
        self._schedule, self._next_prune = SolveSchedule(), -np.inf
        self._has_new_target = False
        self._solved_height_m = 0.0
        self._answers: tuple[LiveFilter, int, float, dict[int, TargetAnswer]] | None = None

    def add_attitude(self, t: float, quaternion: Sequence[float] | Array) -> bool:
        """Add the body's attitude (4,), ned_from_body, as stamped; False for a sample that is left out."""
        return self.carrier.body.append(t, quaternion)

    def add_gimbal_attitude(self, t: float, quaternion: Sequence[float] | Array) -> bool:
        """Add the attitude (4,) of the gimbal that carries the camera; False for a sample that is left out.

        Its yaw counts from the vehicle's heading, or from north where `carrier.yaw_from_north` says so.
        """
        return self.carrier.gimbal is not None and self.carrier.gimbal.append(t, quaternion)

    def add_range(self, reading: RangeReading, foot: tuple[float, float]) -> bool:
        """Add a rangefinder's reading with the beam's foot, m north and east; False: left out."""
        return self.carrier.ranges.append(reading, foot)

    def add_position(self, t: float, position: Array, velocity: Array, *, reset: bool = False) -> bool:
        """Add north, east, height (m) and their rates; reset: the report begins a new piece. False: left out."""
        return self._path.append(t, position, velocity, reset=reset)

    def begin(self, t: float) -> bool:
        """Begin the live filter by the priors, where there is none yet; False while poses are not known."""
        if self.live is None and self.carrier.ready:
            self.live = filter_before_solves(self.model, self.carrier, t)
        return self.live is not None

    def predict(
        self, s: Sightings, targets: Ints, alike: Bools, beside: Mapping[int, int] = NO_TARGETS
    ) -> FramePrediction | None:
        """A frame's detections against these targets; None where no pair is possible.

        alike: (D, T) pairs that may be one thing by their labels. beside: further targets that go with some of these.
        """
        live = self.live
        if live is None or not len(s) or not self.carrier.ready:
            return None
        live.predict(float(s.t[0]))
        held = np.array([k in live for k in targets.tolist()], np.bool_)
        detection, target = near_pairs(live, s, targets[held], alike[:, held])
        if not len(detection):
            return None
        further = [i for i, k in enumerate(target.tolist()) if k in beside and beside[k] in live]
        if further:
            target = np.concatenate([target, [beside[k] for k in target[further].tolist()]])
            detection = np.concatenate([detection, detection[further]])
        return live.predict_pairs(s, detection, target)

    def update(self, s: Sightings) -> None:
        """Take a frame whose detections have targets; -1: none."""
        seen = np.flatnonzero(s.target >= 0)
        if len(seen):
            self.update_pairs(s, seen, s.target[seen], np.ones(len(seen), np.bool_))

    def update_pairs(self, s: Sightings, detection: Ints, targets: Ints, teaches: Bools) -> None:
        """Take pairs (M,) of a frame's detections and targets.

        teaches: (M,) which of them solves use. New targets may be clutter, and moving ones do not teach.
        """
        if teaches.any():
            taught = s.select(detection[teaches]).with_targets(targets[teaches])
            self.record(taught)
            self._replayed.append(taught)
        if self.live is not None and self.carrier.ready:
            self.live.update(s, detection, targets)

    def record(self, s: Sightings) -> None:
        """Take sightings that the live filter has had already for the next solve."""
        s = s.select(s.t >= self.carrier.rates_from)
        if not len(s):
            return
        self._new.append(s)
        self._has_new_target |= not self._solved.issuperset(s.target.tolist())
        if self._whole_flight is not None:
            self._whole_flight.add(s)

    def refuse(self, s: Sightings) -> None:
        """Take sightings beyond the gates of their likeliest targets: the live filter does not use them, solves may.

        An error beyond its prior displaces sightings by more than the gate; without them no solve would find it.
        """
        self.record(s)
        if self.live is not None:
            self.live.refused += len(s)

    def copy(self) -> Estimator:
        """A snapshot of all but the telemetry, which frames do not change: a late frame returns to it."""
        other = copy.copy(self)
        other._new, other._replayed = list(self._new), self._replayed.copy()
        other.live = None if self.live is None else self.live.copy()
        other._whole_flight = None if self._whole_flight is None else self._whole_flight.copy()
        other._solved, other._dropped = set(self._solved), set(self._dropped)
        other._schedule = copy.copy(self._schedule)
        return other

    def rename(self, old: int, new: int) -> None:
        """Count the sightings of a target as those of another: they were found to be one."""
        if self.kept is not None:
            self.kept = self.kept.with_targets(np.where(self.kept.target == old, new, self.kept.target))
        self._new = [s.with_targets(np.where(s.target == old, new, s.target)) for s in self._new]
        if self._whole_flight is not None:
            self._whole_flight.rename(old, new)
        if self.live is not None and new in self.live:
            self.live.forget(old)
        elif self.live is not None:
            self.live.rename(old, new)

    def forget(self, target: int) -> None:
        """Leave a target's sightings out of all later solves."""
        if self.kept is not None:
            self.kept = self.kept.select(self.kept.target != target)
        self._new = [left for s in self._new if len(left := s.select(s.target != target))]
        if self._whole_flight is not None:
            self._whole_flight.forget(target)
        self.drop(target)

    def drop(self, target: int) -> None:
        """Predict and answer for a target no more; what it taught stays."""
        self._dropped.add(target)
        if self.live is not None:
            self.live.forget(target)

    # Solves.

    def is_solve_due(self, now: float) -> bool:
        """Whether to solve: on a schedule; early where frames contradict, a target is new or the height has changed."""
        if not self._new or not self.carrier.shows_motion(now):
            return False
        if not self.solves:  # the first search needs sightings enough to tell delays apart
            span = abs(float(self._new[-1].t[-1] - self._new[0].t[0]))
            return len(self._new) >= _FIRST_FRAMES or span >= _FIRST_SPAN_S
        if self._schedule.is_due(now) or not self._schedule.may_be_early(now):
            return self._schedule.is_due(now)
        live = self.live
        if live is None or self._has_new_target:
            return True
        change = abs(self._height(live, now) - self._solved_height_m)
        if change > _HEIGHT_CHANGE * max(self._solved_height_m, _LEAST_HEIGHT_M):
            return True
        seen = live.used + live.refused
        surprised = live.surprise > _SURPRISE * max(live.used, 1)
        return seen > 10 and (surprised or live.refused > 0.5 * seen)

    def start_solve(self, now: float) -> SolveTask:
        """A snapshot for a solve at the instant `now`; adopt its estimate later."""
        s = joined([*([self.kept] if self.kept is not None else []), *self._new])
        self._new = []
        self.kept = s = thinned(in_order(s), now, self._budget)
        self._path.settle()
        self._prune(now, s)
        wanders = self.model.noise.position_wander_m > 0 and not self.model.consider
        parts = self._schedule.start(
            now, first=self.estimate.delay_sigma_s is None, wanders=wanders, is_doubtful=self._is_doubtful
        )
        self._has_new_target = False
        self._solved.update(np.unique(s.target).tolist())
        self._replayed.clear()
        model = replace(self.model, targets=dict(self.targets))  # later landmarks are not this solve's
        solved = best_seen(s, SOLVED_TARGETS)
        return SolveTask(now, model, self.carrier.copy(Span(now)), solved, self.estimate, *parts)

    def _is_doubtful(self) -> bool:
        """Whether the last solve refuses many sightings, contradicts the configuration, or has a rival."""
        contradicts = any(s.status == "contradicts" for s in self.self_calibration())
        return self.estimate.weight < REFUSED_WEIGHT or contradicts or len(self.rival_delays()) > 1

    def rival_delays(self) -> list[float]:
        """Errors of the camera's delay between which the last search does not decide, likeliest first, s."""
        return [float(m.shared[CAMERA_DELAY]) for m in self.estimate.modes if m.cost < _RIVAL_COST]

    def adopt(self, estimate: Estimate) -> None:
        """Take over a solve's estimate and replay the frames since its start."""
        self.estimate = estimate
        self.solves += 1
        if estimate.wanders is None:
            return
        before = self.live
        self.live = LiveFilter(
            self.model, self.carrier, estimate.wanders, estimate.t, estimate.mean, estimate.covariance, estimate.ids
        )
        if self._replayed:
            self.live.replay(self._replayed)
        if before is not None:
            self.live.predict(before.t)
            self.live.take_over(before, self._dropped)
        self._dropped.intersection_update(self.live.at)
        self._solved_height_m = self._height(self.live, estimate.t)

    def solve(self, now: float) -> None:
        """Solve in line and adopt at once."""
        self.adopt(self.start_solve(now).run())

    def final_places(self) -> dict[int, FinalPlace]:
        """Static targets by a solve over the sightings of the whole flight; none before the first solve."""
        path = self.carrier.path
        if not self.solves or self._whole_flight is None:
            return {}
        since = max(float(path.buffer.times[0]), self.carrier.oldest) + _ATTITUDE_MARGIN_S
        s = self._whole_flight.sightings(since)
        if s is None:
            return {}
        self._path.settle()
        model, now = replace(self.model, targets=dict(self.targets)), max(float(s.t[-1]), self.estimate.t)
        return final_places(SolveTask(now, model, self.carrier.copy(), s, self.estimate, False, False))

    def _height(self, live: LiveFilter, now: float) -> float:
        """Camera above the ground below it, m, as far as known."""
        up = float(self.estimate.errors[-1, 2]) if len(self.estimate.errors) else 0.0
        position = live.poses.motion(now).position
        ground, _ = self.model.ground.height(position[:2, None])
        return float(position[2] - ground[0]) - float(self.estimate.shared[HEIGHT]) - up

    def _prune(self, now: float, s: Sightings) -> None:
        """Delete attitudes that no kept sighting needs: memory does not grow with the flight."""
        if now < self._next_prune:
            return
        self._next_prune = now + _PRUNE_S
        recent = np.arange(now - _PRUNED_AGE_S, now + 2 * _ATTITUDE_MARGIN_S, _ATTITUDE_MARGIN_S)
        used = [] if self._whole_flight is None else [self._whole_flight.times()]
        self.carrier.keep_near(np.sort(np.concatenate([s.t, recent, *used])), _ATTITUDE_MARGIN_S)

    def answer(self, target: int, t: float) -> TargetAnswer | None:
        """A target at the instant t; None where the live filter does not hold it."""
        live = self.live
        if live is None:
            return None
        answers = self._answers
        if answers is None or answers[:3] != (live, live.version, t):
            answers = self._answers = live, live.version, t, target_answers(live, t)
        return answers[3].get(target)

    def self_calibration(self) -> tuple[ParameterStatus, ...]:
        """Status of every shared parameter, by the live posterior."""
        priors, (mean, covariance) = self.model.priors, self._posterior()
        size, consider = len(priors), self.model.consider
        return parameter_statuses(priors, mean[:size], np.sqrt(covariance.diagonal()[:size]), consider=consider)

    def camera_tilt(self) -> tuple[ParameterStatus, ParameterStatus]:
        """Rotation about the carrier's x and y axes by which the camera is wrong in all: mount and attitude together.

        A constant tilt of the attitude turns the camera as the mount does. Only another bank or heading parts the two;
        their sum is what places targets.
        """
        return camera_tilt(self.model.priors, *self._posterior())

    def stored(self) -> tuple[Array, Array]:
        """Means and sigmas (12,) for the next flight's priors, NaN before the first solve."""
        if not self.solves:
            return np.full(BODY_SHARED, np.nan), np.full(BODY_SHARED, np.nan)
        mean, covariance = self._posterior()
        return mean[:BODY_SHARED].copy(), np.sqrt(covariance.diagonal()[:BODY_SHARED])

    def _posterior(self) -> tuple[Array, Array]:
        """Mean and covariance of the shared parameters, first of all unknowns; the priors' before the first solve."""
        if self.live is None or not self.solves:
            return self.model.priors.mean, np.diag(self.model.priors.sigma**2)
        return self.live.mean, self.live.covariance
