"""Options of a copter that lands by LANDING_TARGET."""

from __future__ import annotations

from dataclasses import dataclass

from sitl_mock.option_types import NotNegative, Positive


@dataclass(frozen=True, kw_only=True)
class LanderOptions:
    """Pattern landing: held over the first target at ``flight.offset_m`` and ``flight.height_m``, then LAND."""

    at_s: NotNegative = 6.0
    """Time at which the pilot switches to LAND."""
    gear_m: Positive = 0.2
    """Height of the vehicle's origin above the ground once it rests on its legs."""
    moving_target: bool = False
    """PLND_OPTIONS bit 0: it moves along with its target."""
    gust_m_s2: NotNegative = 0.03
    """Slow acceleration by the wind, RMS per axis; a calm day."""
