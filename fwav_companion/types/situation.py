"""Who the autopilot is, and what publishing must know of the moment."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types.board import BoardReport
from fwav_companion.types.telemetry import ClockEstimate, VehicleState


class AutopilotKind(StrEnum):
    """By HEARTBEAT.autopilot."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"
    OTHER = "other"


class Autopilot(msgspec.Struct, frozen=True):
    """The one autopilot that was adopted."""

    system: int
    component: int
    kind: AutopilotKind
    vehicle_type: int
    """MAV_TYPE of its heartbeat."""
    armed: bool
    link: str
    """Where it was heard last."""


class Situation(msgspec.Struct, frozen=True, kw_only=True):
    """The moment at which something is published."""

    now_ns: HostNs
    autopilot: Autopilot | None
    plane: TangentPlane | None
    """None without a global position."""
    vehicle: VehicleState | None
    """The newest usable state; its instant is in it."""
    at_capture: VehicleState | None = None
    """At the capture of the frame that is published."""
    local_position_ned: Vector3 | None = None
    """The autopilot's own LOCAL_POSITION_NED at that capture: another frame than ours."""
    clock: ClockEstimate | None = None
    undulation_m: float | None = None
    """Geoid above ellipsoid, by GPS_RAW_INT's own alt_ellipsoid - alt."""
    utc_minus_host_s: float | None = None
    """From SYSTEM_TIME, else from a wall clock that is synchronised; None while neither tells UTC."""
    board: BoardReport | None = None
    """How our own board was doing lately; None until it has been looked at."""
