"""Reported positions, smoothed by the reported velocities as they come; steps of the report; calm velocities.

A scalar filter for each axis, forward with the samples and backward over a few of its time constants: the cost of a
sample does not grow with the flight.
"""

from __future__ import annotations

import math

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.path_axis import VELOCITY_NOISE, PathAxis
from fwav_companion.estimation.path_samples import (
    VELOCITY,
    PathBreak,
    PathNoise,
    PathSamples,
    Settling,
    chord,
    fitted_samples,
    fitted_velocities,
)
from fwav_companion.estimation.sample_buffer import SampleBuffer

_LAG_S, _FRESH_S = 8.0, 1.5  # backward pass at every solve, and at every sample
_REFILTER_S, _REFILTER_SAMPLES = 120.0, 2000  # heights that are filtered again when their noise is another
_LONGEST_GAP_S = 2.0  # between two samples: the velocities do not bridge more
_INNOVATION_SIGMAS, _INCREMENT_SIGMAS = 6.0, 4.0  # both must be exceeded by a step
_MOST_BREAKS = 8  # each is one more constant of the error's prior
_FIRST_STEP_S = 0.1
_CERTAIN_SHARE = 3.0  # standard deviations of a correlation by chance, for one sample
_SHARE_SAMPLES = 300  # newest velocities that show how much of their changes is motion
_SETTLED_SHARE = 1e-3  # of a sample's variance, below which a filter's is that of a long path
_CONTRADICTED_S, _LEAST_CONTRADICTED = 3.0, 4  # span in which wrong velocities show; spans that must have passed
# Mean error of velocities over that span that is no receiver's wander: 0.18 m within a second, a random walk, is 0.10.
# ArduCopter's simulator: 0.01 to 0.03. PX4's: 0.25.
_WRONG_SPEED_M_S = 0.15
_FIRST_ADAPTATION_S, _ADAPTATION_S = 0.3, 1.0


class VehiclePath:
    """The filter behind `samples`."""

    def __init__(self, noise_m: float, height_noise_m: float) -> None:
        """White noise (m) of north and east, and of heights."""
        self._axes = [PathAxis(noise_m), PathAxis(noise_m), PathAxis(height_noise_m)]
        self.samples = PathSamples(SampleBuffer(9), [], self._noise(_FIRST_STEP_S), axes=self._axes)
        # (3,) m as reported, (3,) m sum of the ways by velocity, 1 where the path broke
        self._reports = SampleBuffer(7)
        self._last_place: list[float] = []
        self._last_velocity: list[float] = []
        self._moved_m = [0.0, 0.0, 0.0]
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
            self._moved_m = [a + b for a, b in zip(self._moved_m, increments, strict=True)]
        for axis, z in zip(self._axes, place, strict=True):
            axis.update(z)
        self._settle_at(t, is_new=broken or not self._last_place)
        self._reports.append(t, (*place, *self._moved_m, float(broken)))
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

    def _settle_at(self, t: float, *, is_new: bool) -> None:
        """Keep how far the filters are from settled; is_new: the sample begins a piece."""
        settling, step_s = self.samples.settling, self.samples.step_s
        if is_new:
            settling.clear()
        elif not settling[-1].level and not settling[-1].up:
            return
        level, up = (self._axes[i].unsettled(step_s) for i in (0, 2))
        is_settled = level < _SETTLED_SHARE * self._axes[0].r and up < _SETTLED_SHARE * self._axes[2].r
        settling.append(Settling(t, 0.0, 0.0) if is_settled else Settling(t, level, up))

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
        self._adapt_level_filters()
        self._adapt_height_filter()
        self._find_motion_share()
        self.samples.noise = self._noise(self.samples.step_s)

    def _noise(self, step_s: float) -> PathNoise:
        return PathNoise(self._axes[0].remaining_noise(step_s), self._axes[2].remaining_noise(step_s))

    def _smooth(self, span_s: float) -> None:
        self.samples.smooth(min(len(self.samples.buffer), int(span_s / self.samples.step_s) + 2))

    def _find_motion_share(self) -> None:
        buffer = self.samples.buffer
        t, velocity = buffer.times[-_SHARE_SAMPLES:], buffer.values[VELOCITY, -_SHARE_SAMPLES:]
        reach = fitted_samples(self.samples.step_s)
        if len(t) < 3 * reach:
            return
        slow = fitted_velocities(t, velocity, reach, self.samples.step_s)[:, :-reach]
        fast = velocity[:, reach:-reach] - slow
        # Motion that samples resolve is alike in two that follow each other; noise is not, nor is the heave of a wing
        # beat, whose samples alternate: as motion it would be information on the delays.
        squares, alike = (fast * fast).mean(1), (fast[:, 1:] * fast[:, :-1]).mean(1)
        squares[:2], alike[:2] = squares[:2].mean(), alike[:2].mean()
        share = alike / np.maximum(squares, 1e-12)
        share[share < _CERTAIN_SHARE / math.sqrt(fast.shape[1])] = 0.0
        if self.samples.heights_lead:
            share[2] = 0.0
        self.samples.motion_share = share[:, None]

    def _newest_reports(self) -> tuple[int, Array, Array, Array]:
        """Samples (n) that judge the filters, their places (3, n), ways by velocity (3, n) and breaks (n,) so far."""
        count = min(int(_REFILTER_S / self.samples.step_s), _REFILTER_SAMPLES)
        values = self._reports.values[:, -count:]
        return values.shape[1], values[:3], values[3:6], np.cumsum(values[6])

    def _adapt_level_filters(self) -> None:
        """Open north and east to the positions where the velocities contradict them for seconds.

        PX4's were 0.3 m/s off for ten seconds (its simulator), its positions were right: a filter that trusts such
        velocities lags by half a metre. A receiver's wander shows in the positions, too, and must not open them: the
        sightings find it. It is slower, or grows with the root of the time only.
        """
        axis, step_s = self._axes[0], self.samples.step_s
        count, place, moved, breaks = self._newest_reports()
        lag, white = max(1, round(_CONTRADICTED_S / step_s)), axis.noise_m**2
        if count < _LEAST_CONTRADICTED * lag:
            return
        whole = breaks[lag:] == breaks[:-lag]
        off = (place - moved)[:2]  # (2, n)
        rise = (off[:, lag:] - off[:, :-lag])[:, whole]
        if not rise.size:
            return
        squares = float(np.mean(rise**2)) - 2.0 * white
        q = VELOCITY_NOISE
        if squares > (_WRONG_SPEED_M_S * lag * step_s) ** 2:
            q = max(q, squares / (lag * step_s))
        if not 0.9 < q / axis.process_noise < 1.1:
            for i in (0, 1):
                self._refilter(i, PathAxis(axis.noise_m, q), count)

    def _adapt_height_filter(self) -> None:
        """Open the filter to the heights where the climb rates contradict them by more than noise.

        Barometers wander and velocities do not show it: a filter that trusts the velocities would smooth the heights
        into something that neither stream reports.
        """
        axis, white = self._axes[2], self._axes[2].noise_m ** 2
        count, place, moved, _ = self._newest_reports()
        heights, climbed = place[2], moved[2]

        def process_noise(way: Array, seconds: float) -> float:
            """Of a random walk that changes like this way (n,) in such a time, m^2/s."""
            lag = max(1, round(seconds / self.samples.step_s))
            squares = float(np.mean((way[lag:] - way[:-lag]) ** 2)) if len(way) > 3 * lag else 0.0
            return max(VELOCITY_NOISE, (squares - 2 * white) / (lag * self.samples.step_s))

        # Over a second what wanders, over some what comes from velocities that are wrong for longer.
        q, driven = max(process_noise(heights - climbed, each) for each in (1.0, _CONTRADICTED_S)), True
        if q < 4 * VELOCITY_NOISE + 0.1 * white:
            q = VELOCITY_NOISE
        elif (alone := process_noise(heights, 1.0)) < process_noise(heights - climbed, 1.0):
            q, driven = alone, False
        if driven != axis.driven or not 0.9 < q / axis.process_noise < 1.1:
            self._refilter(2, PathAxis(axis.noise_m, q, driven=driven), count)
            if self.samples.heights_lead:
                self.samples.climb_by_heights(len(self.samples.buffer) - count)

    def _refilter(self, i: int, axis: PathAxis, count: int) -> None:
        """Replace the filter of coordinate i by another one that has taken the newest samples."""
        t = self._reports.times[-count:].tolist()
        places, moved, broken = self._reports.values[[i, 3 + i, 6], -count:].tolist()
        for k, place in enumerate(places):
            if k:
                axis.predict(moved[k] - moved[k - 1], t[k] - t[k - 1])
                if broken[k]:
                    axis.reopen()
            axis.update(place)
        self._axes[i] = axis
        self.samples.buffer.values[i, len(self.samples.buffer) - len(t) :] = axis.smoothed(len(t))
