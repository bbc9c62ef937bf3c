"""GeoJSON (RFC 7946): a point a target, its 90 % ellipse, and the path of what moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from fwav_companion.recording.exports.base import MapExport, TargetTrack, ellipse_from_cov, utc_text
from fwav_companion.recording.lines import Line


class GeoJsonExport(MapExport):
    """Heights are properties: RFC 7946 has ellipsoid heights, and ours are above mean sea level."""

    def content(self) -> bytes:
        """One FeatureCollection."""
        features = [feature for number, track in self.tracks() for feature in self._features(number, track)]
        return msgspec.json.format(msgspec.json.encode({"type": "FeatureCollection", "features": features}), indent=1)

    def _features(self, number: int, track: TargetTrack) -> Iterator[Line]:
        last = track.last
        # A target without a global position has no geometry; its place from below the camera is in its properties.
        point = None if last["lat"] is None else {"type": "Point", "coordinates": [last["lon"], last["lat"]]}
        yield _feature(point, {"track": number, "what": "target", **_properties(last)})
        outline = self.outline(last)
        if outline:
            shape = {"type": "Polygon", "coordinates": [_places(outline)]}
            yield _feature(shape, {"track": number, "what": "holds the target with 90 % probability"})
        if len(track.path) > 1:
            way = {"type": "LineString", "coordinates": _places(track.path)}
            yield _feature(way, {"track": number, "what": "path"})


def _places(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Longitude first."""
    return [(lon, lat) for lat, lon in points]


def _feature(geometry: Line | None, properties: Line) -> Line:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _properties(line: Line) -> dict[str, Any]:
    ellipse = ellipse_from_cov(line["cov"])
    return {
        "label": line["label"],
        "state": line["state"],
        "time": utc_text(line["time_unix"]),
        "alt_amsl": line["alt_amsl"],
        "north": line["north"],
        "east": line["east"],
        "down": line["down"],
        "sigma_major_m": ellipse.major_m,
        "sigma_minor_m": ellipse.minor_m,
        "sigma_bearing_deg": ellipse.bearing_deg,
    }
