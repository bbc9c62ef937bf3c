"""Decides whether an unknown readout limits the accuracy: then `readout_s` should be set. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from fwav_companion.types import Bias, ErrorPriors, GroundFix, Notice, NoticeCode, Severity
from fwav_companion.types.flight_status import ReadoutReport

MEMORY = 100
"""Number of fixes over which the variances are averaged: ten wing beats of 5 Hz at 50 fixes/s."""
FEWEST = 20
MATTERS = 0.2
"""Share of the unknown readout in the horizontal variance of a fix relative to the vehicle, from which advice is given:
sigma is then 1.1 times what it would be with a known readout. The error of the vehicle's own position is excluded."""
LEAST_M = 0.1
"""One sigma due to the readout below which no advice is given, metres."""


class ReadoutAdvice:
    """Running means of the horizontal variance of fixes relative to the vehicle, and of the unknown readout's part."""

    def __init__(self, priors: ErrorPriors) -> None:
        self._variance = priors.sigma(Bias.READOUT) ** 2
        self._count = 0
        self._by_readout2 = self._total2 = 0.0
        self._advised = False

    def add(self, fixes: Sequence[GroundFix]) -> None:
        """Take one of the fixes of a frame."""
        if self._variance == 0.0 or not fixes:
            return
        fix = fixes[self._count % len(fixes)]  # one fix of a frame, in turn: each costs a covariance
        self._count += 1
        gain = max(1.0 / self._count, 1.0 / MEMORY)
        (north, east, _), cov = fix.bias_jacobian[Bias.READOUT], fix.relative_cov
        self._by_readout2 += gain * (self._variance * (north * north + east * east) - self._by_readout2)
        self._total2 += gain * (cov[0][0] + cov[1][1] - self._total2)

    @property
    def matters(self) -> bool:
        """Whether setting `readout_s` would make fixes clearly better."""
        return (
            self._count >= FEWEST
            and self._by_readout2 > MATTERS * self._total2
            and self._by_readout2 > LEAST_M * LEAST_M
        )

    def notices(self) -> tuple[Notice, ...]:
        """The advice as a notice, the first time that it applies."""
        if self._advised or not self.matters:
            return ()
        self._advised = True
        text = (
            f"set [camera] readout_s: unknown, it makes {self._by_readout_m:.1f} of {self._total_m:.1f} m (one sigma)"
        )
        return (Notice(NoticeCode.READOUT_UNKNOWN, Severity.NOTICE, text),)

    def status(self) -> ReadoutReport:
        """One sigma of fixes relative to the vehicle and of the readout's part in it, metres, for the status file."""
        return ReadoutReport(matters=self.matters, by_readout_m=self._by_readout_m, sigma_m=self._total_m)

    @property
    def _by_readout_m(self) -> float:
        return sqrt(self._by_readout2)

    @property
    def _total_m(self) -> float:
        return sqrt(self._total2)
