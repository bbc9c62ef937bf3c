"""Courses: each target's way through a recording, against the truth, and through other filters. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import hypot

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.recording.lines import Line
from fwav_companion.recording.truth import Truth, TruthPoint
from fwav_companion.tools.report.groups import Group, groups_of
from fwav_companion.tools.report.matching import apart_m, matched

MOST_INSTANTS = 500
"""Of one target: finer than a chart's pixels, and each costs a millisecond for its radius."""
MOST_SAMPLED = 50
"""To tell which truth is whose."""


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


class Alternative(msgspec.Struct, frozen=True):
    """The same frames through another filter."""

    name: str
    kind: str
    """Its colour."""
    instants: list[Instant]
    """Where it believed in a target; empty: never."""

    @property
    def last(self) -> Instant | None:
        """Where it ended."""
        return self.instants[-1] if self.instants else None


class Course(msgspec.Struct, frozen=True):
    """Everything about one target."""

    label: str
    """Unlike any other's: where several targets share theirs, the track's number is in it."""
    instants: list[Instant]
    """While it was believed, or else of its newest track; thinned where it is long."""
    fixes: list[Fix]
    cov: Matrix3 | None
    """Of the last instant."""
    found: bool
    true_ned: tuple[float, float] | None
    """North, east at the end."""
    place: tuple[float, float] | None
    """Latitude and longitude of the last instant, degrees."""
    others: list[Alternative]

    @property
    def last(self) -> Instant | None:
        """Where it ended."""
        return self.instants[-1] if self.instants else None


class Replayed(msgspec.Struct, frozen=True):
    """The lines of one replay, and what it is called."""

    name: str
    kind: str
    lines: Sequence[Line]


class _Gauge(msgspec.Struct, frozen=True):
    """Turns lines into instants: when the recording began, and where its targets truly are."""

    begun: float
    plane: TangentPlane | None
    truths: Sequence[tuple[str, Truth]]

    def ned(self, truth: Truth | None, time_unix: float) -> tuple[float, float] | None:
        true = truth.ned_at(time_unix, self.plane) if truth is not None else None
        return None if true is None else (true[0], true[1])

    def distances_m(self, group: Group) -> list[float | None]:
        """To each truth, on the mean over its course; None to those of another label. No label is anybody's."""
        sampled = _thinned(group.shown, MOST_SAMPLED)
        found: list[float | None] = []
        for label, truth in self.truths:
            errors = [self.error_m(truth, line, line) for line in sampled] if label in ("", group.label) else []
            known = [error_m for error_m in errors if error_m is not None]
            found.append(sum(known) / len(known) if known else None)
        return found

    def truths_of(self, groups: Sequence[Group]) -> list[Truth | None]:
        """One to one as far as they go; a track that is left over is measured against the nearest."""
        table = [self.distances_m(group) for group in groups]
        columns = [
            _nearest(row) if column is None else column for row, column in zip(table, matched(table), strict=True)
        ]
        return [None if column is None else self.truths[column][1] for column in columns]

    def error_m(self, truth: Truth | None, line: Line, at: Line) -> float | None:
        true = self.ned(truth, line["time_unix"])
        return None if true is None else _distance(at, true)

    def instants(self, lines: Sequence[Line], truth: Truth | None) -> list[Instant]:
        radii: dict[tuple[float, ...], float] = {}  # a target out of view keeps its covariance
        found = []
        for line in _thinned(lines, MOST_INSTANTS):
            cov = line["cov"]
            flat = (cov[0][0], cov[0][1], cov[1][1])
            if flat not in radii:
                radii[flat] = circle_radius(cov, 0.95)
            error_m = self.error_m(truth, line, line)
            found.append(Instant(line["time_unix"] - self.begun, line["north"], line["east"], radii[flat], error_m))
        return found


def courses(
    lines: Sequence[Line],
    others: Sequence[Replayed],
    truth: Sequence[TruthPoint],
    plane: TangentPlane | None,
    begun: float,
) -> list[Course]:
    """Those that were believed, and those that are true and were not found."""
    gauge = _Gauge(begun, plane, _truths(truth))
    groups = groups_of(lines)
    believed = [group for group in groups if group.believed]
    answers = _answers(believed, others)
    found, taken = [], set()
    for group, true, theirs in zip(believed, gauge.truths_of(believed), answers, strict=True):
        taken.add(id(true))
        found.append(_course(group, true, theirs, gauge))
    doubted = [group for group in groups if not group.believed]
    for group, true in zip(doubted, gauge.truths_of(doubted), strict=True):
        if true is not None and id(true) not in taken:
            taken.add(id(true))
            found.append(_course(group, true, [], gauge))
    for label, truth_of_label in gauge.truths:
        at = gauge.ned(truth_of_label, begun)
        if id(truth_of_label) not in taken and at is not None:
            found.append(Course(label, [], [], None, False, at, None, []))
    return sorted(found, key=lambda course: _natural(course.label))


def _answers(groups: Sequence[Group], others: Sequence[Replayed]) -> list[list[tuple[Replayed, list[Line]]]]:
    """Of each group, what each other way believed of the same target."""
    answers: list[list[tuple[Replayed, list[Line]]]] = [[] for _ in groups]
    for other in others:
        theirs = [group for group in groups_of(other.lines) if group.believed]
        table = apart_m(groups, theirs)
        for answer, column in zip(answers, matched(table), strict=True):
            answer.append((other, [] if column is None else theirs[column].believed))
    return answers


def _course(group: Group, truth: Truth | None, theirs: Sequence[tuple[Replayed, list[Line]]], gauge: _Gauge) -> Course:
    shown = group.shown
    fixes = [
        Fix(line["time_unix"] - gauge.begun, line["fix"]["north"], line["fix"]["east"],
            gauge.error_m(truth, line, line["fix"]))
        for line in group.lines if line["fix"]
    ]  # fmt: skip
    others = [Alternative(other.name, other.kind, gauge.instants(lines, truth)) for other, lines in theirs]
    last = shown[-1] if shown else None
    return Course(
        label=group.name,
        instants=gauge.instants(shown, truth),
        fixes=fixes,
        cov=last["cov"] if last else None,
        found=bool(group.believed),
        true_ned=gauge.ned(truth, last["time_unix"] if last else gauge.begun),
        place=(last["lat"], last["lon"]) if last and last.get("lat") is not None else None,
        others=others,
    )


def _nearest(distances_m: Sequence[float | None]) -> int | None:
    known = [(distance_m, column) for column, distance_m in enumerate(distances_m) if distance_m is not None]
    return min(known)[1] if known else None


def _truths(points: Iterable[TruthPoint]) -> list[tuple[str, Truth]]:
    """A label without times may name several targets that stand about: each row is one."""
    walking: dict[str, list[TruthPoint]] = {}
    found = []
    for point in points:
        if point.time_unix is None:
            found.append((point.label, Truth([point])))
        else:
            walking.setdefault(point.label, []).append(point)
    return found + [(label, Truth(course)) for label, course in walking.items()]


def _thinned(lines: Sequence[Line], most: int) -> Sequence[Line]:
    """Evenly, with both ends."""
    if len(lines) <= most:
        return lines
    step = (len(lines) - 1) / (most - 1)
    return [lines[round(index * step)] for index in range(most)]


def _distance(at: Line | Mapping[str, float], true: tuple[float, float]) -> float:
    return hypot(at["north"] - true[0], at["east"] - true[1])


def _natural(label: str) -> tuple[str, int]:
    """Tag 11 comes after tag 7."""
    head, number = label.rstrip("0123456789"), label[len(label.rstrip("0123456789")) :]
    return (head, int(number)) if number else (label, 0)
