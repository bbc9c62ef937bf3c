"""Plain structs for the page, the exports and the recording, encoded as JSON. Pure.

Angles are degrees, lengths metres, instants Unix seconds of this process. Unknown is null.
"""

from __future__ import annotations

import msgspec

MAX_VEHICLES = 200
"""Most vehicles of a picture, and of each input to it."""
LatLon = tuple[float, float]
"""Latitude and longitude, degrees."""
MOST_ALTITUDE_M = 1e5
MOST_RADIUS_M = 1e6
"""Largest radius of a 95 % circle that is shown: beyond it nothing is known of the place."""
OLDEST_S = 1e9
MAX_LABEL = 64
"""Most characters of a label, as in the fleet's messages."""


class EllipseView(msgspec.Struct, frozen=True):
    """Horizontal ellipse that holds the target with a probability of 95 %."""

    major_m: float
    """Larger semi-axis, metres."""
    minor_m: float
    """Smaller semi-axis, metres."""
    bearing_deg: float
    """Direction of the larger semi-axis from north, clockwise."""


class LocalTargetView(msgspec.Struct, frozen=True, kw_only=True):
    """One target in its vehicle's local world."""

    id: str
    """Unique in the picture."""
    track: str
    """Track number at that vehicle."""
    label: str = ""
    state: str
    """As of a :class:`TargetView`."""
    north_m: float
    """From the world's zero; the other axes alike."""
    east_m: float
    down_m: float
    ellipse: EllipseView
    radius95_m: float
    """Radius of the 95 % circle."""
    first_unix: float
    seen_unix: float
    """Instant of its last fix."""


class VehicleView(msgspec.Struct, frozen=True, kw_only=True):
    """One vehicle."""

    id: str
    """MAVLink system id, or the vehicle's name in the fleet."""
    revision: int = 0
    """Revision of the picture with the last change of this entry."""
    kind: str = ""
    """Firmware and type, for example "ArduPilot copter"."""
    number: int = 0
    """Number in the order of appearance, which gives the vehicle its colour."""
    heard_unix: float
    """Instant of the last message."""
    heard: dict[str, float] = {}
    """Instant of the newest evidence by part (autopilot, companion, camera, detector) and by value (position, local,
    attitude, battery, gps, readiness), as measured: a message that repeats an old value does not renew it."""
    quiet: dict[str, float] = {}
    """Parts that are silent, with the instant since which they are."""
    silent: bool = False
    """Whether every part is silent."""
    lat: float | None = None
    lon: float | None = None
    alt_amsl: float | None = None
    local_ned: tuple[float, float, float] | None = None
    """Place in its local world, metres from that world's zero; None: its companion's world is none, or has a place on
    the earth."""
    local_targets: tuple[LocalTargetView, ...] = ()
    """Targets in that world. A target of the picture has a place on the earth, which exports and maps rely on."""
    height_m: float | None = None
    """Height above home."""
    roll_deg: float | None = None
    pitch_deg: float | None = None
    heading_deg: float | None = None
    speed_m_s: float | None = None
    """Horizontal speed."""
    armed: bool | None = None
    battery_v: float | None = None
    battery_percent: int | None = None
    gps: str | None = None
    """Kind of the GNSS fix, with the number of satellites."""
    companion: str | None = None
    """State of the companion by its newest report, "healthy" or "trouble"; None: never heard."""
    ready: bool | None = None
    """Whether it can localize targets, by its own report; None: not reported, or not since a part that it needs fell
    silent."""
    ready_unix: float | None = None
    """Instant since which this is so."""
    readiness: str | None = None
    """Text of the newest readiness report."""
    contradicted: str = ""
    """What contradicts the accuracy that this vehicle claims; "": nothing that is known."""
    contradicted_unix: float | None = None
    """Instant since which it is contradicted."""
    checks: tuple[str, ...] = ()
    """Findings of `check` from the status file, worst first."""
    footprint: tuple[LatLon, ...] = ()
    """Corners of the camera's footprint on the ground; empty if not known."""


class TargetView(msgspec.Struct, frozen=True, kw_only=True):
    """One target."""

    id: str
    revision: int = 0
    vehicle: str
    """Vehicle that reports it; "fleet" for a fused target."""
    track: str = ""
    """Track number at that vehicle."""
    label: str = ""
    state: str
    """confirmed | coasting | tentative | selected | reported (by a text) | lost | dropped."""
    lat: float
    lon: float
    alt_amsl: float | None = None
    ellipse: EllipseView | None = None
    radius95_m: float | None = None
    """Radius of the 95 % circle."""
    contradicted: str = ""
    """What contradicts its claimed accuracy; "": nothing that is known."""
    contradicted_unix: float | None = None
    """Instant since which it is contradicted."""
    bound: bool = False
    """Whether ellipse and radius are upper bounds: the message carried only the larger semi-axis."""
    first_unix: float
    seen_unix: float
    """Instant of its last fix, as far as the input reports it; else of its last report."""
    source: str
    """mavlink | text | status | fleet | fused | recording."""
    vehicles: dict[str, str] = {}
    """For a fused target: track number by vehicle."""
    left_out: dict[str, str] = {}
    """For a fused target: the reason why a vehicle is left out, by vehicle."""


class TextView(msgspec.Struct, frozen=True, kw_only=True):
    """One text for people."""

    revision: int
    time_unix: float
    vehicle: str
    severity: int
    """MAV_SEVERITY: 0 emergency to 7 debug."""
    text: str


class SourceView(msgspec.Struct, frozen=True, kw_only=True):
    """One input of the ground process: a link, a file, the fleet's bus, a recording."""

    name: str
    works: bool
    text: str
    """State, and the remedy if it does not work."""


class PictureUpdate(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that changed after a revision of the picture; the whole picture after revision 0."""

    revision: int
    whole: bool
    """Whether this is the whole picture: entries that are not in it no longer exist."""
    now_unix: float
    """Time of the picture: the clock of this process, or of the recording that is replayed."""
    vehicles: list[VehicleView]
    targets: list[TargetView]
    removed: list[str]
    """Ids of targets that are gone."""
    texts: list[TextView]
    sources: list[SourceView]


class PastPoint(msgspec.Struct, frozen=True, array_like=True):
    """One earlier state of a target or place of a vehicle."""

    time_unix: float
    lat: float
    lon: float
    radius95_m: float | None = None


def is_place(lat: float | None, lon: float | None, alt_amsl: float | None) -> bool:
    """Whether a place is one on the earth, or is not known. Strangers and damaged frames send any number."""
    if lat is None or lon is None:
        return True
    return abs(lat) <= 90.0 and abs(lon) <= 180.0 and (alt_amsl is None or abs(alt_amsl) <= MOST_ALTITUDE_M)


def within_range(target: TargetView, now: float) -> TargetView:
    """The target with instants that are not in the future, a short label, and a radius that shows something."""
    radius = target.radius95_m
    known = radius is not None and 0.0 <= radius <= MOST_RADIUS_M
    return msgspec.structs.replace(
        target,
        label=target.label[:MAX_LABEL],
        ellipse=target.ellipse if known else None,
        radius95_m=radius if known else None,
        first_unix=min(max(target.first_unix, now - OLDEST_S), now),
        seen_unix=min(max(target.seen_unix, now - OLDEST_S), now),
    )
