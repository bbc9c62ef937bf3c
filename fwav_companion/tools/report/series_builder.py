"""Builds the series of each target from the lines of a replay, its truths, and other variants. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import hypot

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.recording.labels import display_name
from fwav_companion.recording.line_types import Line, PlaceObject, TargetLine
from fwav_companion.recording.truth import Truth, TruthPoint
from fwav_companion.tools.report.series_matching import (
    GroupedLines,
    assigned,
    final_distances_m,
    own_columns,
    targets_of,
)
from fwav_companion.tools.report.target_series import (
    MOST_POINTS,
    ReplayedLines,
    SeriesFix,
    SeriesPoint,
    TargetSeries,
    VariantSeries,
)
from fwav_companion.tools.report.true_vehicle_path import HorizontalError, mean_position_error

MOST_SAMPLED = 50
"""Lines of a target that are compared with each truth to find the target's own."""

LabelledTruth = tuple[str, Truth]


class _Reference(msgspec.Struct, frozen=True):
    """Start time and truths of a recording: converts target lines to points of a series."""

    start_unix: float
    plane: TangentPlane | None
    truths: Sequence[LabelledTruth]
    position_errors: Mapping[int, Sequence[HorizontalError]]

    def true_ned(self, truth: Truth | None, time_unix: float) -> tuple[float, float] | None:
        true = truth.ned_at(time_unix, self.plane) if truth is not None else None
        return None if true is None else (true[0], true[1])

    @property
    def has_truth(self) -> bool:
        """Whether any truth can be placed in the world of the recording."""
        return any(self.true_ned(truth, self.start_unix) is not None for _, truth in self.truths)

    def distances_m(self, target: GroupedLines, truths: Sequence[LabelledTruth]) -> list[float | None]:
        """Mean distance to each truth; None for a truth of another label. A truth without a label fits every target."""
        sampled = _thinned(target.shown, MOST_SAMPLED)
        found: list[float | None] = []
        for label, truth in truths:
            errors = [self.error_m(truth, line, line) for line in sampled] if label in ("", target.label) else []
            known = [error_m for error_m in errors if error_m is not None]
            found.append(sum(known) / len(known) if known else None)
        return found

    def own_truths(
        self, targets: Sequence[GroupedLines], truths: Sequence[LabelledTruth]
    ) -> list[LabelledTruth | None]:
        """The true target of each target, each truth at most once; None for a target without one."""
        columns = own_columns(targets, [self.distances_m(each, truths) for each in targets])
        return [None if column is None else truths[column] for column in columns]

    def error_m(self, truth: Truth | None, line: TargetLine, at: TargetLine | PlaceObject) -> float | None:
        true = self.true_ned(truth, line.time_unix)
        return None if true is None else _distance(at, true)

    def points(self, lines: Sequence[TargetLine], truth: Truth | None) -> list[SeriesPoint]:
        radii: dict[tuple[float, ...], float] = {}  # a target out of view keeps its covariance
        found = []
        for line in _thinned(lines, MOST_POINTS):
            cov = line.cov
            flat = (cov[0][0], cov[0][1], cov[1][1])
            if flat not in radii:
                radii[flat] = circle_radius(cov, 0.95)
            error_m = self.error_m(truth, line, line)
            at_s = line.time_unix - self.start_unix
            found.append(
                SeriesPoint(at_s=at_s, north=line.north, east=line.east, radius95_m=radii[flat], error_m=error_m)
            )
        return found


def target_series(
    lines: Sequence[Line],
    *,
    others: Sequence[ReplayedLines],
    truth: Sequence[TruthPoint],
    plane: TangentPlane | None,
    start_unix: float,
    position_errors: Mapping[int, Sequence[HorizontalError]],
) -> list[TargetSeries]:
    """The series of every confirmed target, ghosts among them, and of every true target that was not found.

    ``position_errors``: errors of the vehicle's position by frame, where they are known.
    """
    reference = _Reference(start_unix, plane, _truths(truth), position_errors)
    targets = targets_of(lines)
    confirmed = [each for each in targets if each.confirmed]
    owned = reference.own_truths(confirmed, reference.truths)
    found = [
        _series(target, own, variants, reference)
        for target, own, variants in zip(confirmed, owned, _in_variants(confirmed, others), strict=True)
    ]
    doubted = [each for each in targets if not each.confirmed]
    for target, own in zip(doubted, reference.own_truths(doubted, _without(reference.truths, owned)), strict=True):
        if own is not None:
            owned.append(own)
            found.append(_series(target, own, [], reference))
    for label, truth_of_label in _without(reference.truths, owned):
        at = reference.true_ned(truth_of_label, start_unix)
        if at is not None:
            found.append(_never_seen(display_name(label), at))
    return sorted(found, key=lambda series: _natural(series.name))


def _without(truths: Sequence[LabelledTruth], owned: Sequence[LabelledTruth | None]) -> list[LabelledTruth]:
    """The truths that are not the own truth of a target."""
    taken = {id(own[1]) for own in owned if own is not None}
    return [each for each in truths if id(each[1]) not in taken]


def _in_variants(
    targets: Sequence[GroupedLines], others: Sequence[ReplayedLines]
) -> list[list[tuple[ReplayedLines, list[TargetLine]]]]:
    """The confirmed lines of the same target in each other variant."""
    found: list[list[tuple[ReplayedLines, list[TargetLine]]]] = [[] for _ in targets]
    for other in others:
        theirs = [each for each in targets_of(other.lines) if each.confirmed]
        for variants, column in zip(found, assigned(final_distances_m(targets, theirs)), strict=True):
            variants.append((other, [] if column is None else theirs[column].confirmed))
    return found


def _series(
    target: GroupedLines,
    own: LabelledTruth | None,
    variants: Sequence[tuple[ReplayedLines, list[TargetLine]]],
    reference: _Reference,
) -> TargetSeries:
    truth = None if own is None else own[1]
    shown = target.shown
    fixes = [
        SeriesFix(line.time_unix - reference.start_unix, fix.north, fix.east, reference.error_m(truth, line, fix))
        for line in target.lines
        if (fix := line.fix) is not None
    ]
    last = shown[-1] if shown else None
    frames = [line.frame for line in target.lines if line.fix and line.frame is not None]
    ghost = bool(target.confirmed) and own is None and reference.has_truth
    return TargetSeries(
        name=target.name,
        points=reference.points(shown, truth),
        fixes=fixes,
        cov=last.cov if last else None,
        found=bool(target.confirmed) and not ghost,
        ghost=ghost,
        true_ned=reference.true_ned(truth, last.time_unix if last else reference.start_unix),
        position_error_m=mean_position_error(reference.position_errors, frames),
        place=None if last is None else last.lat_lon,
        variants=[VariantSeries(other.name, other.kind, reference.points(lines, truth)) for other, lines in variants],
    )


def _never_seen(name: str, true_ned: tuple[float, float]) -> TargetSeries:
    return TargetSeries(
        name=name, points=[], fixes=[], cov=None, found=False, ghost=False, true_ned=true_ned, position_error_m=None,
        place=None, variants=[],
    )  # fmt: skip


def _truths(points: Iterable[TruthPoint]) -> list[LabelledTruth]:
    """(label, truth) of each target: every row without a time is a target; rows with times are one target per label."""
    moving: dict[str, list[TruthPoint]] = {}
    found = []
    for point in points:
        if point.time_unix is None:
            found.append((point.label, Truth([point])))
        else:
            moving.setdefault(point.label, []).append(point)
    return found + [(label, Truth(path)) for label, path in moving.items()]


def _thinned(lines: Sequence[TargetLine], most: int) -> Sequence[TargetLine]:
    """At most ``most`` of the lines, evenly chosen, with both ends."""
    if len(lines) <= most:
        return lines
    step = (len(lines) - 1) / (most - 1)
    return [lines[round(index * step)] for index in range(most)]


def _distance(at: TargetLine | PlaceObject, true: tuple[float, float]) -> float:
    return hypot(at.north - true[0], at.east - true[1])


def _natural(name: str) -> tuple[str, int]:
    """Sort key that puts tag 11 after tag 7."""
    head, number = name.rstrip("0123456789"), name[len(name.rstrip("0123456789")) :]
    return (head, int(number)) if number else (name, 0)
