"""Errors of a replay's fixes and tracks against true targets, for the summary of its targets file. PURE."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot, sqrt

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import semi_axes
from fwav_companion.geometry.small_matrices import squared_distance
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.recording.error_statistics import CHI2_95, CHI2_999, ErrorSample, error_statistics
from fwav_companion.recording.line_types import HeaderLine, Line, OriginLine, PlaceObject, TargetLine
from fwav_companion.recording.summary_types import ErrorsObject, LabelErrorObject, StatisticsObject, TargetErrorObject
from fwav_companion.recording.truth import Truth, TruthPoint


class TrackErrors:
    """Errors of one confirmed track against the true targets of its label."""

    def __init__(self, label: str) -> None:
        self.label = label
        self.first_s = self.last_s = 0.0
        """First and last time, Unix seconds."""
        self.samples: dict[int, list[ErrorSample]] = {}
        """Errors by index of the true target, in order of time."""
        self.final: dict[int, ErrorSample] = {}
        """The last error against each true target, by its index."""
        self.major95_m = 0.0
        """Larger semi-axis of the last 95 % ellipse, metres."""

    @property
    def nearest(self) -> ErrorSample:
        """The least of the final errors."""
        return min(self.final.values(), key=lambda sample: sample.error_m)

    def overlaps(self, other: TrackErrors) -> bool:
        """Whether the two tracks were confirmed at the same time."""
        return self.first_s <= other.last_s and other.first_s <= self.last_s


class ErrorTally:
    """Horizontal errors of single fixes and of confirmed tracks, from the lines of a targets file."""

    def __init__(self, points: Iterable[TruthPoint]) -> None:
        by_target: dict[str, list[TruthPoint]] = {}
        for number, point in enumerate(points):
            # A label without times may name several stationary targets: each row is one.
            key = point.label if point.time_unix is not None else f"{point.label}\0{number}"
            by_target.setdefault(key, []).append(point)
        self._targets = [(key.partition("\0")[0], Truth(points)) for key, points in by_target.items()]
        self._fixes: dict[int, list[ErrorSample]] = {index: [] for index in range(len(self._targets))}
        self._tracks: dict[int, TrackErrors] = {}
        self._plane: TangentPlane | None = None

    def add(self, line: Line) -> None:
        """Process the next line of a targets file."""
        if isinstance(line, HeaderLine | OriginLine) and line.origin is not None:
            self._plane = line.origin.plane
        elif isinstance(line, TargetLine):
            if line.fix is not None:
                nearest = min(self._errors(line, line.fix).items(), key=lambda each: each[1].error_m, default=None)
                if nearest is not None:
                    self._fixes[nearest[0]].append(nearest[1])
            if line.is_confirmed:
                self._add_track(line)

    def _errors(self, line: TargetLine, estimate: TargetLine | PlaceObject) -> dict[int, ErrorSample]:
        """Errors of an estimate against every true target of its label."""
        errors: dict[int, ErrorSample] = {}
        for index, (label, truth) in enumerate(self._targets):
            true_ned = truth.ned_at(line.time_unix, self._plane) if label in ("", line.label) else None
            if true_ned is not None:
                errors[index] = error_sample(true_ned, estimate)
        return errors

    def _add_track(self, line: TargetLine) -> None:
        errors = self._errors(line, line)
        if not errors:
            return
        track = self._tracks.get(line.track)
        if track is None:
            track = self._tracks[line.track] = TrackErrors(line.label)
            track.first_s = line.time_unix
        track.last_s, track.final = line.time_unix, errors
        track.major95_m = sqrt(CHI2_95) * semi_axes(line.cov)[0]
        for index, sample in errors.items():
            track.samples.setdefault(index, []).append(sample)

    # Summary.

    def summary(self) -> ErrorsObject:
        """Statistics of fixes and tracks, per label and in total; the state of each target; the number of ghosts."""
        found, ghosts = self._assigned()
        tracked = {
            index: [sample for number in numbers for sample in self._tracks[number].samples[index]]
            for index, numbers in found.items()
        }
        targets = [self._target(index, label, found.get(index, [])) for index, (label, _) in enumerate(self._targets)]
        return ErrorsObject(
            fixes=self._statistics(self._fixes),
            tracks=self._statistics(tracked),
            labels={label: _of_label(label, targets) for label in dict.fromkeys(each.label for each in targets)},
            targets=targets,
            ghosts=ghosts,
        )

    def targets(self) -> tuple[list[TargetErrorObject], int]:
        """State and final error of each target, and the number of ghosts: the part of the summary that is cheap."""
        found, ghosts = self._assigned()
        return [self._target(i, label, found.get(i, [])) for i, (label, _) in enumerate(self._targets)], ghosts

    def _assigned(self) -> tuple[dict[int, list[int]], int]:
        """Tracks by true target, and the number of ghosts.

        Pairs are assigned in order of distance. A target has one track at a time; a track that follows an earlier one
        belongs to the same target. A target that is not the track's nearest must lie within the track's 99.9 % ellipse.
        A track without a target is a ghost.
        """
        pairs = sorted(
            (sample.error_m, number, index)
            for number, track in self._tracks.items()
            for index, sample in track.final.items()
            if sample.normalised2 < CHI2_999 or sample is track.nearest
        )
        found: dict[int, list[int]] = {}
        placed: set[int] = set()
        for _, number, index in pairs:
            others = [self._tracks[other] for other in found.get(index, [])]
            if number not in placed and not any(self._tracks[number].overlaps(other) for other in others):
                found.setdefault(index, []).append(number)
                placed.add(number)
        return found, len(self._tracks) - len(placed)

    def _target(self, index: int, label: str, numbers: Sequence[int]) -> TargetErrorObject:
        if numbers:
            number = max(numbers, key=lambda each: self._tracks[each].last_s)
            track = self._tracks[number]
            final = track.final[index]
            return TargetErrorObject(
                label=label,
                state="found",
                track=number,
                final_m=final.error_m,
                claimed95_m=track.major95_m,
                outside95=final.normalised2 > CHI2_95,
            )
        near = [sample for sample in self._fixes[index] if sample.normalised2 < CHI2_999]
        return TargetErrorObject(label=label, state="fixed" if near else "missed", final_m=None)

    def _statistics(self, by_target: dict[int, list[ErrorSample]]) -> StatisticsObject:
        labels: dict[str, list[list[ErrorSample]]] = {}
        for index, samples in by_target.items():
            labels.setdefault(self._targets[index][0], []).append(samples)
        return StatisticsObject(
            overall=error_statistics([samples for series in labels.values() for samples in series]),
            labels={label: error_statistics(series) for label, series in labels.items()},
        )


def error_sample(true_ned: Vector3, estimate: TargetLine | PlaceObject) -> ErrorSample:
    """Error of an estimate with a covariance, a target line or its fix."""
    north, east = estimate.north - true_ned[0], estimate.east - true_ned[1]
    (nn, ne, _), (_, ee, _), _ = estimate.cov
    return ErrorSample(hypot(north, east), squared_distance(north, east, (nn, ne, ee)))


def _of_label(label: str, targets: Sequence[TargetErrorObject]) -> LabelErrorObject:
    """State and final error of a label: the worst of its targets'."""
    of_label = [each for each in targets if each.label == label]
    states = [each.state for each in of_label]
    state = next(each for each in ("missed", "fixed", "found") if each in states)
    errors = [each.final_m for each in of_label if each.final_m is not None]
    return LabelErrorObject(state=state, final_m=max(errors) if errors else None)
