"""The targets of the picture as GeoJSON, KML, CSV and Cursor on Target. Pure.

Radii and ellipses are 95 %, and their names say so; ``ce`` of Cursor on Target is one sigma, as its schema defines it.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from math import cos, nan, pi, radians, sin
from typing import Any
from xml.sax.saxutils import escape

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import ELLIPSE_95
from fwav_companion.ground.views import EllipseView, LatLon, TargetView, VehicleView
from fwav_companion.publishing.cot import MACHINE, UNKNOWN, MapEvent, clock_text

CORNERS = 48
"""Corners of an ellipse's polygon."""
COT_VEHICLE_STALE_S = 10.0
COT_TARGET_STALE_S = 3600.0
"""Validity of a target after its last look: a found person must not vanish from the searchers' map."""
GeoidHeight = Callable[[float, float], float]
"""(latitude, longitude), degrees -> height of the geoid above the ellipsoid, metres."""
CSV_COLUMNS = (
    "id", "vehicle", "track", "label", "state", "lat", "lon", "alt_amsl_m", "radius95_m", "ellipse95_major_m",
    "ellipse95_minor_m", "ellipse95_bearing_deg", "first_utc", "seen_utc", "source", "seen_by",
)  # fmt: skip


def outline(lat: float, lon: float, ellipse: EllipseView) -> list[LatLon]:
    """Corners of the 95 % ellipse, closed: the first is repeated at the end."""
    plane = TangentPlane(Geodetic.from_degrees(lat, lon, 0.0))
    bearing = radians(ellipse.bearing_deg)
    corners = []
    for corner in range(CORNERS + 1):
        angle = 2.0 * pi * (corner % CORNERS) / CORNERS
        along, across = ellipse.major_m * cos(angle), ellipse.minor_m * sin(angle)
        north = along * cos(bearing) - across * sin(bearing)
        east = along * sin(bearing) + across * cos(bearing)
        place = plane.geodetic_from_ned((north, east, 0.0))
        corners.append((place.lat_deg, place.lon_deg))
    return corners


def geojson(targets: Iterable[TargetView], vehicles: Iterable[VehicleView]) -> bytes:
    """A FeatureCollection (RFC 7946): points of vehicles and targets, polygons of the 95 % ellipses."""
    features: list[dict[str, Any]] = []
    for target in targets:
        properties = {"kind": "target", **_row(target)}
        features.append(_feature("Point", _position(target.lon, target.lat, target.alt_amsl), properties))
        if target.ellipse is not None:
            ring = [[lon, lat] for lat, lon in outline(target.lat, target.lon, target.ellipse)]
            counterclockwise = ring[::-1]  # RFC 7946, 3.1.6
            features.append(_feature("Polygon", [counterclockwise], {"kind": "ellipse95", "target": target.id}))
    for vehicle in vehicles:
        if vehicle.lat is not None and vehicle.lon is not None:
            properties = {"kind": "vehicle", "id": vehicle.id, "heading_deg": vehicle.heading_deg}
            properties |= {"heard_utc": _utc(vehicle.heard_unix), "placed_utc": _utc(_placed_unix(vehicle))}
            features.append(_feature("Point", _position(vehicle.lon, vehicle.lat, vehicle.alt_amsl), properties))
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


def kml(targets: Iterable[TargetView], vehicles: Iterable[VehicleView]) -> bytes:
    """A KML 2.2 document with the same content."""
    parts = ['<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>']
    parts.append("<name>fwav-companion</name>")
    for target in targets:
        name = _xml(f"{target.label or 'target'} {target.id}")
        said = _xml("; ".join(f"{key}: {value}" for key, value in _row(target).items() if value not in (None, "")))
        place = f"{target.lon:.8f},{target.lat:.8f},{target.alt_amsl or 0.0:.2f}"
        parts.append(f"<Placemark><name>{name}</name><description>{said}</description>")
        if target.ellipse is None:
            parts.append(f"<Point><coordinates>{place}</coordinates></Point></Placemark>")
            continue
        ring = " ".join(f"{lon:.8f},{lat:.8f}" for lat, lon in outline(target.lat, target.lon, target.ellipse)[::-1])
        parts.append(
            f"<MultiGeometry><Point><coordinates>{place}</coordinates></Point><Polygon><outerBoundaryIs><LinearRing>"
            f"<coordinates>{ring}</coordinates></LinearRing></outerBoundaryIs></Polygon></MultiGeometry></Placemark>"
        )
    for vehicle in vehicles:
        if vehicle.lat is not None and vehicle.lon is not None:
            place = f"{vehicle.lon:.8f},{vehicle.lat:.8f},{vehicle.alt_amsl or 0.0:.2f}"
            name = _xml(f"vehicle {vehicle.id}")
            when = f"<TimeStamp><when>{_utc(_placed_unix(vehicle))}</when></TimeStamp>"
            point = f"<Point><coordinates>{place}</coordinates></Point>"
            parts.append(f"<Placemark><name>{name}</name>{when}{point}</Placemark>")
    parts.append("</Document></kml>\n")
    return "".join(parts).encode()


def csv_table(targets: Iterable[TargetView]) -> bytes:
    """One row a target. A text that a spreadsheet would run as a formula gets an apostrophe."""
    lines = _Lines()
    writer = csv.writer(lines, lineterminator="\r\n")
    writer.writerow(CSV_COLUMNS)
    for target in targets:
        row = _row(target)
        writer.writerow([_inert(row[column]) for column in CSV_COLUMNS])
    return "".join(lines.written).encode()


def cot_events(
    targets: Iterable[TargetView],
    utc_ns: int,
    unit: str,
    *,
    vehicles: Iterable[VehicleView] = (),
    geoid: GeoidHeight | None = None,
    now_unix: float | None = None,
) -> list[bytes]:
    """One event a vehicle and a target whose place is not stale. ``unit``: name of this machine, for the uids.

    ``now_unix``: time of the picture, in which ``seen_unix`` counts; None: UTC.
    """
    now = utc_ns / 1e9 if now_unix is None else now_unix
    events = []
    for vehicle in vehicles:
        age_s = max(0.0, now - _placed_unix(vehicle))
        if vehicle.lat is not None and age_s < COT_VEHICLE_STALE_S:  # its time is that of its place
            events.append(_vehicle_event(vehicle, utc_ns - round(age_s * 1e9), unit, geoid))
    for target in targets:
        left_s = COT_TARGET_STALE_S - max(0.0, now - target.seen_unix)
        if left_s > 0.0 and target.state not in ("tentative", "dropped"):
            events.append(_target_event(target, utc_ns, unit, geoid, left_s))
    return [event.as_xml().encode() for event in events]


def _placed_unix(vehicle: VehicleView) -> float:
    """Instant of the vehicle's place, which may be much older than its last message."""
    return vehicle.heard.get("position", vehicle.heard_unix)


def _vehicle_event(vehicle: VehicleView, utc_ns: int, unit: str, geoid: GeoidHeight | None) -> MapEvent:
    lat, lon = vehicle.lat or 0.0, vehicle.lon or 0.0
    track = {"course": vehicle.heading_deg, "speed": vehicle.speed_m_s}
    known = {name: f"{value:.1f}" for name, value in track.items() if value is not None}
    return MapEvent(
        uid=f"fwav-companion.{unit}.ground.vehicle.{vehicle.id}",
        kind="a-f-A-M",
        how=MACHINE,
        utc_ns=utc_ns,
        stale_s=COT_VEHICLE_STALE_S,
        lat_deg=lat,
        lon_deg=lon,
        hae_m=_hae_m(lat, lon, vehicle.alt_amsl, geoid),
        callsign=f"UAV {vehicle.id}",
        details=(("track", known),) if len(known) == len(track) else (),
    )


def _target_event(target: TargetView, utc_ns: int, unit: str, geoid: GeoidHeight | None, stale_s: float) -> MapEvent:
    seen_utc_ns = utc_ns - round((COT_TARGET_STALE_S - stale_s) * 1e9)
    radius = "accuracy unknown" if target.radius95_m is None else f"within {target.radius95_m:.1f} m (95 %)"
    return MapEvent(
        uid=f"fwav-companion.{unit}.ground.{target.id}",
        kind="a-u-G",
        utc_ns=utc_ns,
        stale_s=stale_s,
        lat_deg=target.lat,
        lon_deg=target.lon,
        hae_m=_hae_m(target.lat, target.lon, target.alt_amsl, geoid),
        horizontal_sigma_m=nan if target.ellipse is None else target.ellipse.major_m / ELLIPSE_95,
        vertical_sigma_m=nan,
        callsign=f"{target.label or 'target'} {target.id}",
        remarks=f"last seen {clock_text(seen_utc_ns)} UTC; {radius}; {target.source}, {target.state}; ce is one sigma",
    )


def _hae_m(lat: float, lon: float, alt_amsl_m: float | None, geoid: GeoidHeight | None) -> float:
    """Height above the ellipsoid: the vehicles' height above mean sea level plus the geoid's; unknown without both."""
    return UNKNOWN if alt_amsl_m is None or geoid is None else alt_amsl_m + geoid(lat, lon)


def one_document(events: Sequence[bytes]) -> bytes:
    """All events in one XML document, for a file."""
    bodies = [event.partition(b"?>")[2] for event in events]
    return b'<?xml version="1.0" encoding="UTF-8"?>\n<events>' + b"".join(bodies) + b"</events>\n"


class _Lines:
    """The text file that csv.writer writes to."""

    def __init__(self) -> None:
        self.written: list[str] = []

    def write(self, text: str) -> None:
        """Append a line."""
        self.written.append(text)


def _row(target: TargetView) -> dict[str, Any]:
    ellipse = target.ellipse
    return {
        "id": target.id,
        "vehicle": target.vehicle,
        "track": target.track,
        "label": target.label,
        "state": target.state,
        "lat": round(target.lat, 8),
        "lon": round(target.lon, 8),
        "alt_amsl_m": _rounded(target.alt_amsl),
        "radius95_m": _rounded(target.radius95_m),
        "ellipse95_major_m": None if ellipse is None else _rounded(ellipse.major_m),
        "ellipse95_minor_m": None if ellipse is None else _rounded(ellipse.minor_m),
        "ellipse95_bearing_deg": None if ellipse is None else round(ellipse.bearing_deg, 1),
        "first_utc": _utc(target.first_unix),
        "seen_utc": _utc(target.seen_unix),
        "source": target.source,
        "seen_by": " ".join(f"{vehicle}:{track}" for vehicle, track in target.vehicles.items()),
    }


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def _position(lon: float, lat: float, alt: float | None) -> list[float]:
    return [lon, lat] if alt is None else [lon, lat, round(alt, 3)]


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


def _utc(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _xml(text: str) -> str:
    """Escaped text; spaces for characters that XML 1.0 does not allow: labels and names come from strangers."""
    return escape("".join(character if character.isprintable() else " " for character in text))


def _inert(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t") else value
