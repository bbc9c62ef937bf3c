"""A straight line of clock offset over host time, with its covariance."""

from __future__ import annotations

from math import sqrt

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs

MOST_SKEW = 600e-6
"""Largest skew of a crystal's clock: a host's own clock discipline slews by up to 500 ppm, and crystals differ by up
to 100."""

SKEW_WANDER = 0.5e-6
"""Change of a crystal's rate due to temperature that the fit does not show, for every 10 s since the fit."""


class ClockLine(msgspec.Struct, frozen=True, gc=False):
    """Line of ``host_from_autopilot`` over host time near :attr:`ref_host_ns`."""

    ref_host_ns: HostNs
    offset_ns: int
    """Offset at the reference, nanoseconds."""
    skew: float
    """d(offset)/d(host)."""
    var_offset: float
    """Variance of the offset at the reference, s^2."""
    cov_offset_skew: float
    """Covariance of offset and skew, s."""
    var_skew: float

    def offset_ns_at(self, host_ns: HostNs) -> int:
        """Offset at this host instant, nanoseconds."""
        return self.offset_ns + round(self.skew * (host_ns - self.ref_host_ns))

    def host_from_boot(self, boot_ns: BootNs) -> HostNs:
        """Solution of ``host = boot + offset(host)``."""
        since_ref = boot_ns + self.offset_ns - self.ref_host_ns
        return HostNs(boot_ns + self.offset_ns + round(self.skew / (1.0 - self.skew) * since_ref))

    def sigma_s(self, host_ns: HostNs) -> float:
        """One sigma of the offset at this host instant, seconds."""
        dt = (host_ns - self.ref_host_ns) * 1e-9
        wander = SKEW_WANDER * dt * dt / 10.0
        return sqrt(
            max(0.0, self.var_offset + dt * (2.0 * self.cov_offset_skew + dt * self.var_skew)) + wander * wander
        )
