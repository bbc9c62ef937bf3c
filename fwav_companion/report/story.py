"""The flight as a report needs it: courses by target, where the vehicle was, the clock, and what was not used. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import hypot
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.recording.lines import Line
from fwav_companion.recording.truth import Truth, TruthPoint

BELIEVED = ("confirmed", "coasting")
CAUSES = ("position", "heading", "attitude", "mount", "height", "time", "pixel", "terrain")
"""Of a fix's budget, as a recording names them."""


class Instant(msgspec.Struct, frozen=True):
    """A target at one frame."""

    at_s: float
    """Since the recording began."""
    north: float
    east: float
    radius95_m: float
    """Of the circle that was claimed to hold it with 95 %."""
    error_m: float | None
    """Horizontal; None without a truth."""


class Fix(msgspec.Struct, frozen=True):
    """One detection, on the ground."""

    at_s: float
    north: float
    east: float
    error_m: float | None


class Course(msgspec.Struct, frozen=True):
    """Everything about one label."""

    label: str
    instants: list[Instant]
    """Of the track that was believed at the end, or else the newest one."""
    fixes: list[Fix]
    cov: Matrix3 | None
    """Of the last instant."""
    found: bool
    true_ned: tuple[float, float] | None
    """North, east at the end."""
    other: list[Instant]
    """The same frames through the other filter."""

    @property
    def last(self) -> Instant | None:
        """Where it ended."""
        return self.instants[-1] if self.instants else None


class ClockPoint(msgspec.Struct, frozen=True):
    """The autopilot's clock on ours."""

    at_s: float
    sigma_s: float
    bound_s: float
    status: str


class PictureShown(msgspec.Struct, frozen=True):
    """One frame, and what was seen in it."""

    jpeg: bytes
    size: tuple[int, int]
    frame: int
    detections: Sequence[Mapping[str, Any]]
    """As on the wire."""


class Story(msgspec.Struct, frozen=True, kw_only=True):
    """One flight."""

    title: str
    seconds: float
    version: str
    origin: Geodetic | None
    courses: list[Course]
    path: list[tuple[float, float]]
    """Of the vehicle, north and east: true where that is known, else as it believed."""
    path_is_true: bool
    gaps_s: list[float]
    """From each used detection to the nearest attitude."""
    budget_m: dict[str, float]
    """Root mean square over the fixes, by cause."""
    clock: list[ClockPoint]
    frames: int
    detections: int
    fixes: int
    dropped: dict[str, int]
    picture: PictureShown | None
    hidden: dict[str, str]
    """What was wrong with the vehicle and was told to nobody, where it is known."""
    other_name: str
    notes: list[str]


def tell(
    lines: Sequence[Line],
    *,
    title: str,
    truth: Sequence[TruthPoint] = (),
    other: Sequence[Line] = (),
    other_name: str = "the paper's filter",
    true_path: Sequence[tuple[float, float]] = (),
    picture: PictureShown | None = None,
    hidden: Mapping[str, str] | None = None,
    notes: Iterable[str] = (),
) -> Story:
    """From the lines of a replay with sightings. ``other``: the same recording through another filter."""
    header = lines[0]
    summary = lines[-1] if lines[-1]["type"] == "summary" else {}
    place = next((line["origin"] for line in lines if line["type"] in ("header", "origin") and line["origin"]), None)
    origin = Geodetic.from_degrees(place["lat"], place["lon"], place["alt_amsl"]) if place else None
    plane = TangentPlane(origin) if origin else None
    begun, ended = _span(lines, header["unix_offset_s"])
    truths = {label: Truth([point for point in truth if point.label == label]) for label in {p.label for p in truth}}
    used = [line for line in lines if line["type"] == "sighting" and line["reason"] is None]
    believed_path = [(line["camera_ned"][0], line["camera_ned"][1]) for line in used if line["camera_ned"]]
    return Story(
        title=title,
        seconds=ended - begun,
        version=header["version"],
        origin=origin,
        courses=_courses(lines, other, truths, plane, begun),
        path=list(true_path) or believed_path,
        path_is_true=bool(true_path),
        gaps_s=[line["gap_s"] for line in used if line["gap_s"] is not None],
        budget_m=_budget([line["budget"] for line in used if line["budget"]]),
        clock=[
            ClockPoint(line["time_monotonic"] + header["unix_offset_s"] - begun, line["sigma_s"], line["bound_s"],
                       line.get("status", ""))
            for line in lines if line["type"] == "clock"
        ],
        frames=summary.get("frames", 0),
        detections=summary.get("detections", 0),
        fixes=summary.get("fixes", 0),
        dropped=dict(summary.get("dropped", {})),
        picture=picture,
        hidden=dict(hidden or {}),
        other_name=other_name,
        notes=list(notes),
    )  # fmt: skip


def _span(lines: Sequence[Line], unix_offset_s: float) -> tuple[float, float]:
    """Unix times of the first and the last thing that was told."""
    times = [line["time_unix"] for line in lines if line["type"] == "target"]
    times += [line["time_monotonic"] + unix_offset_s for line in lines if line["type"] == "clock"]
    return (min(times), max(times)) if times else (0.0, 0.0)


def _courses(
    lines: Sequence[Line],
    other: Sequence[Line],
    truths: Mapping[str, Truth],
    plane: TangentPlane | None,
    begun: float,
) -> list[Course]:
    """By label: those that are true, and those that were believed without being so."""
    ours, theirs = _by_label(lines), _by_label(other)
    believed = {label for label, own in ours.items() if any(line["state"] in BELIEVED for line in own)}
    courses = [
        _course(label, ours.get(label, []), theirs.get(label, []), truths.get(label), plane, begun)
        for label in sorted(set(truths) | believed, key=_natural)
    ]
    return [course for course in courses if course.instants or course.true_ned]


def _course(
    label: str,
    ours: Sequence[Line],
    theirs: Sequence[Line],
    truth: Truth | None,
    plane: TangentPlane | None,
    begun: float,
) -> Course:
    def error_m(line: Line, at: Line) -> float | None:
        true = truth.ned_at(line["time_unix"], plane) if truth else None
        return None if true is None else hypot(at["north"] - true[0], at["east"] - true[1])

    def instants(own: Sequence[Line]) -> list[Instant]:
        live = [line for line in own if line["state"] != "dropped"]
        return [
            Instant(line["time_unix"] - begun, line["north"], line["east"], circle_radius(line["cov"], 0.95),
                    error_m(line, line))
            for line in live
        ]  # fmt: skip

    fixes = [
        Fix(line["time_unix"] - begun, line["fix"]["north"], line["fix"]["east"], error_m(line, line["fix"]))
        for line in ours
        if line["fix"]
    ]
    believed = [line for line in ours if line["state"] in BELIEVED]
    own = believed or [line for line in ours if line["state"] != "dropped"]
    last_true = truth.ned_at(own[-1]["time_unix"] if own else begun, plane) if truth else None
    return Course(
        label,
        instants(own),
        fixes,
        own[-1]["cov"] if own else None,
        bool(believed),
        None if last_true is None else (last_true[0], last_true[1]),
        instants([line for line in theirs if line["state"] in BELIEVED]),
    )


def _by_label(lines: Iterable[Line]) -> dict[str, list[Line]]:
    by_label: dict[str, list[Line]] = {}
    for line in lines:
        if line["type"] == "target":
            by_label.setdefault(line["label"], []).append(line)
    return by_label


def _natural(label: str) -> tuple[str, int]:
    """Tag 11 comes after tag 7."""
    head, _, number = label.rpartition(":")
    return (head, int(number)) if number.isdigit() else (label, 0)


def _budget(budgets: Sequence[Mapping[str, float]]) -> dict[str, float]:
    if not budgets:
        return {}
    return {cause: (sum(each[cause] ** 2 for each in budgets) / len(budgets)) ** 0.5 for cause in CAUSES}
