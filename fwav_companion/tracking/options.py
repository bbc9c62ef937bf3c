"""What [tracking] of the configuration says, in SI units."""

from __future__ import annotations

from typing import Literal

import msgspec


class TrackingOptions(msgspec.Struct, frozen=True, kw_only=True):
    """How targets are followed."""

    filter: Literal["kalman", "lowpass"] = "kalman"
    alpha: float = 0.125
    """Of lowpass: the share of a new fix after 1 / alpha_rate_hz seconds."""
    alpha_rate_hz: float = 30.0
    """0: the paper's recursion, one step a frame, one sample late."""
    motion: Literal["static", "moving"] = "static"
    """Whether targets stand or move at nearly constant velocity."""
    self_calibration: bool = False
    """Estimate the camera's time offset and mount, and the height, from targets that are seen again and again.

    It corrects the tracks of standing targets. Beside lowpass, or where targets may move, it is told and not applied.
    """
