"""GPX 1.1 for hand-held receivers: a waypoint for each target, and a track for each one that moves."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.recording.exports.base import SHARE, MapExport, utc_text

NAMESPACE = "http://www.topografix.com/GPX/1/1"


class GpxExport(MapExport):
    """One GPX document. Targets without a global position are left out."""

    def content(self) -> bytes:
        """The file after the last line; waypoints first, as the schema demands."""
        root = Element("gpx", xmlns=NAMESPACE, version="1.1", creator="fwav-companion")
        placed = [(name, track, at) for name, _, track in self.tracks() if (at := track.last.lat_lon) is not None]
        for name, track, (lat, lon) in placed:
            last = track.last
            point = SubElement(root, "wpt", lat=repr(lat), lon=repr(lon))
            if last.alt_amsl is not None:
                SubElement(point, "ele").text = f"{last.alt_amsl:.2f}"  # above mean sea level
            time = utc_text(last.time_unix)
            if time:
                SubElement(point, "time").text = time
            SubElement(point, "name").text = _printable(name)
            SubElement(point, "desc").text = f"{last.state}; within {circle_radius(last.cov, SHARE):.2f} m (95 %)"
        for name, track, _ in placed:
            if len(track.path) > 1:
                path = SubElement(root, "trk")
                SubElement(path, "name").text = _printable(name)
                segment = SubElement(path, "trkseg")
                for lat, lon in track.path:
                    SubElement(segment, "trkpt", lat=repr(lat), lon=repr(lon))
        indent(root)
        text: str = tostring(root, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _printable(text: str) -> str:
    """The text with "?" for control characters: XML 1.0 forbids most of them."""
    return "".join(c if c.isprintable() else "?" for c in text)
