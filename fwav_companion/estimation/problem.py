"""One solve's fixed part: which sighting is of which target, between which knots, in which frame; noise and priors.

Unknowns, in this order: shared (S), targets (3 T: north, east, height above the surface), errors (3 K: north, east, up
of each knot).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import (
    CAMERA_DELAY,
    GIMBAL_DELAY,
    GIMBAL_SHARED,
    READOUT,
    Array,
    Ints,
    SampleNoise,
    SharedPriors,
)
from fwav_companion.estimation.ground import TARGET_SIZE, UNKNOWN_TARGET, GroundSurface, TargetPrior
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Poses, Projection, feet, project, without_path_noise
from fwav_companion.estimation.path_samples import Carrier, CarrierRates
from fwav_companion.estimation.range_readings import UsedReadings
from fwav_companion.estimation.robust_weights import HALF, leave_one_out_distance2, survey_weights
from fwav_companion.estimation.wander import Pieces, Wander, WanderKernel

_CHORD_PARTS = np.array([[0.2], [0.4], [0.6], [0.8]])
BREAK_MARGIN_S = 0.02
_LEAST_SURVEY_WEIGHT = 1e-9
_FOOT_ROUNDS, _SAME_LEVEL_M = 4, 0.1  # rays meet the ground's level at their feet, on a slope after a few rounds
_RATES_HOLD_S = 1e-3  # rates are found again when the delay has moved by this


@dataclass
class State:
    """Values of all unknowns."""

    shared: Array  # (S,)
    targets: Array  # (T, 3)
    errors: Array  # (K, 3)

    def vector(self) -> Array:
        """(n,) in the order of the unknowns."""
        return np.concatenate([self.shared, self.targets.ravel(), self.errors.ravel()])

    def plus(self, step: Array) -> State:
        """The state after a step (n,)."""
        a, b = len(self.shared), len(self.shared) + self.targets.size
        targets = self.targets + step[a:b].reshape(-1, TARGET_SIZE)
        return State(self.shared + step[:a], targets, self.errors + step[b:].reshape(-1, 3))


class ErrorNoise(NamedTuple):
    """Standard deviations of the error about the line between two knots, under one kernel."""

    level: Array  # (N,) m, north and east
    up: Array  # (N,) m
    gap_variance: Array  # (K - 1,) m^2, mean of north plus east over a gap


@dataclass(frozen=True)
class Model:
    """What the configuration fixes for a flight."""

    priors: SharedPriors
    noise: SampleNoise
    ground: GroundSurface
    targets: Mapping[int, TargetPrior]  # of landmarks, pads and roofs; others have `UNKNOWN_TARGET`
    consider: bool = False  # answers hold the shared parameters at their priors

    def target(self, number: int) -> TargetPrior:
        """The prior of a target."""
        return self.targets.get(number, UNKNOWN_TARGET)


class Problem:
    """All kept sightings, ready to be linearised at any state."""

    def __init__(self, model: Model, carrier: Carrier, s: Sightings, knots: Array) -> None:
        self.model, self.carrier, self.s, self.knots = model, carrier, s, knots
        self.ids: Ints = np.unique(s.target)
        self.shared_size = len(model.priors)
        self.errors_at = self.shared_size + TARGET_SIZE * len(self.ids)
        self.size = self.errors_at + 3 * len(knots)
        self.of_target = self.ids.searchsorted(s.target)
        moments, self.of_instant = np.unique(s.t + 1j * s.row, return_inverse=True)  # rows of a frame differ
        self.instants, self.rows = moments.real, moments.imag
        # Rows of a rolling shutter: a frame's detections come in any order of their instants.
        self._in_order = np.array_equal(self.of_instant, np.arange(len(s)))
        self.left = (knots.searchsorted(s.t, side="right") - 1).clip(0, len(knots) - 2)
        self.gaps = np.diff(knots)
        self.part = ((s.t - knots[self.left]) / self.gaps[self.left]).clip(0.0, 1.0)
        self.usable = np.ones(len(s), np.bool_)
        for b in carrier.path.breaks:
            self.usable &= (s.t <= b.before - BREAK_MARGIN_S) | (s.t >= b.after + BREAK_MARGIN_S)
        self.pieces: Pieces | None = None
        if len(carrier.path.accuracies) > 1:
            piece, sigma = carrier.path.accuracy_at(knots)
            best_m = min(each.sigma_m for each in carrier.path.accuracies)
            self.pieces = Pieces(piece, sigma**2 - best_m**2)
        self.readings: UsedReadings | None = None
        if len(carrier.ranges):
            self.readings = carrier.ranges.used(knots, carrier.path.breaks, model.noise.roughness_m)
        priors = [model.target(k) for k in self.ids.tolist()]
        self.target_mean = np.array([p.mean() for p in priors]).reshape(-1, TARGET_SIZE)
        self._target_precision = np.concatenate([p.precision() for p in priors]) if priors else np.zeros(0)
        # (3, N) m, estimated error about the lines between knots, at which the next linearisation is made. A derivative
        # that contains this noise is an error in the variables (Fuller 1987) and raises the camera: by 1 m in a hover
        # at 1 m, claimed to 0.4 m.
        self.bridge = np.zeros((3, len(s)))
        surveyed = [p.surveyed for p in priors]
        self._surveys = np.flatnonzero(np.array(surveyed, np.bool_))
        self.survey_weight = np.ones(len(self._surveys))
        self._rates: tuple[float, CarrierRates] | None = None
        self._noise: dict[WanderKernel, ErrorNoise] = {}
        self._prior: dict[WanderKernel, tuple[Array, float]] = {}

    def wanders(self, kernel: WanderKernel) -> tuple[Wander, Wander]:
        """Processes of the error: north and east, and up."""
        return error_processes(self.model, self.carrier, kernel)

    def error_noise(self, kernel: WanderKernel) -> ErrorNoise:
        """Noise of the sightings that straight lines between knots leave."""
        if kernel not in self._noise:
            level, up = self.wanders(kernel)
            gap = self.gaps[self.left]
            mean = level.bridge(self.gaps + 0 * _CHORD_PARTS, _CHORD_PARTS + 0 * self.gaps).mean(0)
            # The frame's own position error is about the line, too.
            _, own, own_up = (0.0, 0.0, 0.0) if self.s.own_noise is None else self.s.own_noise
            variance = level.bridge(gap, self.part) + own**2
            if self.pieces is not None:
                variance = variance + level.bridge_of_pieces(gap, self.part, self.left, self.pieces)
            level_sigma = np.sqrt(variance)
            up_sigma = np.sqrt(up.bridge(gap, self.part) + own_up**2)
            self._noise[kernel] = ErrorNoise(level_sigma, up_sigma, 2.0 * mean)
        return self._noise[kernel]

    def prior(self, kernel: WanderKernel) -> tuple[Array, float]:
        """Precision (n, n) of all unknowns, and the log determinant of the knots' covariance."""
        if kernel not in self._prior:
            level, up = self.wanders(kernel)
            breaks, o = self.carrier.path.breaks, self.errors_at
            level_precision, level_det = level.precision(self.knots, breaks, self.pieces)
            up_precision, up_det = up.precision(self.knots, breaks)
            p = np.zeros((self.size, self.size))
            p[np.arange(o), np.arange(o)] = np.concatenate([self.model.priors.precision, self._target_precision])
            for axis, precision in enumerate((level_precision, level_precision, up_precision)):
                p[o + axis :: 3, o + axis :: 3] = precision
            self._prior[kernel] = p, 2.0 * level_det + up_det
        return self._prior[kernel]

    def weigh_surveys(self, state: State, covariance: Array) -> bool:
        """Set the robust weights of landmarks' surveys by a fit and its covariance (n, n); False: one has changed much.

        A survey is judged by what all other measurements predict, as sightings are. Of those that count, at most one is
        wrong at a time: a wrong one makes the right ones look wrong, too, and is the farthest of them.
        """
        if not len(self._surveys):
            return True
        off = (state.targets - self.target_mean)[self._surveys, :2].T  # (2, L)
        precision = self._target_precision.reshape(-1, TARGET_SIZE)[self._surveys]
        rows = self.shared_size + TARGET_SIZE * self._surveys[:, None] + np.arange(TARGET_SIZE)  # (L, 3)
        sigma = precision[:, :2].T ** -0.5  # (2, L)
        block = covariance[rows[:, :2, None], rows[:, None, :2]].transpose(1, 2, 0)  # (2, 2, L)
        known = block / (sigma[:, None] * sigma)
        unit = np.zeros_like(known)
        unit[0, 0] = unit[1, 1] = 1.0
        weight = np.maximum(self.survey_weight, _LEAST_SURVEY_WEIGHT)
        distance2 = leave_one_out_distance2(off / sigma, known, unit, weight)
        before, self.survey_weight = self.survey_weight, survey_weights(distance2, self.survey_weight)
        weighted = precision.copy()
        weighted[:, :2] = np.maximum(precision[:, :2] * self.survey_weight[:, None], UNKNOWN_TARGET.precision()[:2])
        for p, _ in self._prior.values():
            p[rows.ravel(), rows.ravel()] = weighted.ravel()
        return float(np.abs(self.survey_weight - before).max()) < HALF

    def surveys(self) -> dict[int, float]:
        """The weight of each survey by its target's number."""
        return dict(zip(self.ids[self._surveys].tolist(), self.survey_weight.tolist(), strict=True))

    def deviation(self, state: State) -> Array:
        """Unknowns (n,) minus their prior means."""
        mean = self.model.priors.mean
        parts = (state.shared - mean, (state.targets - self.target_mean).ravel(), state.errors.ravel())
        return np.concatenate(parts)

    def error_at_sightings(self, errors: Array) -> Array:
        """Error (3, N) on the lines between knots (K, 3)."""
        e = np.ascontiguousarray(errors.T)
        return np.asarray(e.take(self.left, 1) * (1.0 - self.part) + e.take(self.left + 1, 1) * self.part)

    def poses(self, shared: Array) -> Poses:
        """Poses (N) of all sightings' instants."""
        delay, shift = float(shared[CAMERA_DELAY]), attitude_shift(shared)
        instants = self.instants - delay - self.rows * float(shared[READOUT])
        if self._rates is None or abs(self._rates[0] - delay) > _RATES_HOLD_S:
            self._rates = delay, self.carrier.rates(instants, shift)
        poses = self.carrier.poses(instants, self._rates[1], shift)
        if self._in_order:
            return poses
        return poses.take(self.of_instant)

    def linearise(self, state: State, kernel: WanderKernel) -> Projection:
        """All sightings at a state; the kernel says which part of the path is noise."""
        poses = self.poses(state.shared)
        places = state.targets.T  # (3, T)
        ground, slope = self.model.ground.height(places[:2])
        points = np.stack([places[0], places[1], places[2] + ground]).take(self.of_target, 1)
        error = self.error_at_sightings(state.errors) + self.bridge
        found = project(poses, self.s.rays, self.s.tangents, state.shared, points, error, self.s.row)
        # The residual is about the lines: the error about them is noise with a prior mean of zero.
        found.residual[:] += (found.point * self.bridge).sum(1) * found.visible
        without_path_noise(found, self._path_noise(state.shared, poses, kernel), poses.rotation)
        self.slope = slope.take(self.of_target, 1)
        return found

    def _path_noise(self, shared: Array, poses: Poses, kernel: WanderKernel) -> Array:
        """Part (2, N) of the path about the chords between knots that the wander's noise explains."""
        knots = self.knots - shared[CAMERA_DELAY]
        inner = knots[:-1] + self.gaps * _CHORD_PARTS  # (parts, K - 1)
        level = self.carrier.path.at(np.concatenate([knots, inner.ravel()]))[0][:2]
        ends, between = level[:, : len(knots)], level[:, len(knots) :].reshape(2, *inner.shape)
        chords = ends[:, None, :-1] * (1.0 - _CHORD_PARTS) + ends[:, None, 1:] * _CHORD_PARTS
        motion = ((between - chords) ** 2).sum(0).mean(0)  # (K - 1,) m^2
        noise = self.error_noise(kernel).gap_variance
        share = np.where(motion > 2.0 * noise, noise / np.maximum(motion, 1e-12), 1.0)
        left, part = self.left, self.part
        chord = ends.take(left, 1) * (1.0 - part) + ends.take(left + 1, 1) * part
        return np.asarray(share[left] * (poses.position[:2] - self.bridge[:2] - chord))

    def first_targets(self, shared: Array, errors: Array, known: Mapping[int, Array]) -> Array:
        """Targets (T, 3) to start from: known ones, surveys, else the median of the rays' ground points."""
        targets = self.target_mean.copy()
        unknown = []
        for i, k in enumerate(self.ids.tolist()):
            if k in known:
                targets[i] = known[k]
            elif not self.model.target(k).surveyed:
                unknown.append(i)
        if unknown:
            error, poses = self.error_at_sightings(errors), self.poses(shared)
            ground: Array = self.model.ground.height(poses.position[:2, :1])[0]  # below the vehicle
            for _ in range(_FOOT_ROUNDS):
                place, _ = feet(poses, self.s.rays, shared, error, ground)
                for i in unknown:
                    targets[i, :2] = np.median(place[:, self.of_target == i], axis=1)
                before, ground = ground, self.model.ground.height(targets[:, :2].T)[0].take(self.of_target)
                if np.abs(ground - before).max() < _SAME_LEVEL_M:
                    break
        return targets


def attitude_shift(shared: Array) -> float:
    """Seconds by which the carrier's attitude is stored later than its instant: a gimbal's own delay."""
    return float(shared[GIMBAL_DELAY]) if len(shared) == GIMBAL_SHARED else 0.0


def error_processes(model: Model, carrier: Carrier, kernel: WanderKernel) -> tuple[Wander, Wander]:
    """Processes of the position's error under a kernel: north and east by the receiver's best solution, and up."""
    noise, path = model.noise, carrier.path
    left, times = path.noise, noise.wander_times_s
    best_m = min((each.sigma_m for each in path.accuracies), default=noise.position_wander_m)
    level = Wander(best_m, times, kernel, left.level)
    return level, Wander(noise.height_wander_m, times, kernel, left.up)


def in_solution(wanders: tuple[Wander, Wander], carrier: Carrier, t: float) -> tuple[Wander, Wander]:
    """Processes of the error in the receiver's solution at t, by those of its best one."""
    if not carrier.path.accuracies:
        return wanders
    sigma_m = float(carrier.path.accuracy_at(np.array([t]))[1][0])
    return replace(wanders[0], sigma_m=sigma_m), wanders[1]
