"""Errors of an estimator's public lines against the mock's truth. PURE.

Confirmed and coasting targets count from 30 % of the flight on, each second as much as the next, whether a target was
seen in it or not: lines of a target in view come with every picture, of another once a second. ``relative`` is
target minus vehicle, horizontal: the common error of the vehicle's position is no part of it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from math import ceil, hypot, sqrt
from statistics import mean

import msgspec

from fwav_companion.geometry.small_matrices import squared_distance
from fwav_companion.recording.error_statistics import CHI2_95, CHI2_999, ErrorSample
from fwav_companion.recording.line_types import CalibrationLine, Line, TargetLine
from sitl_mock import Simulation
from sitl_mock.earth import Place

SETTLED_SHARE = 0.3
STEP_S = 0.1
"""Between two instants at which the latest line counts."""
HELD_S, HELD_PICTURES = 1.5, 1.5
"""Age of the latest line beyond which there is no answer, the longer of the two: seconds, and pictures."""
CELLS = 20
"""Parts of the scored flight in which two estimators are compared."""
MOST_SQUARES = 1e6
"""Limit of a normalised square, for claims of no error at all."""


class Sample(msgspec.Struct, frozen=True):
    """One line of a target against one true target."""

    flight_s: float
    """Instant of the line."""
    relative: ErrorSample
    absolute: ErrorSample
    at_s: float = 0.0
    """Instant at which it is the latest."""


class Errors(msgspec.Struct, frozen=True):
    """Errors of one flight against their claims."""

    rms_m: float
    square: float
    """Mean normalised square."""
    inside: float
    """Share inside the claimed 95 %."""


class FlightScore(msgspec.Struct, frozen=True, kw_only=True):
    """One flight of an estimator."""

    seed: int
    targets: int
    """True targets that were in view."""
    missed: int
    """Those that no confirmed track belongs to."""
    ghosts: int
    relative: Errors | None
    """None: no answer after 30 % of the flight."""
    absolute: Errors | None
    calibrated_s: float | None
    """From first sight to ``calibrated``; None: never."""
    cpu_s: float
    cells: dict[str, list[float | None]]
    """By target, root mean square of the relative error in each part of the flight."""


class Tracks:
    """Samples of every track of a flight, from its lines, and the true target of each."""

    def __init__(self, simulation: Simulation, landmarks: Iterable[str] = ()) -> None:
        self._mock, surveyed = simulation, set(landmarks)
        self.targets = [k for k, each in enumerate(simulation.scene) if each.label not in surveyed]
        """Indices of the true targets that are scored."""
        self.samples: dict[int, list[dict[int, Sample]]] = {}
        """By track, for each of its lines: the errors against every true target of its label."""
        self.calibrated_s: float | None = None
        """Flight time of the first ``calibrated``."""

    def add(self, line: Line) -> None:
        """Process the next line of a targets file."""
        if isinstance(line, TargetLine) and line.is_confirmed and line.relative and line.lat is not None:
            samples = self._errors(line)
            if samples:
                self.samples.setdefault(line.track, []).append(samples)
        elif isinstance(line, CalibrationLine) and line.status == "calibrated" and self.calibrated_s is None:
            self.calibrated_s = self._flight_s(line)

    def _flight_s(self, line: TargetLine | CalibrationLine) -> float:
        return line.time_unix - self._mock.options.start_unix_s

    def _errors(self, line: TargetLine) -> dict[int, Sample]:
        at_s, relative, found = self._flight_s(line), line.relative, {}
        vehicle = self._mock.flight.at(at_s).position
        place = self._mock.world.ned(Place(line.lat, line.lon, line.alt_amsl))
        for index in self.targets:
            target = self._mock.scene[index]
            if target.label == line.label:
                north, east, _ = target.at(at_s)
                by_vehicle = _error(
                    vehicle[0] + relative.north - north, vehicle[1] + relative.east - east, relative.cov
                )
                by_earth = _error(place[0] - north, place[1] - east, line.cov)
                found[index] = Sample(at_s, by_vehicle, by_earth)
        return found

    def matched(self) -> tuple[dict[int, list[Sample]], int]:
        """Samples by true target in order of time, and the number of ghosts.

        A track belongs to the target that is nearest at the track's end, or to another within its 99.9 % ellipse. A
        target has one track at a time, the nearest first; a track for which none is left is a ghost.
        """
        pairs = []
        for track, lines in self.samples.items():
            nearest = min(lines[-1], key=lambda k: lines[-1][k].relative.error_m)
            for k, last in lines[-1].items():
                if k == nearest or last.relative.normalised2 < CHI2_999:
                    pairs.append((last.relative.error_m, track, k))
        found: dict[int, list[int]] = {}
        placed: set[int] = set()
        for _, track, index in sorted(pairs):
            if track not in placed and not any(self._overlap(track, other) for other in found.get(index, [])):
                found.setdefault(index, []).append(track)
                placed.add(track)
        samples = {
            index: sorted((line[index] for track in tracks for line in self.samples[track]), key=lambda s: s.flight_s)
            for index, tracks in found.items()
        }
        return samples, len(self.samples) - len(placed)

    def answers(self, samples: Sequence[Sample], begin_s: float) -> list[Sample]:
        """The latest sample of a target at each instant from ``begin_s`` to the end of the flight, where there is
        one.
        """
        options, found = self._mock.options, []
        held_s = max(HELD_S, HELD_PICTURES / options.camera.fps)
        times = [sample.flight_s for sample in samples]
        for tick in range(ceil(begin_s / STEP_S), int(options.seconds / STEP_S) + 1):
            latest = bisect_right(times, tick * STEP_S) - 1
            if latest >= 0 and tick * STEP_S - times[latest] <= held_s:
                found.append(msgspec.structs.replace(samples[latest], at_s=tick * STEP_S))
        return found

    def _overlap(self, one: int, other: int) -> bool:
        (a, b), (c, d) = (
            [next(iter(self.samples[track][end].values())).flight_s for end in (0, -1)] for track in (one, other)
        )
        return a <= d and c <= b

    def score(self, in_view: Iterable[int], first_seen_s: float | None, *, cpu_s: float, seed: int) -> FlightScore:
        """The figures of the flight. ``in_view``: indices of the targets that could be found."""
        by_target, ghosts = self.matched()
        options, wanted = self._mock.options, set(in_view).intersection(self.targets)
        begin_s = SETTLED_SHARE * options.seconds
        settled = {index: self.answers(each, begin_s) for index, each in sorted(by_target.items())}
        samples = [sample for each in settled.values() for sample in each]
        calibrated_s = None
        if self.calibrated_s is not None and first_seen_s is not None:
            calibrated_s = max(0.0, self.calibrated_s - first_seen_s)
        return FlightScore(
            seed=seed,
            targets=len(wanted),
            missed=len(wanted - by_target.keys()),
            ghosts=ghosts,
            relative=_errors([sample.relative for sample in samples]),
            absolute=_errors([sample.absolute for sample in samples]),
            calibrated_s=calibrated_s,
            cpu_s=cpu_s,
            cells={str(k): _cells(each, options.seconds) for k, each in settled.items()},
        )


def _error(north: float, east: float, cov: Sequence[Sequence[float]]) -> ErrorSample:
    (nn, ne, _), (_, ee, _), _ = cov
    return ErrorSample(hypot(north, east), min(MOST_SQUARES, squared_distance(north, east, (nn, ne, ee))))


def _errors(samples: Sequence[ErrorSample]) -> Errors | None:
    if not samples:
        return None
    return Errors(
        root_mean_square([sample.error_m for sample in samples]),
        mean(sample.normalised2 for sample in samples),
        mean(float(sample.normalised2 <= CHI2_95) for sample in samples),
    )


def _cells(samples: Sequence[Sample], seconds: float) -> list[float | None]:
    parts: list[list[float]] = [[] for _ in range(CELLS)]
    for sample in samples:
        share = (sample.at_s / seconds - SETTLED_SHARE) / (1.0 - SETTLED_SHARE)
        parts[min(CELLS - 1, max(0, int(share * CELLS)))].append(sample.relative.error_m)
    return [root_mean_square(part) if part else None for part in parts]


def root_mean_square(values: Sequence[float]) -> float:
    """Root of the mean square."""
    return sqrt(mean(value * value for value in values))
