"""SHELL: report.html of a replay, and compare.html of two."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from fwav_companion.config import Config
from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import made_folder, opened, whole
from fwav_companion.recording.lines import Line
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import WAYS, Replayed, Story, page, tell, way_of
from fwav_companion.tools.report.comparison import comparison
from fwav_companion.tools.report.depths import depths
from fwav_companion.tools.report.intake import read_lines

OF_OTHERS = ("target", "calibration")
"""The lines of another way that a report draws."""


def other_ways(config: Config, again: Callable[[str, Config], Iterator[Line]]) -> list[Replayed]:
    """The recording tracked in each way that the configuration is not. ``again``: a replay, by its name."""
    ours = way_of(config)
    return [
        Replayed(way.name, way.kind, [line for line in again(way.name, way.of(config)) if line["type"] in OF_OTHERS])
        for way in WAYS
        if way.kind != ours.kind
    ]


class ReportWriter:
    """Sees the lines of a replay go by, sightings and all, and tells them afterwards."""

    def __init__(self) -> None:
        self._lines: list[Line] = []

    def watched(self, lines: Iterator[Line], *, sightings: bool) -> Iterator[Line]:
        """The same lines; what is said of sightings only where it was asked for."""
        for line in lines:
            self._lines.append(line)
            if sightings:
                yield line
            elif line["type"] != "sighting":
                yield {key: line[key] for key in line if key != "innovation"} if "innovation" in line else line

    def write(
        self,
        folder: Path,
        title: str,
        config: Config,
        others: Sequence[Replayed],
        truth: Sequence[TruthPoint],
        notes: Sequence[str],
    ) -> Path:
        """Where the report was written. InputFileError where it cannot be."""
        story = tell(self._lines, title=title, way=way_of(config), others=others, truth=truth, notes=notes)
        return _write(folder / "report.html", page(story, depths(self._lines)))


def write_comparison(folder: Path, first: Path, second: Path, truth: Sequence[TruthPoint]) -> Path:
    """Two targets files side by side. InputFileError where one cannot be read."""
    (ours, our_damage), (theirs, their_damage) = _targets(first), _targets(second)
    stories: tuple[Story, Story] = (
        tell(ours, title=first.name, truth=truth, others=[Replayed("B", "own", theirs)]),
        tell(theirs, title=second.name, truth=truth, others=[Replayed("A", "own", ours)]),
    )
    changed = _differences(ours[0]["config"], theirs[0]["config"])
    title = f"{first.stem} beside {second.stem}"
    notes = [
        f"{path.name}: {damaged} damaged lines were left out."
        for path, damaged in ((first, our_damage), (second, their_damage))
        if damaged
    ]
    return _write(folder / "compare.html", comparison(title, (first.name, second.name), stories, changed, notes))


def _targets(path: Path) -> tuple[list[Line], int]:
    """The lines that are whole, the header first, and how many were not."""
    accepted = "accepted: a targets file, as `replay --out` writes one"
    try:
        with opened(path) as file:
            lines, damaged = read_lines(file)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {accepted}") from None
    if not lines or lines[0].get("type") != "header":
        left_out = f" ({damaged} lines are no JSON objects of such a file)" if damaged else ""
        raise InputFileError(f"{path}: its first line is no header{left_out}; {accepted}")
    return lines, damaged


def _differences(ours: Mapping[str, Any], theirs: Mapping[str, Any], prefix: str = "") -> list[str]:
    """``tracking.filter: kalman | lowpass``, key by key."""
    told = []
    for key in sorted({*ours, *theirs}):
        a, b = ours.get(key), theirs.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            told += _differences(a, b, f"{prefix}{key}.")
        elif a != b:
            told.append(f"{prefix}{key}: {json.dumps(a)} | {json.dumps(b)}")
    return told


def _write(path: Path, text: str) -> Path:
    try:
        made_folder(path.parent)
        with whole(path) as file:
            file.write(text.encode())
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
    return path
