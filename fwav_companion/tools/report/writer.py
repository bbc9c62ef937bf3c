"""SHELL: writes report.html of a replay, and compare.html of two targets files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.config import Config
from fwav_companion.errors import InputFileError
from fwav_companion.libraries import is_installed
from fwav_companion.on_disk import open_regular, write_page
from fwav_companion.recording.line_decoder import LinesRead, read_lines
from fwav_companion.recording.line_types import CalibrationLine, HeaderLine, Line, SightingLine, TargetLine, header_of
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import (
    VARIANTS,
    FlightData,
    RecordedMessages,
    ReplayedLines,
    comparison,
    diagnostics,
    flight_data,
    page,
    variant_of,
)
from fwav_companion.tools.report.comparison import ConfigDifference

VARIANT_LINES = (TargetLine, CalibrationLine)
"""Types of the lines that a report draws of another variant."""


def other_variants(config: Config, replayed: Callable[[str, Config], Iterator[Line]]) -> list[ReplayedLines]:
    """The recording in each variant that the configuration is not; ``replayed(name, config)`` runs one replay.

    Self-calibration needs numpy: a board without it gets a report without that variant.
    """
    own, calibrates = variant_of(config), is_installed("numpy")
    others = [each for each in VARIANTS if each.kind != own.kind and (calibrates or not each.self_calibration)]
    return [
        ReplayedLines(
            other.name,
            other.kind,
            [line for line in replayed(other.name, other.applied_to(config)) if isinstance(line, VARIANT_LINES)],
        )
        for other in others
    ]


class ReportWriter:
    """Keeps the lines of a replay, with sightings, and writes the report after the last line."""

    def __init__(self) -> None:
        self._lines: list[Line] = []

    def watched(self, lines: Iterator[Line], *, sightings: bool) -> Iterator[Line]:
        """The same lines; sighting lines and innovations only with ``sightings``."""
        for line in lines:
            self._lines.append(line)
            if sightings:
                yield line
            elif isinstance(line, TargetLine):
                yield msgspec.structs.replace(line, innovation=None)
            elif not isinstance(line, SightingLine):
                yield line

    def write(
        self,
        folder: Path,
        title: str,
        *,
        config: Config,
        others: Sequence[ReplayedLines],
        truth: Sequence[TruthPoint],
        notes: Sequence[str],
        recorded: RecordedMessages | None = None,
    ) -> Path:
        """The path of the report that was written. InputFileError where the folder cannot be written."""
        flight = flight_data(
            self._lines,
            title=title,
            variant=variant_of(config),
            others=others,
            truth=truth,
            notes=notes,
            recorded=recorded,
        )
        return write_page(folder / "report.html", page(flight, diagnostics(self._lines)))


def write_comparison(folder: Path, first: Path, second: Path, truth: Sequence[TruthPoint]) -> Path:
    """The path of the page that compares two targets files. InputFileError where a file cannot be read."""
    (our_header, ours), (their_header, theirs) = _targets(first), _targets(second)
    flights: tuple[FlightData, FlightData] = (
        flight_data(ours.lines, title=first.name, truth=truth, others=[ReplayedLines("B", "own", theirs.lines)]),
        flight_data(theirs.lines, title=second.name, truth=truth, others=[ReplayedLines("A", "own", ours.lines)]),
    )
    notes = [
        f"{path.name}: {count} {words} were left out."
        for path, read in ((first, ours), (second, theirs))
        for count, words in ((read.damaged, "damaged lines"), (read.unknown, "lines of unknown types"))
        if count
    ]
    differences = _differences(our_header.config, their_header.config)
    return write_page(folder / "compare.html", comparison(_names(first, second), flights, differences, notes))


def _names(first: Path, second: Path) -> tuple[str, str]:
    """File names, with their folders where the names alone are equal."""
    if first.name != second.name:
        return first.name, second.name
    return str(first), str(second)


def _targets(path: Path) -> tuple[HeaderLine, LinesRead]:
    """The header, and the whole lines, of which it is the first."""
    accepted = "accepted: a targets file, as `replay --out` writes one"
    try:
        with open_regular(path) as file:
            read = read_lines(file)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {accepted}") from None
    header = header_of(read.lines)
    if header is None:
        left_out = f" ({read.damaged} lines are not lines of such a file)" if read.damaged else ""
        raise InputFileError(f"{path}: its first line is not a header{left_out}; {accepted}")
    return header, read


def _differences(ours: Mapping[str, Any], theirs: Mapping[str, Any], prefix: str = "") -> list[ConfigDifference]:
    """Each configuration key with different values, as ``tracking.filter``; values are JSON."""
    found = []
    for key in sorted({*ours, *theirs}):
        a, b = ours.get(key), theirs.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            found += _differences(a, b, f"{prefix}{key}.")
        elif a != b:
            found.append(ConfigDifference(f"{prefix}{key}", json.dumps(a), json.dumps(b)))
    return found
