"""The smoothed path at any instant, the receiver's accuracy, and the carrier's poses for the measurement."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.array_rotations import matrices
from fwav_companion.estimation.attitudes import Attitudes
from fwav_companion.estimation.errors import Array, Ints
from fwav_companion.estimation.frame_cache import FrameCache, ReportedMotion
from fwav_companion.estimation.measurement import Poses
from fwav_companion.estimation.path_axis import VELOCITY_NOISE, PathAxis
from fwav_companion.estimation.range_readings import RangeReadings
from fwav_companion.estimation.sample_buffer import ALL, SampleBuffer, Span


class PathBreak(NamedTuple):
    """The reported position stepped between two samples: a new origin, a reset of the autopilot's filter."""

    before: float  # s
    after: float  # s
    step_m: float
    jump: tuple[float, float] | None = None  # m, north and east, beyond the velocity; None after a gap without samples


class Accuracy(NamedTuple):
    """The receiver's own accuracy from an instant on."""

    t: float  # s
    sigma_m: float  # north and east


class PathNoise(NamedTuple):
    """Standard deviation and correlation time of the smoothed path's own error."""

    level: tuple[float, float]  # m, s
    up: tuple[float, float]  # m, s


class Settling(NamedTuple):
    """Variances of the path's filters at one of their first samples, beyond those of a long path."""

    t: float  # s
    level: float  # m^2
    up: float  # m^2

    def at(self) -> float:
        """Its instant, s."""
        return self.t


class PathPoints(NamedTuple):
    """The path at N instants."""

    position: Array  # (3, N) m north, east, height
    velocity: Array  # (3, N) m/s
    calm: Array  # (3, N) m/s, without its noise, for derivatives

    def first(self) -> PathPoints:
        """At the first instant alone."""
        return PathPoints(self.position[:, :1], self.velocity[:, :1], self.calm[:, :1])


CALM_S = 1.25  # half of the span of a fit to the velocities: a turn of 0.7 rad/s is less than 1 % off at its middle
POSITION, VELOCITY, CALM = slice(0, 3), slice(3, 6), slice(6, 9)
_LEAST_FITTED = 2  # samples on each side, where they are slow
_UNEVEN = 1.2  # of the fit's span: samples do not come evenly
_FIT_RIDGE = np.diag([0.0, 1e-6, 1e-6])  # one or two samples alone: a constant, a line
ANOTHER_ACCURACY = 3.0
"""Ratio of two accuracies that are of different solutions of a receiver: with corrections, without, float."""
UNMEASURED_M_S2 = 3.0  # one sigma of an acceleration: a small vehicle that banks at 17 degrees
_LATE_S = 0.15  # a frame whose telemetry is further ahead is late, or is processed again
_RECENT_S = 3.0  # of the telemetry that places a frame: rates and delays reach back for less
_SMOOTHED_AGAIN = 120  # samples of a snapshot: twelve seconds at 10 Hz, some time constants
_LEAST_SOLVED = 3  # positions: more than these
_LEAST_ACCURACY_M, _MOST_ACCURACIES = 1e-3, 8


@dataclass
class PathSamples:
    """Smoothed north, east, height; velocities; calm velocities: nine rows, one column a sample."""

    buffer: SampleBuffer
    breaks: list[PathBreak]
    noise: PathNoise
    accuracies: list[Accuracy] = field(default_factory=list)  # in order of time; empty: as configured
    axes: Sequence[PathAxis] = ()  # the filters of north, east and height behind the smoothed ones
    settling: list[Settling] = field(default_factory=list)  # in order of time, of the present piece
    step_s: float = 0.1  # between two samples
    motion_share: Array = field(default_factory=lambda: np.zeros((3, 1)))  # of the velocities about the calm ones

    @property
    def ready(self) -> bool:
        """Whether an instant is known: from the first sample on, by its velocity."""
        return len(self.buffer) > 0

    def shows_motion(self, until: float) -> bool:
        """Whether a snapshot up to `until`, s, has samples enough for a solve."""
        return self.buffer.count_until(until) > _LEAST_SOLVED

    @property
    def newest(self) -> float:
        """Time of the newest sample, s."""
        return self.buffer.newest

    def copy(self, span: Span = ALL) -> PathSamples:
        """A snapshot of a span of time, smoothed by nothing that is later."""
        other = replace(self, buffer=self.buffer.copy(span), breaks=list(self.breaks), accuracies=list(self.accuracies))
        other.settling = list(self.settling)
        later = len(self.buffer) - self.buffer.count_until(span.until)
        if later and len(other.buffer):
            other.smooth(min(len(other.buffer), _SMOOTHED_AGAIN), later)
        return other

    def smooth(self, count: int, later: int = 0) -> None:
        """Smooth the newest samples by the filters, which have seen a number of samples beyond them."""
        n = len(self.buffer)
        for row, axis in enumerate(self.axes):
            smoothed = axis.smoothed(count, later)
            self.buffer.values[row, n - len(smoothed) :] = smoothed
        if self.heights_lead and n > 2:
            self.climb_by_heights(n - count)
        self._calm(n - count)

    @property
    def heights_lead(self) -> bool:
        """Whether climb rates are those of the heights, which contradict the reported ones."""
        axis = self.axes[2]
        return axis.process_noise > VELOCITY_NOISE or not axis.driven

    def climb_by_heights(self, first: int) -> None:
        """Climb rates from a sample on by central differences of the smoothed heights."""
        first = max(0, first - 2)
        t, values = self.buffer.times[first:], self.buffer.values[:, first:]
        if len(t) > 2:
            inner = 1 if first else 0  # the first one of a later part has a difference to one side alone
            values[5, inner:] = np.gradient(values[2], t)[inner:]

    def _calm(self, first: int) -> None:
        """Velocities for derivatives: a fit over two seconds, and of the rest the share that is motion.

        The derivatives by both delays are the velocity. Its noise has made the path wrong in the same way and so looks
        like a delay (claimed to 24 of 50 ms, wrong by 140 ms). The displacement of the path has more of that noise than
        a fit to the velocities: 0.09 of 2 m/s against 0.03 at 3 Hz, 0.05 against 0.02 at 10 Hz.
        """
        values, reach = self.buffer.values, fitted_samples(self.step_s)
        start = max(0, first - reach)
        slow = fitted_velocities(self.buffer.times, values[VELOCITY], start, self.step_s)
        values[CALM, start:] = slow + self.motion_share * (values[VELOCITY, start:] - slow)

    def unsettled(self, t: float) -> tuple[float, float]:
        """Variances (m^2) of north and east, and of up, by which the path is worse at t than a long one.

        The first sample has its whole noise, and each one more moves the path by what it improves it.
        """
        i = bisect_right(self.settling, t, key=Settling.at) - 1
        return (self.settling[i].level, self.settling[i].up) if i >= 0 else (0.0, 0.0)

    def add_accuracy(self, t: float, sigma_m: float) -> None:
        """Take the receiver's accuracy: a small change widens what has been claimed, a large one begins a new piece."""
        pieces = self.accuracies
        if not pieces:
            pieces.append(Accuracy(t, sigma_m))
            return
        last, ratio = pieces[-1], (sigma_m + _LEAST_ACCURACY_M) / (pieces[-1].sigma_m + _LEAST_ACCURACY_M)
        if max(ratio, 1.0 / ratio) < ANOTHER_ACCURACY:
            pieces[-1] = Accuracy(last.t, max(last.sigma_m, sigma_m))
            return
        if t <= last.t:  # a late frame
            return
        pieces.append(Accuracy(t, sigma_m))
        if len(pieces) > _MOST_ACCURACIES:  # the two oldest count as one, at the worse of both
            first, second = pieces[:2]
            pieces[:2] = [Accuracy(first.t, max(first.sigma_m, second.sigma_m))]

    def accuracy_at(self, t: Array) -> tuple[Ints, Array]:
        """Number of the piece (N,), and its sigma (N,) m, at instants (N,)."""
        piece = np.array([each.t for each in self.accuracies[1:]]).searchsorted(t, side="right")
        return piece, np.array([each.sigma_m for each in self.accuracies])[piece]

    def unmeasured_m(self, t: Array) -> Array:
        """One sigma (N,) m of north and east at instants (N,) for which the samples are late: the vehicle turns."""
        late_s = np.maximum(t - self.newest - self.step_s, 0.0)
        return np.asarray(0.5 * UNMEASURED_M_S2 * late_s * late_s)

    def at(self, t: Array) -> PathPoints:
        """Position by Hermite's cubic, velocity and calm velocity by straight lines; each (3, N) at instants (N,).

        Beyond the ends the position goes on by the velocity there, north and east for one gap with its acceleration: a
        turn goes on, a wing's heave does not, which a cubic carries on by twice its size. It does not bridge a step of
        the report. One sample alone goes on by its velocity.
        """
        times, values = self.buffer.times, self.buffer.values
        if len(times) == 1:
            velocity = np.repeat(values[3:6], len(t), 1)
            return PathPoints(values[:3] + values[3:6] * (t - times), velocity, velocity)
        i = np.minimum(np.maximum(times.searchsorted(t) - 1, 0), len(times) - 2)
        a, begin = values.take(i, 1), times.take(i)
        change = values.take(i + 1, 1) - a  # (9, N)
        h = times.take(i + 1) - begin
        s = np.minimum(np.maximum((t - begin) / h, 0.0), 1.0)
        later, v0, v1 = _hermite(s, h)
        velocities = a[3:] + s * change[3:]
        beyond = t - begin - s * h
        turn = np.minimum(np.maximum(beyond, -h), h)
        position = a[:3] + later * change[:3] + (v0 + v1) * a[3:6] + v1 * change[3:6] + beyond * velocities[:3]
        position[:2] += turn * (beyond - 0.5 * turn) / h * change[3:5]
        for step in self.breaks:  # the report has not stepped yet: on by the velocity
            between = (t > step.before) & (t < step.after)
            if between.any():
                position[:, between] = (a[:3] + a[3:6] * (t - begin))[:, between]
        return PathPoints(position, velocities[:3], velocities[3:])


def fitted_samples(step_s: float) -> int:
    """Samples on each side of a fitted velocity."""
    return max(_LEAST_FITTED, round(CALM_S / step_s))


def fitted_velocities(t: Array, velocity: Array, first: int, step_s: float) -> Array:
    """Parabolas through the velocities (3, n) at times (n,) s about each sample from `first` on: (3, n - first).

    Least squares over `CALM_S` on each side, less at an end (Savitzky & Golay 1964); step_s: between two samples.
    """
    half = fitted_samples(step_s)
    centre = np.arange(first, len(t))
    index = centre[:, None] + np.arange(-half, half + 1)  # (m, 2 half + 1)
    inside = (index >= 0) & (index < len(t))
    index = index.clip(0, len(t) - 1)
    x = (t[index] - t[centre, None]) / CALM_S
    used = inside & (np.abs(x) < max(1.0, half * step_s / CALM_S) * _UNEVEN)  # none beyond a gap
    basis = np.stack([used * 1.0, used * x, used * x * x], -1)  # (m, 2 half + 1, 3)
    normal = basis.swapaxes(1, 2) @ basis + _FIT_RIDGE  # (m, 3, 3)
    weights = np.linalg.solve(normal, basis.swapaxes(1, 2))[:, 0]  # (m, 2 half + 1), of the value at the centre
    return np.asarray((velocity[:, index] * weights).sum(-1))


def _hermite(s: Array, h: Array) -> tuple[Array, Array, Array]:
    """Weights of the later position, the earlier one having the rest, and of both velocities at part s of gap h."""
    s2, scaled = s * s, (1.0 - s) * h
    return s2 * (3.0 - 2.0 * s), (s - s2) * scaled, -s2 * scaled


class CarrierRates(NamedTuple):
    """Angular rates in carrier axes, rad/s, without their noise: for derivatives."""

    whole: Array  # (3, N) by camera time
    own: Array | None = None  # (3, N) of a gimbal against the zero of its yaw; None: the same


class Carrier:
    """Poses of the camera's carrier, the body or a gimbal, by its reported attitudes and positions."""

    def __init__(self, attitudes: Attitudes, path: PathSamples, *, gimbal: Attitudes | None = None) -> None:
        """gimbal: where one carries the camera, its attitudes about the vehicle's heading."""
        self.path, self.body, self.gimbal = path, attitudes, gimbal
        self.attitudes = attitudes if gimbal is None else gimbal
        self.yaw_from_north = False  # the gimbal's attitudes: about north instead
        self.ranges, self.sizes = RangeReadings(), RangeReadings(of_targets=True)
        self.frames: FrameCache[Poses] = FrameCache()
        self.motions: FrameCache[ReportedMotion] = FrameCache()
        self._motion_shares: dict[bool, Array] = {}  # of the body's rates, of the gimbal's

    def copy(self, span: Span = ALL) -> Carrier:
        """A snapshot of a span of time, as a frame captured at its end has it in time."""
        gimbal = None if self.gimbal is None else self.gimbal.copy(span)
        other = Carrier(self.body.copy(span), self.path.copy(span), gimbal=gimbal)
        other.ranges, other.sizes = self.ranges.copy(span), self.sizes.copy(span)
        other.yaw_from_north = self.yaw_from_north
        other._motion_shares = dict(self._motion_shares)
        return other

    @property
    def height_readings(self) -> tuple[RangeReadings, RangeReadings]:
        """Readings of the height by a rangefinder, and by the sizes of tags."""
        return self.ranges, self.sizes

    @property
    def ready(self) -> bool:
        """Whether poses can be interpolated."""
        return self.path.ready and self.body.ready and self.attitudes.ready

    def as_in_time(self, stamp: float) -> Carrier:
        """The carrier as a frame of this stamp, s, has it in time: without what came since then, if it comes late."""
        if self.newest - stamp < _LATE_S:
            return self
        known = self.copy(Span(stamp, stamp - _RECENT_S))
        return known if known.ready else self

    def shows_motion(self, until: float = math.inf) -> bool:
        """Whether a snapshot up to `until`, s, has samples enough for a solve."""
        streams = (self.path, self.body, self.attitudes)
        return all(stream.shows_motion(until) for stream in streams)

    @property
    def newest(self) -> float:
        """Instant up to which all streams have samples, s."""
        return min(self.path.newest, self.body.newest, self.attitudes.newest)

    @property
    def oldest(self) -> float:
        """Instant from which the attitudes have samples, s."""
        return max(self.body.oldest, self.attitudes.oldest)

    @property
    def rates_from(self) -> float:
        """Instant from which rates are known, s: a solve takes no earlier sighting, whose delay it could not judge."""
        return max(self.body.rates_from, self.attitudes.rates_from)

    def keep_near(self, instants: Array, margin_s: float) -> None:
        """Delete attitudes and readings further than the margin from all instants (n,), ascending."""
        self.body.keep_near(instants, margin_s)
        if self.gimbal is not None:
            self.gimbal.keep_near(instants, margin_s)
        for source in self.height_readings:
            source.keep_near(instants, margin_s)

    def rates(self, t: Array, shift: float = 0.0, unseen_rad: float = 0.0) -> CarrierRates:
        """Rates at many instants (N,): the slow ones, and of the fast ones what is motion.

        unseen_rad: one sigma of the motion that the attitudes' interpolation misses.
        """
        return self._rates(t, shift, unseen_rad)

    def live_poses(self, t: Array, shift: float = 0.0, path: PathPoints | None = None) -> Poses:
        """Poses at a few instants (N,), rates with the share of motion that was last found; path: `path.at(t)`."""
        path = self.path.at(t) if path is None else path
        if self.gimbal is not None:
            return self._posed(self._rotation(t, shift), path, self._rates(t, shift))
        q, fast, slow = self.body.attitudes_and_rates(t + shift)
        return self._posed(matrices(q), path, CarrierRates(self._mixed(fast, slow)))

    def _rates(self, t: Array, shift: float, unseen_rad: float | None = None) -> CarrierRates:
        if self.gimbal is None:
            return CarrierRates(self._denoised(self.body, t + shift, unseen_rad))
        own = self._denoised(self.gimbal, t + shift, unseen_rad)
        if self.yaw_from_north:
            return CarrierRates(own)
        # The heading turns the gimbal about down: its rate from the body's (Euler's kinematic equation).
        _, q, r = self._denoised(self.body, t, unseen_rad)
        right, down = matrices(self.body.quaternions(t))[2, 1:]
        turn = (right * q + down * r) / np.maximum(right * right + down * down, _LEAST_LEVEL2)
        return CarrierRates(own + matrices(self.gimbal.quaternions(t + shift))[2] * turn, own)

    def _denoised(self, attitudes: Attitudes, t: Array, unseen_rad: float | None) -> Array:
        fast, slow = attitudes.fast_and_slow_rates(t)
        of_gimbal = attitudes is self.gimbal
        if unseen_rad is not None:
            self._motion_shares[of_gimbal] = attitudes.motion_share(t, fast, slow, unseen_rad)
        return self._mixed(fast, slow, of_gimbal=of_gimbal)

    def _mixed(self, fast: Array, slow: Array, *, of_gimbal: bool = False) -> Array:
        return np.asarray(slow + self._motion_shares.get(of_gimbal, 0.0) * (fast - slow))

    def poses(self, t: Array, rates: CarrierRates, attitude_shift: float = 0.0) -> Poses:
        """Poses at instants (N,); rates enter derivatives only; a gimbal's attitude is taken `attitude_shift` later."""
        return self._posed(self._rotation(t, attitude_shift), self.path.at(t), rates)

    def _posed(self, rotation: Array, path: PathPoints, rates: CarrierRates) -> Poses:
        """Poses by rotations (3, 3, N) ned_from_carrier and places."""
        position, velocity, calm = path
        if self.gimbal is not None:  # its errors are about its own axes, also where it looks straight down
            return Poses(rotation, position, velocity, calm, rates.whole, _RIGHT, rates.own)
        right, down = rotation[2, 2], -rotation[2, 1]
        size = np.sqrt(right * right + down * down)
        level = np.zeros(position.shape)
        level[1:] = np.array([right, down]) / np.maximum(size, 1e-6)
        if min(size.tolist()) <= 1e-6:  # vertical: the carrier's own axis
            level[:, size <= 1e-6] = _RIGHT
        return Poses(rotation, position, velocity, calm, rates.whole, level)

    def _rotation(self, t: Array, shift: float) -> Array:
        """ned_from_carrier (3, 3, N)."""
        if self.gimbal is None:
            return matrices(self.body.quaternions(t + shift))
        own = matrices(self.gimbal.quaternions(t + shift))
        if self.yaw_from_north:
            return own
        forward = matrices(self.body.quaternions(t))[:2, 0]  # (2, N) the nose
        cos, sin = forward / np.maximum(np.hypot(*forward), 1e-6)
        return np.stack([cos * own[0] - sin * own[1], sin * own[0] + cos * own[1], own[2]])


_LEAST_LEVEL2 = 0.01  # squared cosine of the pitch: nose up within 6 degrees there is no heading
_RIGHT = np.array([[0.0], [1.0], [0.0]])


def chord(before: list[float], after: list[float], dt: float) -> tuple[float, float, float]:
    """Displacement (m) between two velocities (m/s): along an arc the chord is shorter than their mean says."""
    cross, dot = before[0] * after[1] - before[1] * after[0], before[0] * after[0] + before[1] * after[1]
    half = min(0.5 * abs(math.atan2(cross, dot)), 1.4)
    # Mean of two velocities of a circle is its speed times cos(half); the chord is speed times sin(half) / half.
    factor = math.tan(half) / half if half > 1e-3 else 1.0
    n, e, u = (0.5 * (a + b) * dt for a, b in zip(before, after, strict=True))
    return n * factor, e * factor, u
