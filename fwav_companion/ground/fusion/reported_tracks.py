"""A vehicle's track in one local plane, with its error split for the fusion. Pure.

    position = target + J b + shared + noise

with b the vehicle's own biases (north, east, heading), ``shared`` the error that several vehicles may have in common,
and ``noise`` an error that is independent of every other track.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
BIASES = 3
"""Number of biases of a vehicle: position north, position east, heading."""


@dataclass(slots=True, kw_only=True)
class ReportedTrack:
    """One track of one vehicle, horizontal."""

    vehicle: str
    track: int
    label: str
    confirmed: bool
    position: Array
    """North and east in the common plane, metres."""
    velocity: Array | None = None
    """North and east, m/s."""
    noise: Array
    """Covariance of the independent part, m^2."""
    shared: Array
    """Covariance of the part that vehicles may share, m^2."""
    jacobian: Array
    """d(position)/d(bias), 2 by BIASES."""
    down_m: float = 0.0
    down_variance: float = 1.0
    at_unix: float = 0.0
    """Instant of the position."""
    seen_unix: float = 0.0
    """Instant of the last fix."""

    @property
    def key(self) -> tuple[str, int]:
        """Vehicle and track."""
        return (self.vehicle, self.track)

    def at(self, now: float) -> Array:
        """Position predicted for an instant, by at most one second, metres."""
        if self.velocity is None:
            return self.position
        moved: Array = self.position + self.velocity * min(max(now - self.at_unix, 0.0), 1.0)
        return moved


@dataclass(slots=True)
class ReportingVehicle:
    """One vehicle: its tracks, and the prior of its own biases."""

    name: str
    sigmas: Array
    """One sigma of each bias: metres, metres, radians."""
    tracks: dict[int, ReportedTrack] = field(default_factory=dict)
    heard_unix: float = 0.0
    bias: Array = field(default_factory=lambda: np.zeros(BIASES))
    """Estimate of its biases from the targets that it shares with others."""
    bias_cov: Array = field(default_factory=lambda: np.zeros((BIASES, BIASES)))

    def corrected(self, track: ReportedTrack, now: float) -> Array:
        """Position of a track without the estimated biases, metres."""
        position: Array = track.at(now) - track.jacobian @ self.bias
        return position

    def spread(self, track: ReportedTrack) -> Array:
        """Covariance of a track's position without the estimated biases, m^2."""
        cov: Array = track.noise + track.shared + track.jacobian @ self.bias_cov @ track.jacobian.T
        return cov
