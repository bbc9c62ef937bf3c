"""Readings of a rangefinder as measurements of the height's error: one row each.

A reading is the camera's height above the ground under the beam. The ground's level under the beam, relative to the
surface of the targets, wanders as the vehicle flies on, and the autopilot's altitude drifts: both are the error up, a
trajectory of knots. What all readings have in common stays in the height's constant error, as without a rangefinder.

    reading = reported height + climb rate x position delay - error up - surface under the beam
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array, Ints
from fwav_companion.estimation.sample_buffer import ALL, SampleBuffer, Span

if TYPE_CHECKING:
    from fwav_companion.estimation.path_samples import PathBreak

SAME_FOOT_M = 2.0
"""Distance of two feet of the beam within which the ground's roughness is the same: a bush, a furrow, a parked car."""
_OF_GAP = 3  # readings used between two knots: more of them show the same foot again
_HEIGHT, _SIGMA, _FOOT = 0, 1, slice(2, 4)


class RangeReading(NamedTuple):
    """One reading."""

    t: float  # s
    height_m: float  # camera above the ground under the beam
    sigma_m: float  # of the finder, and of the tilt


class UsedReadings(NamedTuple):
    """Readings of a solve, in order of time."""

    t: Array  # (N,) s
    height_m: Array  # (N,)
    variance: Array  # (N,) m^2, with the roughness that neighbours share
    foot: Array  # (2, N) m north, east


class RangeReadings:
    """All kept readings of a flight."""

    def __init__(self, samples: SampleBuffer | None = None) -> None:
        self._samples = samples or SampleBuffer(4)

    def __len__(self) -> int:
        return len(self._samples)

    def append(self, reading: RangeReading, foot: tuple[float, float]) -> bool:
        """Add a reading with its foot, m north and east; False for one that is not finite or not later."""
        values = (reading.height_m, reading.sigma_m, *foot)
        if not np.isfinite((reading.t, *values)).all() or reading.sigma_m < 0.0:
            return False
        if len(self._samples) and reading.t <= self._samples.times[-1]:
            return False
        self._samples.append(reading.t, values)
        return True

    def copy(self, span: Span = ALL) -> RangeReadings:
        """A snapshot of the readings in a span of time."""
        return RangeReadings(self._samples.copy(span)) if len(self._samples) else RangeReadings()

    def keep_near(self, instants: Array, margin_s: float) -> None:
        """Delete readings further than the margin from all instants (n,), ascending."""
        times = self._samples.times
        right = instants.searchsorted(times).clip(0, len(instants) - 1)
        left = (right - 1).clip(0)
        distance = np.minimum(np.abs(times - instants[left]), np.abs(times - instants[right]))
        self._samples.keep(distance <= margin_s)

    def newest(self, after: float, until: float) -> tuple[RangeReading, Array] | None:
        """The newest reading in an interval of time, and its foot (2,); None without one."""
        times = self._samples.times
        i = int(times.searchsorted(until, side="right")) - 1
        if i < 0 or times[i] <= after:
            return None
        values = self._samples.values[:, i]
        return RangeReading(float(times[i]), float(values[_HEIGHT]), float(values[_SIGMA])), values[_FOOT].copy()

    def used(self, knots: Array, breaks: list[PathBreak], roughness_m: float) -> UsedReadings:
        """A few readings between each two knots (K,), none within a break of the path.

        Readings whose feet are near one another see the same bump: together they count as one look at the ground.
        """
        times = self._samples.times
        gap = knots.searchsorted(times, side="right") - 1
        inside = (gap >= 0) & (times <= knots[-1])
        for b in breaks:
            inside &= (times <= b.before) | (times >= b.after)
        index = np.flatnonzero(inside)
        index = index[_spread_over_gaps(gap[index])]
        values = self._samples.values.take(index, 1)
        foot = values[_FOOT]
        apart2 = ((foot[:, :, None] - foot[:, None]) ** 2).sum(0)  # (N, N)
        alike = (apart2 < SAME_FOOT_M**2).sum(1)
        return UsedReadings(times[index], values[_HEIGHT], values[_SIGMA] ** 2 + roughness_m**2 * alike, foot)


def _spread_over_gaps(gap: Ints) -> Ints:
    """Indices of at most three evenly spread readings of each gap; gap (N,): ascending number of each reading's gap."""
    if not len(gap):
        return np.zeros(0, np.int64)
    _, first, count = np.unique(gap, return_index=True, return_counts=True)
    rank = np.arange(len(gap)) - np.repeat(first, count)
    step = np.repeat(-(-count // _OF_GAP), count)
    return np.flatnonzero(rank % step == 0).astype(np.int64)
