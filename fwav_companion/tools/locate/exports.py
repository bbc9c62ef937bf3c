"""PlaceAnswers as KML, GeoJSON or CSV, each with the datum of its altitudes. PURE."""

from __future__ import annotations

import csv
import io
from pathlib import PurePath
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.tools.locate.answers import PlaceAnswer, PlaceAnswers, answer_lines

COLUMNS = (
    "label", "lat", "lon", "alt_amsl", "alt_takeoff", "alt_hae", "alt_datum", "mgrs", "utm", "ellipse95_major_m",
    "ellipse95_minor_m", "ellipse95_bearing_deg", "radius95_m", "height95_m", "dominant",
)  # fmt: skip


def exported(answers: PlaceAnswers, path: PurePath) -> bytes:
    """The content of a file by its suffix. InputFileError names the accepted ones."""
    writers = {".kml": _kml, ".geojson": _geojson, ".json": _geojson, ".csv": _csv}
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise InputFileError(f"{path}: its suffix is {path.suffix or 'missing'}; accepted: .kml, .geojson, .csv")
    return writer(answers)


def _csv(answers: PlaceAnswers) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, restval="", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(msgspec.structs.asdict(answer) for answer in answers.targets)
    return text.getvalue().encode()


def _geojson(answers: PlaceAnswers) -> bytes:
    """RFC 7946: the third coordinate is the height above the ellipsoid, left out where it is not known."""
    features: list[dict[str, Any]] = []
    for answer in answers.targets:
        point = [answer.lon, answer.lat] + ([] if answer.alt_hae is None else [answer.alt_hae])
        properties = {name: value for name, value in msgspec.structs.asdict(answer).items() if name != "outline"}
        features.append(_feature({"type": "Point", "coordinates": point}, properties))
        ring = [[lon, lat] for lat, lon in reversed([*answer.outline, answer.outline[0]])]
        holds = {"label": answer.label, "what": "holds the target with 95 % probability"}
        features.append(_feature({"type": "Polygon", "coordinates": [ring]}, holds))
    document = {"type": "FeatureCollection", "features": features, "assumed": [*answers.assumed, *answers.doubts]}
    return msgspec.json.format(msgspec.json.encode(document), indent=1)


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _kml(answers: PlaceAnswers) -> bytes:
    """KML 2.2: altitudes above EGM96 as "absolute"; above the take-off as "relativeToGround"."""
    root = Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = SubElement(root, "Document")
    for answer in answers.targets:
        folder = SubElement(document, "Folder")
        label = "".join(c if c.isprintable() else "?" for c in answer.label)
        pin = _named(folder, label)
        SubElement(pin, "description").text = "\n".join([*answer_lines(answer), *answers.assumed, *answers.doubts])
        point = SubElement(pin, "Point")
        mode, height = _altitude(answer)
        SubElement(point, "altitudeMode").text = mode
        SubElement(point, "coordinates").text = f"{answer.lon!r},{answer.lat!r},{height:.3f}"
        ring = SubElement(
            SubElement(SubElement(_named(folder, f"{label}: 95 % ellipse"), "Polygon"), "outerBoundaryIs"), "LinearRing"
        )
        closed = reversed([*answer.outline, answer.outline[0]])
        SubElement(ring, "coordinates").text = " ".join(f"{lon!r},{lat!r}" for lat, lon in closed)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _altitude(answer: PlaceAnswer) -> tuple[str, float]:
    if answer.alt_amsl is not None:
        return "absolute", answer.alt_amsl
    return "relativeToGround", answer.alt_takeoff or 0.0


def _named(folder: Element, name: str) -> Element:
    placemark = SubElement(folder, "Placemark")
    SubElement(placemark, "name").text = name
    return placemark
