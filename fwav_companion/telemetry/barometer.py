"""Height above the take-off ground by the barometer alone, for vehicles that report nothing better. Pure.

A barometer shows differences: its mean while the vehicle is disarmed is the ground. A flight that is first received in
the air has no such mean, and its barometer is not used.
"""

from __future__ import annotations

from math import isfinite
from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, s_from_ns

SOURCES: Final = ("ALTITUDE", "VFR_HUD", "SCALED_PRESSURE")
"""Messages with a barometric altitude, the preferred first: the first two are filtered by the autopilot."""
GROUND_SIGMA_M: Final = 1.0
DRIFT_M_PER_S: Final = 1.0 / 600.0
"""One sigma of the height: that of the mean on the ground, and a metre more in ten minutes, by the weather and by the
sensor's temperature."""
MEAN_S: Final = 60.0
"""Time constant of the mean while disarmed, seconds: the weather moves it by centimetres within that time."""
SILENT_NS: Final = 3 * NS_PER_S
"""Silence of the source in use after which another one replaces it in flight."""
SEA_LEVEL_HPA: Final = 1013.25
"""Any reference does: only differences are used."""
ISA_M: Final = 44_330.77
ISA_EXPONENT: Final = 0.190263
"""Altitude of a pressure in the International Standard Atmosphere (ISO 2533) below 11 km."""
PRESSURES_HPA: Final = (200.0, 1100.0)
"""Plausible pressures: 11.8 km above to 0.7 km below the sea."""


def altitude_of_pressure_m(pressure_hpa: float) -> float | None:
    """Altitude in the standard atmosphere, metres; None for an implausible pressure."""
    low, high = PRESSURES_HPA
    if not low <= pressure_hpa <= high:
        return None
    return ISA_M * (1.0 - float((pressure_hpa / SEA_LEVEL_HPA) ** ISA_EXPONENT))


class Barometer:
    """Heights of barometric altitudes above their mean on the ground."""

    def __init__(self) -> None:
        self.source: str | None = None
        """The message in use; None before the first reading on the ground."""
        self._first_heard_armed = False
        self._armed: bool | None = None
        self._ground_m: dict[str, float] = {}
        """Mean altitude on the ground by source, metres."""
        self._ground_ns: dict[str, BootNs] = {}
        """Instant of the last reading on the ground by source."""
        self._heard_ns: dict[str, BootNs] = {}

    @property
    def starts_in_air(self) -> bool:
        """Whether readings come of a vehicle that was first received armed: there is no mean on the ground."""
        return self._first_heard_armed and bool(self._heard_ns)

    def on_heartbeat(self, *, armed: bool) -> None:
        """Take whether the vehicle is armed."""
        self._first_heard_armed = armed and (self._armed is None or self._first_heard_armed)
        self._armed = armed

    def height_m(self, source: str, altitude_m: float, boot_ns: BootNs) -> float | None:
        """Height of a reading above the ground, metres; None where it is not used."""
        if self._armed is None or not isfinite(altitude_m):
            return None
        before_ns, self._heard_ns[source] = self._heard_ns.get(source), boot_ns
        if not self._armed:
            step_s = 0.0 if before_ns is None else s_from_ns(boot_ns - before_ns)
            mean_m = self._ground_m.get(source, altitude_m)
            share = min(1.0, max(step_s, 0.0) / MEAN_S)
            self._ground_m[source] = mean_m + share * (altitude_m - mean_m)
            self._ground_ns[source] = boot_ns
        self._choose(source, boot_ns)
        ground_m = self._ground_m.get(source)
        return altitude_m - ground_m if source == self.source and ground_m is not None else None

    def sigma_m(self, boot_ns: BootNs) -> float:
        """One sigma of the height at this instant, metres."""
        since_ns = self._ground_ns.get(self.source or "", boot_ns)
        return GROUND_SIGMA_M + DRIFT_M_PER_S * max(0.0, s_from_ns(boot_ns - since_ns))

    def clear(self) -> None:
        """Forget all instants and means: the autopilot has started again."""
        self.source = self._armed = None
        for known in (self._ground_m, self._ground_ns, self._heard_ns):
            known.clear()

    def _choose(self, source: str, boot_ns: BootNs) -> None:
        """Choose the preferred source on the ground; in the air another one only where that one is silent."""
        if source not in self._ground_m or source == self.source:
            return
        present_ns = self._heard_ns.get(self.source or "")
        is_silent = present_ns is None or boot_ns - present_ns > SILENT_NS
        is_preferred = self.source is None or SOURCES.index(source) < SOURCES.index(self.source)
        if is_silent or (is_preferred and not self._armed):
            self.source = source
