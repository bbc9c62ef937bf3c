"""A straight line of clock offset over host time, with its covariance."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs

MOST_SKEW = 600e-6
"""Largest skew of a crystal's clock: a host's own clock discipline slews by up to 500 ppm, and crystals differ by up
to 100."""

LEAST_REPORTED_RATE, RATE_SIGMAS = 200e-6, 3.0
"""Differences of a rate from 1, absolute and in sigmas, that it must both exceed to be reported."""


class ClockLine(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Line of ``host_from_autopilot`` over host time near :attr:`ref_host_ns`."""

    ref_host_ns: HostNs
    offset_ns: int
    """Offset at the reference, nanoseconds."""
    skew: float
    """d(offset)/d(host)."""
    var_offset: float
    """Variance of the offset at the reference, s^2."""
    cov_offset_skew: float = 0.0
    """Covariance of offset and skew, s."""
    var_skew: float = 0.0
    wander: float = 0.0
    """One sigma of the rate's change since the reference."""
    var_bias: float = 0.0
    """Variance of the part of the error that no further exchange reduces: the asymmetry of the delays, s^2."""

    def offset_ns_at(self, host_ns: HostNs) -> int:
        """Offset at this host instant, nanoseconds."""
        return self.offset_ns + round(self.skew * (host_ns - self.ref_host_ns))

    def host_from_boot(self, boot_ns: BootNs) -> HostNs:
        """Solution of ``host = boot + offset(host)``."""
        since_ref = boot_ns + self.offset_ns - self.ref_host_ns
        return HostNs(boot_ns + self.offset_ns + round(self.skew / (1.0 - self.skew) * since_ref))

    @property
    def differs(self) -> bool:
        """Whether the rate differs from 1 beyond three sigmas and 200 ppm."""
        skew2 = self.skew**2
        return skew2 > LEAST_REPORTED_RATE**2 and skew2 > RATE_SIGMAS**2 * self.var_skew

    def scatter(self, host_ns: HostNs) -> float:
        """Variance of the offset at this host instant without the asymmetry of the delays, s^2."""
        dt = (host_ns - self.ref_host_ns) * 1e-9
        variance = self.var_offset + dt * (2.0 * self.cov_offset_skew + dt * (self.var_skew + self.wander**2))
        return max(0.0, variance)
