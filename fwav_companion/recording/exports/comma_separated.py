"""CSV for spreadsheets and notebooks: a row for every line of every target."""

from __future__ import annotations

import csv
import io
from pathlib import PurePath
from typing import Any

from fwav_companion.recording.exports.base import Export, ellipse_from_cov, utc_text
from fwav_companion.recording.lines import Line

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
    *("utc", *COPIED, "reason", "sigma_major_m", "sigma_minor_m", "sigma_bearing_deg", "sigma_down_m"),
    *("vel_north", "vel_east", "vel_down", "fix_north", "fix_east", "fix_down"),
)


class CsvExport(Export):
    """What is null is an empty field."""

    def __init__(self, path: PurePath) -> None:
        super().__init__(path)
        self._text = io.StringIO(newline="")
        self._writer = csv.writer(self._text, lineterminator="\r\n")  # RFC 4180
        self._writer.writerow(COLUMNS)

    def add(self, line: Line) -> None:
        """A row, if it is a target's."""
        if line["type"] == "target":
            self._writer.writerow(_row(line))

    def content(self) -> bytes:
        """The table, UTF-8."""
        return self._text.getvalue().encode()


def _row(line: Line) -> list[Any]:
    ellipse, fix = ellipse_from_cov(line["cov"]), line["fix"]
    return [
        utc_text(line["time_unix"]),
        *(_harmless(line[name]) for name in COPIED),
        line.get("reason"),
        ellipse.major_m,
        ellipse.minor_m,
        ellipse.bearing_deg,
        max(0.0, line["cov"][2][2]) ** 0.5,
        *(line["vel"] or (None, None, None)),
        *((fix["north"], fix["east"], fix["down"]) if fix else (None, None, None)),
    ]


def _harmless(value: Any) -> Any:
    """A label is a detector's: a spreadsheet would run what begins as a formula does."""
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r") else value
