"""Variants in which the report tracks one recording: the paper's filter, and ours with and without self-calibration.

Pure.
"""

from __future__ import annotations

import msgspec

from fwav_companion.config import Config


class TrackingVariant(msgspec.Struct, frozen=True):
    """A choice of filter and self-calibration."""

    name: str
    """The variant's name in the report."""
    kind: str
    """Colour class: paper | plain | calibrated | own."""
    filter: str
    """[tracking] filter."""
    self_calibration: bool
    """[tracking] self_calibration."""
    alpha_rate_hz: float | None = None
    """[tracking] alpha_rate_hz; None: as configured."""

    def applied_to(self, config: Config) -> Config:
        """The configuration with this variant's [tracking] keys."""
        changed = {"filter": self.filter, "self_calibration": self.self_calibration}
        if self.alpha_rate_hz is not None:
            changed["alpha_rate_hz"] = self.alpha_rate_hz
        return msgspec.structs.replace(config, tracking=msgspec.structs.replace(config.tracking, **changed))


PAPER = TrackingVariant("the paper's filter", "paper", "lowpass", False, alpha_rate_hz=0.0)
"""First-order low-pass filter, one step per frame. The paper claims no accuracy: the claim here is the recursion's."""
PLAIN = TrackingVariant("the tracker without self-calibration", "plain", "kalman", False)
CALIBRATED = TrackingVariant("the tracker with self-calibration", "calibrated", "kalman", True)
VARIANTS = (PAPER, PLAIN, CALIBRATED)


def variant_of(config: Config) -> TrackingVariant:
    """The variant of a configuration; a user's filter or another low-pass filter has the kind "own"."""
    tracking = config.tracking
    for variant in VARIANTS:
        if variant.applied_to(config).tracking == tracking:
            return variant
    name = f"the filter {tracking.filter}" if tracking.is_own_filter else "the low-pass as configured"
    return TrackingVariant(name, "own", tracking.filter, tracking.self_calibration)
