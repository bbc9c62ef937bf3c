"""Reported attitudes at any instant, and their rates with the share of them that is noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fwav_companion.estimation.array_rotations import body_rates
from fwav_companion.estimation.errors import Array, Ints
from fwav_companion.estimation.sample_buffer import ALL, SampleBuffer, Span

WINDOW = 6  # samples of an interpolation: flapping at 5 to 10 Hz is far from linear between two samples of 50 Hz
_FAST_STEP_S = 2e-3  # half of the difference that gives the rate now
_SLOW_STEP_S = 0.15  # half of the difference that gives the slow rate
_MARGIN_S = 0.01
_EDGE = 2  # samples at an end where an interpolation is one-sided
_RATES_SPAN_S = 4 * _SLOW_STEP_S + 2 * _MARGIN_S
_OFFSETS = np.arange(WINDOW)[:, None]
_LEAST_INTERPOLATED = 2
AWAITED = 2  # samples beyond a frame's capture that it waits for
_LEAST_SAMPLES = 12  # two windows: differences at both ends stay inside


class Attitudes:
    """Quaternions by barycentric Lagrange interpolation through six samples (Berrut & Trefethen 2004)."""

    def __init__(self, noise_rad: float, stamp_delay_s: float) -> None:
        """noise_rad: white; stamp_delay_s: attitudes are older than their stamps by 0 to this, uniformly."""
        self.noise_rad = noise_rad
        # The mean of the stamps' delay belongs to the attitudes: left out, the camera's delay absorbs it and shifts
        # the positions, too: 1.25 ms are 6 mm at 5 m/s.
        self._shift_s = -0.5 * stamp_delay_s
        self._samples = SampleBuffer(WINDOW + 4)  # barycentric factors of the window that ends here, quaternion
        self._newest: list[float] = []
        self._rates_from = math.inf  # s; pruning does not move it
        self._last = [1.0, 0.0, 0.0, 0.0]

    def __len__(self) -> int:
        return len(self._samples)

    def append(self, t: float, q: Sequence[float] | Array) -> bool:
        """Add the attitude (4,) stamped t; False: not finite, not later, or no rotation."""
        size = math.hypot(*q)
        if not (math.isfinite(t) and 0.5 < size < 2.0):
            return False
        t += self._shift_s
        if self._newest and t <= self._newest[-1]:
            return False
        # Of a rotation's two quaternions the one on the side of the last: between two samples it is interpolated.
        size = math.copysign(size, sum([a * float(b) for a, b in zip(self._last, q, strict=True)]))
        self._last = [float(c) / size for c in q]
        self._newest = [*self._newest[1 - WINDOW :], t]
        if len(self._samples) == _EDGE:
            self._rates_from = t + _RATES_SPAN_S
        self._samples.append(t, [*_barycentric_factors(self._newest), *self._last])
        return True

    def keep_near(self, instants: Array, margin_s: float) -> None:
        """Delete samples further than the margin from all instants (n,), ascending.

        Each sample has the factors of the window that ends at it; windows across a gap are never used, because an
        interpolation takes three samples at each side and the margin holds more.
        """
        times = self._samples.times
        right = instants.searchsorted(times).clip(0, len(instants) - 1)
        left = (right - 1).clip(0)
        distance = np.minimum(np.abs(times - instants[left]), np.abs(times - instants[right]))
        self._samples.keep(distance <= margin_s)

    def copy(self, span: Span = ALL) -> Attitudes:
        """A snapshot of a span of time, with the samples beyond it for which a frame of its end has waited."""
        other = Attitudes(self.noise_rad, -2.0 * self._shift_s)
        other._samples = self._samples.copy(span, AWAITED)
        other._newest, other._last = list(self._newest), self._last
        return other

    @property
    def ready(self) -> bool:
        """Whether an instant can be interpolated."""
        return len(self._samples) >= _LEAST_INTERPOLATED

    @property
    def rates_from(self) -> float:
        """Instant from which rates are known by samples on both sides, s."""
        return self._rates_from

    def shows_motion(self, until: float = math.inf) -> bool:
        """Whether a snapshot up to `until`, s, tells slow rates, and noise from motion: solves need both."""
        count = min(len(self._samples), self._samples.count_until(until) + AWAITED)
        if count < _LEAST_SAMPLES:
            return False
        times = self._samples.times
        return float(times[count - 1 - _EDGE] - times[_EDGE]) > _RATES_SPAN_S

    @property
    def newest(self) -> float:
        """Time of the newest sample, s."""
        return float(self._samples.times[-1])

    @property
    def oldest(self) -> float:
        """Time of the oldest sample, s."""
        return float(self._samples.times[0])

    def _weights(self, t: Array) -> tuple[Ints, Array]:
        """Indices (6, N) of the samples about instants (N,), and their weights (6, N); fewer while there are fewer."""
        times = self._samples.times
        size = min(WINDOW, len(times))
        first = np.minimum(np.maximum(times.searchsorted(t) - WINDOW // 2, 0), len(times) - size)
        index = first + _OFFSETS[:size]
        w = self._samples.values[WINDOW - size : WINDOW].take(first + size - 1, 1) / (t - times.take(index) + 1e-12)
        return index, w / np.add.reduce(w, 0)

    def quaternions(self, t: Array) -> Array:
        """Unit quaternions (4, N) at instants (N,), held beyond the samples' ends."""
        times = self._samples.times
        index, w = self._weights(np.minimum(np.maximum(t, times[0]), times[-1]))
        q = np.einsum("jn,ijn->in", w, self._samples.values[WINDOW:].take(index, 1))
        return np.asarray(q / np.sqrt(np.einsum("in,in->n", q, q)))

    def _inside(self) -> tuple[float, float]:
        """Interval in which both differences are between samples."""
        times = self._samples.times
        return float(times[2]) + 2 * _SLOW_STEP_S + _MARGIN_S, float(times[-3]) - _MARGIN_S

    def fast_and_slow_rates(self, t: Array) -> tuple[Array, Array]:
        """Rates (3, N) in carrier axes, rad/s, by a difference over 4 ms and by one over 0.3 s.

        In the first moments of a flight both are the mean rate since its first sample.
        """
        if not self.shows_motion():
            mean = self._mean_rate()
            return mean + 0.0 * t, mean + 0.0 * t
        first, last = self._inside()
        t = np.minimum(np.maximum(t, first), last)
        centre = np.minimum(t, last - _SLOW_STEP_S)
        instants = (t, t - _FAST_STEP_S, t + _FAST_STEP_S, centre, centre - _SLOW_STEP_S, centre + _SLOW_STEP_S)
        q = self.quaternions(np.concatenate(instants)).reshape(4, 6, -1)
        fast = body_rates(q[:, 0], (q[:, 2] - q[:, 1]) / (2 * _FAST_STEP_S))
        slow = body_rates(q[:, 3], (q[:, 5] - q[:, 4]) / (2 * _SLOW_STEP_S))
        return fast, slow

    def _mean_rate(self) -> Array:
        """Rate (3, 1) between the first and the newest sample, rad/s."""
        first, last = self._samples.times[[0, -1]].tolist()
        q = self.quaternions(np.array([first, 0.5 * (first + last), last]))
        return body_rates(q[:, 1:2], (q[:, 2:] - q[:, :1]) / (last - first))

    def motion_share(self, t: Array, fast: Array, slow: Array) -> Array:
        """Share (3, 1) of the fast rates, beyond the slow ones, that is motion and not noise of the attitudes.

        A delay's derivative is the rate times the ray. Noise in the rate is an error in the variables (Fuller 1987): it
        counts as information on the delay that does not exist (0.9 ms claimed, 12 ms off). The noise of the rates
        follows from this interpolation's own gain. Squares are clipped at their 98 % point: a polynomial's end can be
        far off.
        """
        squares = (fast - slow) ** 2
        rank = int(0.98 * (len(t) - 1))
        high = np.partition(squares, rank, axis=1)[:, rank, None]
        mean = np.minimum(squares, high).mean(1)
        t = t[:: 1 + len(t) // 200].clip(*self._inside())
        difference = self._weights(t + _FAST_STEP_S)[1] - self._weights(t - _FAST_STEP_S)[1]
        gain = float(np.median((difference**2).sum(0)))
        noise = self.noise_rad**2 * (gain / (2 * _FAST_STEP_S) ** 2 + 2 / (2 * _SLOW_STEP_S) ** 2)
        certain = 1.3 + 5 * np.sqrt(2 / fast.shape[1])
        return np.where(mean > certain * noise, 1 - noise / np.maximum(mean, 1e-12), 0.0)[:, None]


def _barycentric_factors(times: list[float]) -> list[float]:
    """Inverse products of the differences of a window's times; zeros before those of a window that is not full."""
    factors = [1.0 / math.prod([a - b for b in times if b != a]) for a in times]
    return [0.0] * (WINDOW - len(times)) + factors
