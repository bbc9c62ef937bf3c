"""Sends FOLLOW_TARGET of the selected target, for an autopilot whose pilot chose its follow mode. Pure.

The altitude is above mean sea level, as both autopilots read it. The stamp is the host's monotonic clock: ArduPilot
corrects its jitter, PX4 reads only differences.
"""

from __future__ import annotations

from typing import Any, Final

from fwav_companion.acting import enums
from fwav_companion.acting.aim import target_ned
from fwav_companion.acting.options import ActOptions
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.geometry.vectors import larger_semi_axis
from fwav_companion.types.messages import Destination, Outgoing
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

INTERVAL_NS: Final = NS_PER_S // 5
"""Both autopilots' filters expect 2 to 10 Hz."""
OLDEST_LOOK_NS: Final = 2 * NS_PER_S


class Follow:
    """FOLLOW_TARGET of one selection."""

    def __init__(self, options: ActOptions) -> None:
        self._system, self._component = options.follow_system_id, options.companion_component
        self._most_m = options.follow_max_sigma_m
        self._due_ns: HostNs | None = None
        self.withheld: str | None = None
        """Why it is not sent now; None where it is."""

    def begin(self) -> None:
        """Start with a new selection. Frequent selections send no more often."""
        self.withheld = None

    def due(self, track: Track, situation: Situation) -> list[Outgoing]:
        """The message where it is due."""
        now, plane = situation.now_ns, situation.plane
        if self._due_ns is not None and now < self._due_ns:
            return []
        self._due_ns = HostNs(now + INTERVAL_NS)
        sigma_m = larger_semi_axis(track.cov)
        if plane is None:
            self.withheld = "no global position"
        elif not sigma_m <= self._most_m:
            self.withheld = "the target is too uncertain"
        elif now - track.last_seen_host_ns > OLDEST_LOOK_NS:
            self.withheld = "the target is out of sight"
        else:
            self.withheld = None
        if self.withheld is not None or plane is None:
            return []
        at, velocity = plane.geodetic_from_ned(target_ned(track, now)), track.velocity_ned
        fields: dict[str, Any] = {
            "timestamp": now // NS_PER_MS,
            "est_capabilities": enums.FOLLOW_POSITION | (0 if velocity is None else enums.FOLLOW_VELOCITY),
            "lat": round(at.lat_deg * 1e7),
            "lon": round(at.lon_deg * 1e7),
            "alt": at.alt_amsl_m,
            "vel": list(velocity or (0.0, 0.0, 0.0)),
            "acc": [0.0, 0.0, 0.0],
            "attitude_q": [1.0, 0.0, 0.0, 0.0],
            "rates": [0.0, 0.0, 0.0],
            "position_cov": [sigma_m, max(track.cov[2][2], 0.0) ** 0.5, 0.0],  # eph, epv by the definition
            "custom_state": 0,
        }
        return [
            Outgoing(
                name="FOLLOW_TARGET",
                fields=fields,
                to=Destination.AUTOPILOT,
                component=self._component,
                system=self._system,
            )
        ]
