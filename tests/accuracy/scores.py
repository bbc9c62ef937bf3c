"""Errors of an estimator's public lines against the mock's truth. PURE.

Confirmed and coasting targets count, at the instants of their lines, from 30 % of the flight on. ``relative`` is target
minus vehicle, horizontal: the common error of the vehicle's position is no part of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot, sqrt
from statistics import mean

import msgspec

from fwav_companion.geometry.small_matrices import squared_distance
from fwav_companion.recording.error_statistics import CHI2_95, CHI2_999, ErrorSample
from fwav_companion.recording.lines import Line
from sitl_mock import Simulation
from sitl_mock.earth import Place

ANSWERS = ("confirmed", "coasting")
SETTLED_SHARE = 0.3
CELLS = 20
"""Parts of the scored flight in which two estimators are compared."""
MOST_SQUARES = 1e6
"""Limit of a normalised square, for claims of no error at all."""


class Sample(msgspec.Struct, frozen=True):
    """One line of a target against one true target."""

    flight_s: float
    frame: int
    relative: ErrorSample
    absolute: ErrorSample


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
        if line["type"] == "target" and line["state"] in ANSWERS and line["relative"] and line["lat"] is not None:
            samples = self._errors(line)
            if samples:
                self.samples.setdefault(line["track"], []).append(samples)
        elif line["type"] == "calibration" and line["status"] == "calibrated" and self.calibrated_s is None:
            self.calibrated_s = self._flight_s(line)

    def _flight_s(self, line: Line) -> float:
        return float(line["time_unix"]) - self._mock.options.start_unix_s

    def _errors(self, line: Line) -> dict[int, Sample]:
        at_s, relative, found = self._flight_s(line), line["relative"], {}
        vehicle = self._mock.flight.at(at_s).position
        place = self._mock.world.ned(Place(line["lat"], line["lon"], line["alt_amsl"]))
        for index in self.targets:
            target = self._mock.scene[index]
            if target.label == line["label"]:
                north, east, _ = target.at(at_s)
                by_vehicle = _error(
                    vehicle[0] + relative["north"] - north, vehicle[1] + relative["east"] - east, relative["cov"]
                )
                by_earth = _error(place[0] - north, place[1] - east, line["cov"])
                found[index] = Sample(at_s, line["frame"], by_vehicle, by_earth)
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
        settled = {index: [s for s in each if s.flight_s >= begin_s] for index, each in sorted(by_target.items())}
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
            cells={str(k): _cells(each, options.seconds * options.camera.fps) for k, each in settled.items()},
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


def _cells(samples: Sequence[Sample], frames: float) -> list[float | None]:
    """By the frame's number, which is the same for every estimator."""
    parts: list[list[float]] = [[] for _ in range(CELLS)]
    for sample in samples:
        share = (sample.frame / frames - SETTLED_SHARE) / (1.0 - SETTLED_SHARE)
        parts[min(CELLS - 1, max(0, int(share * CELLS)))].append(sample.relative.error_m)
    return [root_mean_square(part) if part else None for part in parts]


def root_mean_square(values: Sequence[float]) -> float:
    """Root of the mean square."""
    return sqrt(mean(value * value for value in values))
