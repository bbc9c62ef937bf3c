"""The vector from the camera to a landmark, smoothed over its sights."""

from __future__ import annotations

from math import exp

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, scale, subtract

SMOOTHING_S = 0.3
"""Time constant of the smoothed vector to a landmark: three samples of telemetry, and a turn of 20 degrees/s."""
EARLIER_NS = 250_000_000
"""Least age of the vector that is used: two samples of telemetry, which sights between them share."""
STALE_NS = 1_500_000_000
"""Interval of sights beyond which each is used with its own vector: they are few, and share no noise."""


class ViewLine(msgspec.Struct, frozen=True, gc=False):
    """The vector from the camera to a landmark by an alpha-beta filter of the sights."""

    vector: Vector3
    """North, east and down, metres."""
    slope: Vector3
    """m/s."""
    at_ns: HostNs

    def at(self, host_ns: HostNs) -> Vector3:
        """The vector at another instant."""
        return add(self.vector, scale(self.slope, s_from_ns(host_ns - self.at_ns)))

    def with_sight(self, vector: Vector3, host_ns: HostNs) -> ViewLine:
        """The vector after one more sight."""
        since_s = max(s_from_ns(host_ns - self.at_ns), 1e-3)
        ahead, left = self.at(host_ns), exp(-since_s / SMOOTHING_S)
        off = subtract(vector, ahead)
        slope = add(self.slope, scale(off, (1.0 - left) ** 2 / since_s))
        return ViewLine(add(ahead, scale(off, 1.0 - left * left)), slope, host_ns)


class Sequel(msgspec.Struct, frozen=True, gc=False):
    """What the next sight of a landmark continues."""

    smooth: ViewLine
    """The vector by all sights."""
    earlier: ViewLine
    """The same a while ago: what it holds of noise is not that of the next sight."""
    in_a_row: int = 0
    """Refused sights since the last one that agreed."""


def continued(before: Sequel | None, vector: Vector3, host_ns: HostNs) -> tuple[Sequel, Vector3]:
    """The sequel with one more sight, and the vector at which its sensitivities are taken.

    That vector is predicted from sights a while ago. With the noise of this sight in it the filter would take the noise
    for information: 30 sights/s make much of little.
    """
    if before is None or host_ns - before.smooth.at_ns > STALE_NS:
        line = ViewLine(vector, ZERO3, host_ns)
        return Sequel(line, line, 0 if before is None else before.in_a_row), vector
    earlier = before.smooth if before.smooth.at_ns - before.earlier.at_ns >= EARLIER_NS else before.earlier
    return Sequel(before.smooth.with_sight(vector, host_ns), earlier, before.in_a_row), earlier.at(host_ns)
