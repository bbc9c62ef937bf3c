"""Exports of a flight's targets: GeoJSON, KML, KMZ, CSV, GPX; ``mcap_file`` for viewers. Lines in, a file's bytes out.

Names are those of the report ("tag 19"). Every uncertainty is a 95 % interval or ellipse.
"""

from __future__ import annotations

from pathlib import PurePath

from fwav_companion.errors import InputFileError
from fwav_companion.recording.exports.base import Export
from fwav_companion.recording.exports.csv_table import CsvExport
from fwav_companion.recording.exports.geojson import GeoJsonExport
from fwav_companion.recording.exports.gpx import GpxExport
from fwav_companion.recording.exports.kml import KmlExport
from fwav_companion.recording.exports.kmz import KmzExport

__all__ = ["Export", "export_for"]

_BY_SUFFIX: dict[str, type[Export]] = {
    ".geojson": GeoJsonExport,
    ".kml": KmlExport,
    ".csv": CsvExport,
    ".gpx": GpxExport,
    ".kmz": KmzExport,
}


def export_for(path: PurePath) -> Export:
    """The export in the format of the file's suffix. InputFileError names what is accepted."""
    form = _BY_SUFFIX.get(path.suffix.lower())
    if form is None:
        suffix = f"suffix {path.suffix}" if path.suffix else "no suffix"
        raise InputFileError(f"{path}: {suffix}; accepted: {', '.join(_BY_SUFFIX)}")
    return form(path)
