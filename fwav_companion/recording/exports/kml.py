"""KML 2.2 for Google Earth: for each target a pin, its 95 % ellipse on the ground, and its path if it moves."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.recording.exports.base import SHARE, ExportedTrack, MapExport, ellipse95, utc_text
from fwav_companion.recording.line_types import TargetLine

NAMESPACE = "http://www.opengis.net/kml/2.2"
LINE_COLOUR, FILL_COLOUR = "ff0000ff", "400000ff"
"""Red, opaque and a quarter opaque; KML's order is alpha, blue, green, red."""


class KmlExport(MapExport):
    """One KML document. Targets without a global position cannot be drawn and are left out."""

    def content(self) -> bytes:
        """The file after the last line."""
        root = Element("kml", xmlns=NAMESPACE)
        document = SubElement(root, "Document")
        _text(document, "name", "fwav-companion targets")
        _style(document)
        for name, number, track in self.tracks():
            if track.last.lat_lon is not None:
                self._folder(document, _printable(name), track, self.picture_of(number))
        indent(root)
        text: str = tostring(root, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()

    def picture_of(self, _track: int) -> str:
        """The address of a track's picture; "": none."""
        return ""

    def _folder(self, document: Element, name: str, track: ExportedTrack, picture: str) -> None:
        last = track.last
        folder = SubElement(document, "Folder")
        _text(folder, "name", name)
        pin = _placemark(folder, name)
        _text(pin, "description", _description(last) + (f'<br/><img src="{picture}" width="480"/>' if picture else ""))
        time = utc_text(last.time_unix)
        if time:
            _text(SubElement(pin, "TimeStamp"), "when", time)
        _coordinates(SubElement(pin, "Point"), [] if last.lat_lon is None else [last.lat_lon])
        outline = self.outline(last)
        if outline:
            polygon = SubElement(_placemark(folder, f"{name}: 95 % ellipse", styled=True), "Polygon")
            ring = SubElement(SubElement(polygon, "outerBoundaryIs"), "LinearRing")
            _coordinates(ring, outline)
        if len(track.path) > 1:
            _coordinates(SubElement(_placemark(folder, f"{name}: path", styled=True), "LineString"), track.path)


def _placemark(folder: Element, name: str, *, styled: bool = False) -> Element:
    placemark = SubElement(folder, "Placemark")
    _text(placemark, "name", name)
    if styled:
        _text(placemark, "styleUrl", "#error")
    return placemark


def _style(document: Element) -> None:
    style = SubElement(document, "Style", id="error")
    line = SubElement(style, "LineStyle")
    _text(line, "color", LINE_COLOUR)
    _text(line, "width", "2")
    _text(SubElement(style, "PolyStyle"), "color", FILL_COLOUR)


def _description(line: TargetLine) -> str:
    ellipse = ellipse95(line.cov)
    height = f"{line.alt_amsl:.1f} m AMSL" if line.alt_amsl is not None else ""
    height = height or f"{line.alt_takeoff or 0.0:+.1f} m from the take-off"
    return (
        f"{line.state}; within {circle_radius(line.cov, SHARE):.2f} m (95 %); semi-axes of the 95 % ellipse "
        f"{ellipse.major_m:.2f} m and {ellipse.minor_m:.2f} m, the longer one to {ellipse.bearing_deg:.0f} deg; "
        f"{height}"
    )


def _coordinates(parent: Element, places: Iterable[tuple[float, float]]) -> None:
    """Add the places, longitude first; without a height Google Earth puts them on its ground."""
    _text(parent, "coordinates", " ".join(f"{lon!r},{lat!r}" for lat, lon in places))


def _text(parent: Element, name: str, text: str) -> None:
    SubElement(parent, name).text = text


def _printable(text: str) -> str:
    """The text with "?" for control characters: labels come from a detector, and XML 1.0 forbids most of them."""
    return "".join(c if c.isprintable() else "?" for c in text)
