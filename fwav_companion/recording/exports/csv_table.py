"""CSV for spreadsheets and notebooks: one row per target line."""

from __future__ import annotations

import csv
import io
from pathlib import PurePath
from typing import Any

from fwav_companion.geometry.ellipses import NORMAL_95
from fwav_companion.recording.exports.base import Export, ellipse95, utc_text
from fwav_companion.recording.labels import display_name
from fwav_companion.recording.line_types import Line, TargetLine

COPIED = (
    "time_unix",
    "time_boot",
    "frame",
    "track",
    "label",
    "state",
    "north",
    "east",
    "down",
    "lat",
    "lon",
    "alt_amsl",
)
COLUMNS = (
    *("utc", "target", *COPIED, "reason"),
    *("ellipse95_major_m", "ellipse95_minor_m", "ellipse95_bearing_deg", "down95_m"),
    *("vel_north", "vel_east", "vel_down", "fix_north", "fix_east", "fix_down"),
)
"""Names of the columns. ``ellipse95``: semi-axes and bearing of the 95 % ellipse; ``down95_m``: half the vertical 95 %
interval."""


class CsvExport(Export):
    """A CSV table of the target lines; null is an empty field."""

    def __init__(self, path: PurePath) -> None:
        super().__init__(path)
        self._text = io.StringIO(newline="")
        self._writer = csv.writer(self._text, lineterminator="\r\n")  # RFC 4180
        self._writer.writerow(COLUMNS)

    def add(self, line: Line) -> None:
        """Add a row for a target line."""
        if isinstance(line, TargetLine):
            self._writer.writerow(_row(line))

    def content(self) -> bytes:
        """The table, UTF-8."""
        return self._text.getvalue().encode()


def _row(line: TargetLine) -> list[Any]:
    ellipse, fix = ellipse95(line.cov), line.fix
    return [
        utc_text(line.time_unix),
        _harmless(display_name(line.label)),
        *(_harmless(getattr(line, name)) for name in COPIED),
        line.reason,
        ellipse.major_m,
        ellipse.minor_m,
        ellipse.bearing_deg,
        NORMAL_95 * max(0.0, line.cov[2][2]) ** 0.5,
        *(line.vel or (None, None, None)),
        *((fix.north, fix.east, fix.down) if fix else (None, None, None)),
    ]


def _harmless(value: Any) -> Any:
    """The value with a leading quote where a spreadsheet would run it as a formula: labels come from a detector."""
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r", "\n") else value
