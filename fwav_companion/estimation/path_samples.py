"""The smoothed path at any instant, the receiver's accuracy, and the carrier's poses for the measurement."""

from __future__ import annotations

import math
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


CALM_S = 1.0  # span of the displacement that is the calm velocity
POSITION, VELOCITY, CALM = slice(0, 3), slice(3, 6), slice(6, 9)
ANOTHER_ACCURACY = 3.0
"""Ratio of two accuracies that are of different solutions of a receiver: with corrections, without, float."""
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
        return float(self.buffer.times[-1])

    def copy(self, span: Span = ALL) -> PathSamples:
        """A snapshot of a span of time, smoothed by nothing that is later."""
        other = replace(self, buffer=self.buffer.copy(span), breaks=list(self.breaks), accuracies=list(self.accuracies))
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
        """Velocities for derivatives: displacement over a second, and of the rest the share that is motion.

        The derivatives by both delays are the velocity. Its noise has made the path wrong in the same way and so looks
        like a delay (claimed to 24 of 50 ms, wrong by 140 ms).
        """
        t, values = self.buffer.times, self.buffer.values
        n, half = len(t), max(1, round(0.5 * CALM_S / self.step_s))
        if n <= 2 * half:
            return
        index = np.arange(max(0, first - half), n)
        centre = index.clip(half, n - 1 - half)
        displacement = values[POSITION].take(centre + half, 1) - values[POSITION].take(centre - half, 1)
        slow = displacement / (t[centre + half] - t[centre - half])
        values[CALM, index[0] :] = slow + self.motion_share * (values[VELOCITY, index[0] :] - slow)

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

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Position by Hermite's cubic, velocity and calm velocity by straight lines; each (3, N) at instants (N,).

        Beyond the ends the cubic goes on for one gap between samples at most. It does not bridge a step of the report.
        One sample alone goes on by its velocity.
        """
        times, values = self.buffer.times, self.buffer.values
        if len(times) == 1:
            velocity = np.repeat(values[3:6], len(t), 1)
            return values[:3] + values[3:6] * (t - times), velocity, velocity
        i = np.minimum(np.maximum(times.searchsorted(t) - 1, 0), len(times) - 2)
        a, b, begin = values.take(i, 1), values.take(i + 1, 1), times.take(i)
        h = times.take(i + 1) - begin
        s = (t - begin) / h
        p0, p1, v0, v1 = _hermite(np.minimum(np.maximum(s, -1.0), 2.0), h)
        velocities = a[3:] + np.minimum(np.maximum(s, 0.0), 1.0) * (b[3:] - a[3:])
        position = p0 * a[:3] + p1 * b[:3] + v0 * a[3:6] + v1 * b[3:6]
        for step in self.breaks:  # the report has not stepped yet: on by the velocity
            between = (t > step.before) & (t < step.after)
            if between.any():
                position[:, between] = (a[:3] + a[3:6] * (t - begin))[:, between]
        return position, velocities[:3], velocities[3:]


def _hermite(s: Array, h: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the two positions and the two velocities at the part s of a gap h."""
    s2 = s * s
    later = s2 * (3.0 - 2.0 * s)
    rest = 1.0 - s
    return 1.0 - later, later, s * rest * rest * h, -s2 * rest * h


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
        self.ranges = RangeReadings()
        self.frames: FrameCache[Poses] = FrameCache()
        self.motions: FrameCache[ReportedMotion] = FrameCache()
        self._motion_shares: dict[bool, Array] = {}  # of the body's rates, of the gimbal's

    def copy(self, span: Span = ALL) -> Carrier:
        """A snapshot of a span of time, as a frame captured at its end has it in time."""
        gimbal = None if self.gimbal is None else self.gimbal.copy(span)
        other = Carrier(self.body.copy(span), self.path.copy(span), gimbal=gimbal)
        other.ranges, other.yaw_from_north = self.ranges.copy(span), self.yaw_from_north
        other._motion_shares = dict(self._motion_shares)
        return other

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
        self.ranges.keep_near(instants, margin_s)

    def rates(self, t: Array, shift: float = 0.0) -> CarrierRates:
        """Rates at many instants (N,): the slow ones, and of the fast ones what is motion."""
        return self._rates(t, shift, adapt=True)

    def live_rates(self, t: Array, shift: float = 0.0) -> CarrierRates:
        """Rates at a few instants, with the share of motion that was last found."""
        return self._rates(t, shift, adapt=False)

    def _rates(self, t: Array, shift: float, *, adapt: bool) -> CarrierRates:
        if self.gimbal is None:
            return CarrierRates(self._denoised(self.body, t + shift, adapt=adapt))
        own = self._denoised(self.gimbal, t + shift, adapt=adapt)
        if self.yaw_from_north:
            return CarrierRates(own)
        # The heading turns the gimbal about down: its rate from the body's (Euler's kinematic equation).
        _, q, r = self._denoised(self.body, t, adapt=adapt)
        right, down = matrices(self.body.quaternions(t))[2, 1:]
        turn = (right * q + down * r) / np.maximum(right * right + down * down, _LEAST_LEVEL2)
        return CarrierRates(own + matrices(self.gimbal.quaternions(t + shift))[2] * turn, own)

    def _denoised(self, attitudes: Attitudes, t: Array, *, adapt: bool) -> Array:
        fast, slow = attitudes.fast_and_slow_rates(t)
        of_gimbal = attitudes is self.gimbal
        if adapt:
            self._motion_shares[of_gimbal] = attitudes.motion_share(t, fast, slow)
        return np.asarray(slow + self._motion_shares.get(of_gimbal, 0.0) * (fast - slow))

    def poses(self, t: Array, rates: CarrierRates, attitude_shift: float = 0.0) -> Poses:
        """Poses at instants (N,); rates enter derivatives only; a gimbal's attitude is taken `attitude_shift` later."""
        rotation = self._rotation(t, attitude_shift)
        position, velocity, calm = self.path.at(t)
        if self.gimbal is not None:  # its errors are about its own axes, also where it looks straight down
            return Poses(rotation, position, velocity, calm, rates.whole, _RIGHT, rates.own)
        right, down = rotation[2, 2], -rotation[2, 1]
        size = np.sqrt(right * right + down * down)
        level = np.zeros_like(position)
        level[1], level[2] = right / np.maximum(size, 1e-6), down / np.maximum(size, 1e-6)
        if size.min() <= 1e-6:  # vertical: the carrier's own axis
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
