"""Poses of pictures that have their own: each holds at its picture alone, and nothing is interpolated between two.

Errors of a single pose are noise of its picture's sightings (``Sightings.own_noise``), so the path itself has none.
"""

from __future__ import annotations

import math

import numpy as np

from fwav_companion.estimation.attitudes import WINDOW, Attitudes
from fwav_companion.estimation.errors import Array, Ints
from fwav_companion.estimation.path_samples import PathNoise, PathSamples
from fwav_companion.estimation.sample_buffer import ALL, SampleBuffer, Span

_NO_NOISE = PathNoise((1e-6, 1.0), (1e-6, 1.0))


def nearest(times: Array, t: Array) -> Ints:
    """Indices (N,) of the times (n,), ascending, that are nearest to instants (N,)."""
    right = times.searchsorted(t).clip(0, len(times) - 1)
    left = (right - 1).clip(0)
    return np.where(t - times[left] < times[right] - t, left, right)


class PictureAttitudes(Attitudes):
    """The attitude of the nearest picture. Its rates are not known, and no delay turns it."""

    @property
    def ready(self) -> bool:
        """Whether there is a picture."""
        return len(self) > 0

    @property
    def rates_from(self) -> float:
        """Always: rates are not used."""
        return -math.inf

    def shows_motion(self, until: float = math.inf) -> bool:  # noqa: ARG002
        """The same: rates are not used."""
        return self.ready

    def keep_near(self, instants: Array, margin_s: float) -> None:
        """Keep all: there is one a picture."""

    def copy(self, span: Span = ALL) -> PictureAttitudes:
        """A snapshot of a span of time."""
        other = PictureAttitudes(self.noise_rad, 0.0)
        other._samples = self._samples.copy(span)
        other._newest, other._last = list(self._newest), self._last
        return other

    def quaternions(self, t: Array) -> Array:
        """Unit quaternions (4, N) at instants (N,)."""
        return np.asarray(self._samples.values[WINDOW:].take(nearest(self._samples.times, t), 1))

    def fast_and_slow_rates(self, t: Array) -> tuple[Array, Array]:
        """Zero (3, N), twice."""
        return np.zeros((3, len(t))), np.zeros((3, len(t)))

    def motion_share(self, t: Array, fast: Array, slow: Array) -> Array:  # noqa: ARG002
        """Zero (3, 1)."""
        return np.zeros((3, 1))


class PicturePath(PathSamples):
    """The position of the nearest picture, at rest. It is its own filter: ``VehiclePath``."""

    def __init__(self) -> None:
        super().__init__(SampleBuffer(3), [], _NO_NOISE)

    @property
    def samples(self) -> PathSamples:
        """The positions."""
        return self

    @property
    def ready(self) -> bool:
        """Whether there is a picture."""
        return len(self.buffer) > 0

    def shows_motion(self, until: float) -> bool:  # noqa: ARG002
        """The same: the path is at rest."""
        return self.ready

    def append(self, t: float, position: Array, velocity: Array, *, reset: bool = False) -> bool:  # noqa: ARG002
        """Add north, east, height (m); False for a sample that is not finite or not later."""
        if not np.isfinite(position).all() or (len(self.buffer) and t <= self.newest):
            return False
        self.buffer.append(t, position.tolist())
        return True

    def settle(self) -> None:
        """Do nothing: the positions are as reported."""

    def copy(self, span: Span = ALL) -> PicturePath:
        """A snapshot of a span of time."""
        other = PicturePath()
        other.buffer, other.accuracies = self.buffer.copy(span), list(self.accuracies)
        return other

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Position, velocity and calm velocity, each (3, N), at instants (N,)."""
        position = self.buffer.values.take(nearest(self.buffer.times, t), 1)
        return position, np.zeros_like(position), np.zeros_like(position)
