"""Lines of recordings without a flight: reports are tested with chosen numbers."""

from __future__ import annotations

from collections.abc import Sequence
from html.parser import HTMLParser
from typing import Any

import msgspec

from fwav_companion.recording.line_types import CalibrationLine, ClockEstimateLine, HeaderLine, SightingLine, TargetLine
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.tools.report.sighting_statistics import CAUSES

BEGUN = 1_790_000_000.0


def header(**other: Any) -> HeaderLine:
    line = {
        "type": "header",
        "schema": 1,
        "version": "0.0",
        "origin": None,
        "unix_offset_s": BEGUN,
        "config": {},
    }
    return msgspec.convert(line | other, HeaderLine)


def target(at_s: float, north: float, east: float, sigma_m: float = 1.0, **other: Any) -> TargetLine:
    """A confirmed target; ``fix`` may lack what a test does not choose."""
    variance = sigma_m * sigma_m
    line = {
        "type": "target",
        "time_unix": BEGUN + at_s,
        "frame": round(at_s * 10),
        "track": 1,
        "label": "mark",
        "state": "confirmed",
        "north": north,
        "east": east,
        "down": 0.0,
        "lat": None,
        "lon": None,
        "cov": [[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, 1.0]],
        "fix": None,
    } | other
    if line["fix"] is not None:
        line["fix"] = {"down": 0.0, "cov": line["cov"], **line["fix"]}
    return msgspec.convert(line, TargetLine)


def calibration(
    at_s: float, delay_s: float, delay_sigma_s: float, mount: Sequence[float], sigma: float, **other: Any
) -> CalibrationLine:
    values = {"time_offset_s": delay_s, "time_offset_sigma_s": delay_sigma_s, "status": "calibrated"}
    line = {"type": "calibration", "time_unix": BEGUN + at_s, "mount_deg": mount, "mount_sigma_deg": [sigma] * 3}
    return msgspec.convert(line | values | other, CalibrationLine)


def sighting(at_s: float = 1.0, budget: dict[str, float] | None = None, **other: Any) -> SightingLine:
    """A used detection from 10 m above the origin."""
    line = {
        "type": "sighting",
        "frame": round(at_s * 10),
        "index": 0,
        "reason": None,
        "gap_s": 0.001,
        "time_boot": at_s,
        "camera_ned": [0.0, 0.0, -10.0],
        "ground_ned": [0.0, 0.0, 0.0],
        "budget": None if budget is None else dict.fromkeys(CAUSES, 0.0) | budget,
    }
    return msgspec.convert(line | other, SightingLine)


def clock(at_s: float, offset_s: float, sigma_s: float = 1e-5, **other: Any) -> ClockEstimateLine:
    """The offset host minus autopilot at one time."""
    line = {
        "type": "clock",
        "time_monotonic": at_s,
        "time_boot": at_s - offset_s,
        "host_from_autopilot_s": offset_s,
        "sigma_s": sigma_s,
        "bound_s": 1e-3,
        "round_trip_s": 2e-3,
        "status": "settled",
    }
    return msgspec.convert(line | other, ClockEstimateLine)


def summary(**other: Any) -> SummaryLine:
    line = {"type": "summary", "frames": 10, "detections": 5, "fixes": 5, "dropped": {}}
    return msgspec.convert(line | other, SummaryLine)


def approach(errors_m: Sequence[float], sigma_m: float = 1.0, **other: Any) -> list[TargetLine]:
    """Target lines one second apart, each this far north of (100, -50)."""
    return [target(float(at_s), 100.0 + error_m, -50.0, sigma_m, **other) for at_s, error_m in enumerate(errors_m)]


class Markup(HTMLParser):
    """Elements as (tag, attributes), and all text; fails on what is not closed in order."""

    VOID = ("meta", "br")

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[str] = []
        self._open: list[str] = []
        self.feed(html)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in self.VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data.replace("\u00a0", " "))

    @property
    def text(self) -> str:
        """All text."""
        return "".join(self.texts)

    def of(self, kind: str) -> list[dict[str, str]]:
        """The attributes of every element of this class."""
        return [each for _, each in self.elements if each.get("class") == kind]


def points(line: dict[str, str]) -> list[tuple[float, float]]:
    """Points of a polyline or polygon, in its drawing."""
    return [tuple(map(float, point.split(","))) for point in line["points"].split()]  # type: ignore[misc]
