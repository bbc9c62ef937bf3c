"""GeoJSON (RFC 7946): for each target a point, its 95 % ellipse, and its path if it moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.recording.exports.base import SHARE, ExportedTrack, MapExport, ellipse95, utc_text
from fwav_companion.recording.line_types import TargetLine

JsonObject = dict[str, Any]


class GeoJsonExport(MapExport):
    """One FeatureCollection. Heights are properties: RFC 7946 has ellipsoid heights, these are above mean sea level."""

    def content(self) -> bytes:
        """The file after the last line."""
        features = [feature for name, number, track in self.tracks() for feature in self._features(name, number, track)]
        return msgspec.json.format(msgspec.json.encode({"type": "FeatureCollection", "features": features}), indent=1)

    def _features(self, name: str, number: int, track: ExportedTrack) -> Iterator[JsonObject]:
        last, known = track.last, {"name": name, "track": number}
        # A target without a global position has no geometry; its place from the point below the camera is a property.
        point = None if last.lat_lon is None else {"type": "Point", "coordinates": last.lat_lon[::-1]}
        yield _feature(point, {**known, "what": "target", **_properties(last)})
        outline = self.outline(last)
        if outline:
            shape = {"type": "Polygon", "coordinates": [_coordinates(outline)]}
            yield _feature(shape, {**known, "what": "holds the target with 95 % probability"})
        if len(track.path) > 1:
            path = {"type": "LineString", "coordinates": _coordinates(track.path)}
            yield _feature(path, {**known, "what": "path"})


def _coordinates(points: Iterable[tuple[float, float]]) -> list[list[float]]:
    """Longitude first."""
    return [[lon, lat] for lat, lon in points]


def _feature(geometry: JsonObject | None, properties: JsonObject) -> JsonObject:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _properties(line: TargetLine) -> JsonObject:
    ellipse = ellipse95(line.cov)
    return {
        "label": line.label,
        "state": line.state,
        "time": utc_text(line.time_unix),
        "alt_amsl": line.alt_amsl,
        **({} if line.alt_takeoff is None else {"alt_takeoff": line.alt_takeoff}),
        "north": line.north,
        "east": line.east,
        "down": line.down,
        "radius95_m": circle_radius(line.cov, SHARE),
        "ellipse95_major_m": ellipse.major_m,
        "ellipse95_minor_m": ellipse.minor_m,
        "ellipse95_bearing_deg": ellipse.bearing_deg,
    }
