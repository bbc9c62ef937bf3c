"""Reported positions, smoothed by the reported velocities as they come; steps of the report; calm velocities.

A scalar filter for each axis, forward with the samples and backward over a few of its time constants: the cost of a
sample does not grow with the flight.
"""

from __future__ import annotations

import math

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.path_axis import VELOCITY_NOISE, VELOCITY_SIGMA_M_S, PathAxis
from fwav_companion.estimation.path_samples import CALM_S, POSITION, VELOCITY, PathBreak, PathNoise, PathSamples, chord
from fwav_companion.estimation.sample_buffer import SampleBuffer

_LAG_S, _FRESH_S = 8.0, 1.5  # backward pass at every solve, and at every sample
_REFILTER_S, _REFILTER_SAMPLES = 120.0, 2000  # heights that are filtered again when their noise is another
_LONGEST_GAP_S = 2.0  # between two samples: the velocities do not bridge more
_INNOVATION_SIGMAS, _INCREMENT_SIGMAS = 6.0, 4.0  # both must be exceeded by a step
_MOST_BREAKS = 8  # each is one more constant of the error's prior
_FIRST_STEP_S = 0.1
_FIRST_ADAPTATION_S, _ADAPTATION_S = 0.3, 1.0


class VehiclePath:
    """The filter behind `samples`."""

    def __init__(self, noise_m: float, height_noise_m: float) -> None:
        """White noise (m) of north and east, and of heights."""
        self._axes = [PathAxis(noise_m), PathAxis(noise_m), PathAxis(height_noise_m)]
        self.samples = PathSamples(SampleBuffer(9), [], self._noise(_FIRST_STEP_S), axes=self._axes)
        self._heights = SampleBuffer(3)  # m as reported, m sum of the climbs by velocity, 1 where the path broke
        self._last_place: list[float] = []
        self._last_velocity: list[float] = []
        self._climbed_m = 0.0
        self._adapts_at: float | None = None  # s

    def append(self, t: float, position: Array, velocity: Array, *, reset: bool = False) -> bool:
        """Add north, east, height (m) and their rates (m/s); False for a sample that is not finite or not later."""
        if not (math.isfinite(t) and np.isfinite(position).all() and np.isfinite(velocity).all()):
            return False
        place, v, broken = position.tolist(), velocity.tolist(), False
        if self._last_place:
            last = self.samples.newest
            if t <= last:
                return False
            increments = chord(self._last_velocity, v, t - last)
            for axis, increment in zip(self._axes, increments, strict=True):
                axis.predict(increment, t - last)
            is_gap = t - last > _LONGEST_GAP_S
            broken = reset or is_gap or self._is_step(place, increments)
            if broken:
                moved = zip(place[:2], self._last_place[:2], increments[:2], strict=True)
                north, east = (z - before - increment for z, before, increment in moved)
                self._break(last, t, place, None if is_gap else (north, east))
            self._climbed_m += increments[2]
        for axis, z in zip(self._axes, place, strict=True):
            axis.update(z)
        self._heights.append(t, (place[2], self._climbed_m, float(broken)))
        self.samples.buffer.append(t, (*place, *v, *v))
        self._last_place, self._last_velocity = place, v
        self._adapt(t)
        self._smooth(_FRESH_S)
        return True

    def _is_step(self, place: list[float], increments: tuple[float, float, float]) -> bool:
        """Whether north or east stepped, against the filter and against the last sample.

        A filter that trusts velocities lags behind a fast wander; an innovation that is lag is not a step.
        """
        axes = zip(self._axes[:2], place[:2], self._last_place[:2], increments[:2], strict=True)
        return any(
            axis.innovation_sigmas(z) > _INNOVATION_SIGMAS
            and abs(z - before - moved) > _INCREMENT_SIGMAS * math.sqrt(2 * axis.r + 0.0025)
            for axis, z, before, moved in axes
        )

    def _break(self, before: float, after: float, place: list[float], jump: tuple[float, float] | None) -> None:
        # The smoothing must not bridge a reset: it would bend seconds of the path.
        step = max(abs(z - axis.predicted[-1][0]) for axis, z in zip(self._axes, place, strict=True))
        breaks = self.samples.breaks
        breaks.append(PathBreak(before, after, step, jump))
        del breaks[:-_MOST_BREAKS]
        for axis in self._axes:
            axis.reopen()

    def settle(self) -> None:
        """Before a solve: smooth over the whole lag."""
        noise = self.samples.noise
        self._smooth(max(_LAG_S, 6 * noise.level[1], 6 * noise.up[1]))

    def _adapt(self, t: float) -> None:
        """Find the noise of heights and velocities by the data, at instants of the telemetry alone: a frame that comes
        late, and the solve that it begins, must not change the filters of the others.
        """
        if self._adapts_at is None:
            self._adapts_at = t + _FIRST_ADAPTATION_S
        if t < self._adapts_at:
            return
        self._adapts_at = t + _ADAPTATION_S
        self.samples.step_s = float(np.median(np.diff(self.samples.buffer.times[-400:])))
        self._adapt_height_filter()
        self._find_motion_share()
        self.samples.noise = self._noise(self.samples.step_s)

    def _noise(self, step_s: float) -> PathNoise:
        return PathNoise(self._axes[0].remaining_noise(step_s), self._axes[2].remaining_noise(step_s))

    def _smooth(self, span_s: float) -> None:
        self.samples.smooth(min(len(self.samples.buffer), int(span_s / self.samples.step_s) + 2))

    def _find_motion_share(self) -> None:
        t, values = self.samples.buffer.times[-600:], self.samples.buffer.values[:, -600:]
        half = max(1, round(0.5 * CALM_S / self.samples.step_s))
        if len(t) < 6 * half:
            return
        slow = (values[POSITION, 2 * half :] - values[POSITION, : -2 * half]) / (t[2 * half :] - t[: -2 * half])
        squares = ((values[VELOCITY, half:-half] - slow) ** 2).mean(1)
        squares[:2] = squares[:2].mean()
        certain = (1.3 + 5 * math.sqrt(2 / len(t))) * VELOCITY_SIGMA_M_S**2
        share = np.where(squares > certain, 1 - VELOCITY_SIGMA_M_S**2 / np.maximum(squares, 1e-12), 0.0)
        if self.samples.heights_lead:
            share[2] = 0.0
        self.samples.motion_share = share[:, None]

    def _adapt_height_filter(self) -> None:
        """Open the filter to the heights where the climb rates contradict them by more than noise.

        Barometers wander and velocities do not show it: a filter that trusts the velocities would smooth the heights
        into something that neither stream reports.
        """
        axis, white = self._axes[2], self._axes[2].noise_m ** 2
        lag = max(1, round(1.0 / self.samples.step_s))
        count = min(int(_REFILTER_S / self.samples.step_s), _REFILTER_SAMPLES)
        heights, climbed, _ = self._heights.values[:, -count:]
        if heights.size <= 3 * lag:
            return
        rise = heights[lag:] - heights[:-lag]

        def process_noise(residual: Array) -> float:
            return max(VELOCITY_NOISE, (float(np.mean(residual**2)) - 2 * white) / (lag * self.samples.step_s))

        q, driven = process_noise(rise - (climbed[lag:] - climbed[:-lag])), True
        if q < 4 * VELOCITY_NOISE + 0.1 * white:
            q = VELOCITY_NOISE
        elif (alone := process_noise(rise)) < q:
            q, driven = alone, False
        if driven != axis.driven or not 0.9 < q / axis.process_noise < 1.1:
            self._refilter_heights(PathAxis(axis.noise_m, q, driven=driven), count)

    def _refilter_heights(self, axis: PathAxis, count: int) -> None:
        t = self._heights.times[-count:].tolist()
        heights, climbed, broken = self._heights.values[:, -count:].tolist()
        for i, height in enumerate(heights):
            if i:
                axis.predict(climbed[i] - climbed[i - 1], t[i] - t[i - 1])
                if broken[i]:
                    axis.reopen()
            axis.update(height)
        self._axes[2] = axis
        first = len(self.samples.buffer) - len(t)
        self.samples.buffer.values[2, first:] = axis.smoothed(len(t))
        if self.samples.heights_lead:
            self.samples.climb_by_heights(first)
