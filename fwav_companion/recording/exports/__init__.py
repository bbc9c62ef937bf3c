"""The targets of a flight for other people's tools: GeoJSON, KML, CSV. Pure: lines in, a file's bytes out."""

from __future__ import annotations

from pathlib import PurePath

from fwav_companion.errors import InputFileError
from fwav_companion.recording.exports.base import Export
from fwav_companion.recording.exports.comma_separated import CsvExport
from fwav_companion.recording.exports.geojson import GeoJsonExport
from fwav_companion.recording.exports.kml import KmlExport

__all__ = ["Export", "export_for"]

_BY_SUFFIX: dict[str, type[Export]] = {".geojson": GeoJsonExport, ".kml": KmlExport, ".csv": CsvExport}


def export_for(path: PurePath) -> Export:
    """The export that the file's name asks for. InputFileError names what is accepted."""
    form = _BY_SUFFIX.get(path.suffix.lower())
    if form is None:
        raise InputFileError(f"{path}: {path.suffix or 'no suffix'} stands there; accepted: {', '.join(_BY_SUFFIX)}")
    return form(path)
