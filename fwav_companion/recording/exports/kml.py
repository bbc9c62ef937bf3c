"""KML 2.2 for Google Earth: a pin a target, its 90 % ellipse on the ground, and the path of what moves."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fwav_companion.recording.exports.base import MapExport, TargetTrack, ellipse_from_cov, utc_text
from fwav_companion.recording.lines import Line

NAMESPACE = "http://www.opengis.net/kml/2.2"
LINE_COLOUR, FILL_COLOUR = "ff0000ff", "400000ff"
"""Red, opaque and a quarter: KML has alpha, blue, green, red."""


class KmlExport(MapExport):
    """Targets without a global position cannot be drawn, and are left out."""

    def content(self) -> bytes:
        """One document."""
        root = Element("kml", xmlns=NAMESPACE)
        document = SubElement(root, "Document")
        _text(document, "name", "fwav-companion targets")
        _style(document)
        for number, track in self.tracks():
            if track.last["lat"] is not None:
                self._folder(document, number, track)
        indent(root)
        text: str = tostring(root, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()

    def _folder(self, document: Element, number: int, track: TargetTrack) -> None:
        last = track.last
        name = _printable(f"{last['label'] or 'target'} {number}")
        folder = SubElement(document, "Folder")
        _text(folder, "name", name)
        pin = _placemark(folder, name)
        _text(pin, "description", _description(last))
        time = utc_text(last["time_unix"])
        if time:
            _text(SubElement(pin, "TimeStamp"), "when", time)
        _coordinates(SubElement(pin, "Point"), [(last["lat"], last["lon"])])
        outline = self.outline(last)
        if outline:
            polygon = SubElement(_placemark(folder, "90 %", styled=True), "Polygon")
            ring = SubElement(SubElement(polygon, "outerBoundaryIs"), "LinearRing")
            _coordinates(ring, outline)
        if len(track.path) > 1:
            _coordinates(SubElement(_placemark(folder, "path", styled=True), "LineString"), track.path)


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


def _description(line: Line) -> str:
    ellipse = ellipse_from_cov(line["cov"])
    return (
        f"{line['state']}; one sigma {ellipse.major_m:.2f} m by {ellipse.minor_m:.2f} m, the longer axis to "
        f"{ellipse.bearing_deg:.0f} deg; {line['alt_amsl']:.1f} m AMSL"
    )


def _coordinates(parent: Element, places: Iterable[tuple[float, float]]) -> None:
    """Longitude first; without a height they lie on the ground as Google Earth has it."""
    _text(parent, "coordinates", " ".join(f"{lon!r},{lat!r}" for lat, lon in places))


def _text(parent: Element, name: str, text: str) -> None:
    SubElement(parent, name).text = text


def _printable(text: str) -> str:
    """Labels are a detector's: XML 1.0 forbids most control characters, escaped or not."""
    return "".join(c if c.isprintable() else "?" for c in text)
