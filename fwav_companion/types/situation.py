"""The adopted autopilot, and the state of the vehicle at the moment of publishing."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from functools import cached_property

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.types.board import BoardReport
from fwav_companion.types.telemetry import ClockEstimate, VehicleState

OLDEST_NS = 5 * NS_PER_S
"""Age from which a vehicle's state is no longer its present one: five missed heartbeats, as for its silence."""


class AutopilotKind(StrEnum):
    """Firmware of the autopilot, by HEARTBEAT.autopilot."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"
    OTHER = "other"


class Autopilot(msgspec.Struct, frozen=True):
    """The adopted autopilot."""

    system: int
    component: int
    kind: AutopilotKind
    vehicle_type: int
    """MAV_TYPE of the heartbeat."""
    armed: bool
    link: str
    """Name of the link on which the last heartbeat arrived."""

    @property
    def our_system(self) -> int:
        """System id that this service sends with: the vehicle's, or 1 where the vehicle's is 0, the address of all."""
        return self.system or 1


class Situation(msgspec.Struct, frozen=True, kw_only=True, dict=True):
    """State of vehicle and clocks at the moment of publishing; rarely needed values are computed on demand."""

    now_ns: HostNs
    autopilot: Autopilot | None
    plane: TangentPlane | None
    """Local tangent plane; None without a global position."""
    newest_state: Callable[[], VehicleState | None]
    """Computes :attr:`vehicle`."""
    clock_estimate: Callable[[], ClockEstimate | None] = lambda: None
    """Computes :attr:`clock`."""
    undulation_m: float | None = None
    """Geoid height above the ellipsoid, metres: alt_ellipsoid - alt of GPS_RAW_INT."""
    utc_minus_host_s: float | None = None
    """UTC minus host clock, seconds, from SYSTEM_TIME, else from a synchronised wall clock; None without either."""
    autopilot_age_s: float | None = None
    """Seconds since the last heartbeat of the adopted autopilot; None before the first."""
    frame_age_s: float | None = None
    """Seconds since the newest frame of detections arrived; None before the first."""
    board: BoardReport | None = None
    """Latest report of the companion computer; None before the first."""

    @cached_property
    def vehicle(self) -> VehicleState | None:
        """Newest usable state of the vehicle."""
        return self.newest_state()

    @cached_property
    def recent_vehicle(self) -> VehicleState | None:
        """The vehicle's state, unless it is so old that the vehicle may be elsewhere."""
        state = self.vehicle
        return None if state is None or self.now_ns - self.host_ns_of(state) > OLDEST_NS else state

    @cached_property
    def clock(self) -> ClockEstimate | None:
        """Estimate of the autopilot's clock now."""
        return self.clock_estimate()

    def host_ns_of(self, state: VehicleState) -> HostNs:
        """Instant of a vehicle's state on the host clock, never in the future."""
        if self.clock is None:
            return self.now_ns
        return min(self.now_ns, HostNs(state.boot_ns + self.clock.host_from_autopilot_ns))
