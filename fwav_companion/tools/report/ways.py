"""The ways in which one recording can be tracked: the paper's, and ours without and with self-calibration. Pure."""

from __future__ import annotations

import msgspec

from fwav_companion.config import Config


class Way(msgspec.Struct, frozen=True):
    """What a reader is told of it, and what it changes in [tracking]."""

    name: str
    kind: str
    """Its colour: paper | plain | calibrated | own."""
    filter: str
    self_calibration: bool
    alpha_rate_hz: float | None = None
    """None: as configured."""

    def of(self, config: Config) -> Config:
        """The configuration, tracked this way."""
        changed = {"filter": self.filter, "self_calibration": self.self_calibration}
        if self.alpha_rate_hz is not None:
            changed["alpha_rate_hz"] = self.alpha_rate_hz
        return msgspec.structs.replace(config, tracking=msgspec.structs.replace(config.tracking, **changed))


PAPER = Way("the paper's filter", "paper", "lowpass", False, alpha_rate_hz=0.0)
"""A first-order low-pass, a step a frame. The paper claims no accuracy; its claim here is that recursion's own."""
PLAIN = Way("the tracker without self-calibration", "plain", "kalman", False)
CALIBRATED = Way("the tracker with self-calibration", "calibrated", "kalman", True)
WAYS = (PAPER, PLAIN, CALIBRATED)


def way_of(config: Config) -> Way:
    """Which of them a configuration is; a filter of one's own, or another low-pass, is none."""
    tracking = config.tracking
    for way in WAYS:
        if way.of(config).tracking == tracking:
            return way
    name = f"the filter {tracking.filter}" if tracking.is_own_filter else "the low-pass as configured"
    return Way(name, "own", tracking.filter, tracking.self_calibration)
