"""A growing table of timed samples, oldest first, samples as the last axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array, Bools

_FIRST_CAPACITY = 1024


class Span(NamedTuple):
    """A span of time, both ends included, s."""

    until: float = math.inf
    since: float = -math.inf


ALL: Final = Span()


class SampleBuffer:
    """Times (n,) and values (width, n); the oldest samples can be deleted."""

    def __init__(self, width: int) -> None:
        self._times, self._values = np.empty(_FIRST_CAPACITY), np.empty((width, _FIRST_CAPACITY))
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def times(self) -> Array:
        """(n,) a view: contiguous, because a search in a strided column copies all of it."""
        return self._times[self._first : self._end]

    @property
    def values(self) -> Array:
        """(width, n) a view that may be written."""
        return self._values[:, self._first : self._end]

    def append(self, t: float, values: Sequence[float]) -> None:
        """Add a sample that is later than all others."""
        if self._end == len(self._times):
            self._make_room()
        self._times[self._end], self._values[:, self._end] = t, values
        self._end += 1

    def keep(self, which: Bools) -> None:
        """Delete the samples that the mask (n,) does not name."""
        times, values = self.times[which], self.values[:, which]
        n = len(times)
        self._first, self._end = 0, n
        self._times[:n], self._values[:, :n] = times, values

    def count_until(self, t: float) -> int:
        """Number of samples not later than t, s."""
        return int(self.times.searchsorted(t, side="right"))

    def copy(self, span: Span = ALL, beyond: int = 0) -> SampleBuffer:
        """An independent copy of the samples in a span of time, and of a number of samples beyond it."""
        other, end = SampleBuffer(len(self._values)), min(len(self), self.count_until(span.until) + beyond)
        first = min(end, int(self.times.searchsorted(span.since)))
        other._times, other._values = self.times[first:end].copy(), self.values[:, first:end].copy()
        other._end = end - first
        return other

    def _make_room(self) -> None:
        """Move the samples to the front, of twice the room where less than half of it would be free."""
        n = len(self)
        capacity = max(_FIRST_CAPACITY, len(self._times), 2 * n)
        times, values = np.empty(capacity), np.empty((len(self._values), capacity))
        times[:n], values[:, :n] = self.times, self.values
        self._times, self._values, self._first, self._end = times, values, 0, n
