"""Errors of an estimator's public lines against the mock's truth, and their statistics. PURE.

Confirmed and coasting targets count, at the instants of their lines, from 30 % of the flight on. ``relative`` is target
minus vehicle, horizontal, which the common error of the vehicle's position does not spoil.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf, sqrt
from statistics import mean, median
from typing import Any

import msgspec

from fwav_companion.geometry.small_matrices import squared_distance
from fwav_companion.recording.error_statistics import CHI2_95, CHI2_999
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
    relative_m: float
    relative_square: float
    absolute_m: float
    absolute_square: float


class FlightScore(msgspec.Struct, frozen=True, kw_only=True):
    """One flight of an estimator. None: no answer after 30 % of the flight."""

    seed: int
    targets: int
    missed: int
    """True targets in view that no confirmed track ended nearest to."""
    ghosts: int
    relative_m: float | None
    """Root mean square."""
    absolute_m: float | None
    relative_square: float | None
    """Mean normalised square."""
    absolute_square: float | None
    relative_inside: float | None
    """Share inside the claimed 95 %."""
    absolute_inside: float | None
    calibrated_s: float | None
    """From first sight to ``calibrated``; None: never."""
    cpu_s: float
    cells: dict[str, list[float | None]]
    """By target, root mean square of the relative error in each part of the flight."""


class TruthOf:
    """Errors of lines against the scene of a simulation."""

    def __init__(self, simulation: Simulation, landmarks: Iterable[str] = ()) -> None:
        self._mock = simulation
        self.targets = [k for k, each in enumerate(simulation.scene) if each.label not in set(landmarks)]

    def flight_s(self, line: Line) -> float:
        """Seconds since the start of the flight."""
        return float(line["time_unix"]) - self._mock.options.start_host_s - self._mock.unix_minus_host_s

    def samples(self, line: Line) -> dict[int, Sample]:
        """The line's errors against each target of its label, by the target's index."""
        at_s = self.flight_s(line)
        vehicle = self._mock.flight.at(at_s).position
        place = self._mock.world.ned(Place(line["lat"], line["lon"], line["alt_amsl"]))
        found = {}
        for index in self.targets:
            target = self._mock.scene[index]
            if target.label == line["label"]:
                north, east, _ = target.at(at_s)
                relative = line["relative"]
                off = (vehicle[0] + relative["north"] - north, vehicle[1] + relative["east"] - east)
                absolute = (place[0] - north, place[1] - east)
                found[index] = Sample(
                    at_s, line["frame"], _norm(off), _square(off, relative["cov"]), _norm(absolute),
                    _square(absolute, line["cov"]),
                )  # fmt: skip
        return found


def _norm(off: tuple[float, float]) -> float:
    return sqrt(off[0] ** 2 + off[1] ** 2)


def _square(off: tuple[float, float], cov: Sequence[Sequence[float]]) -> float:
    if cov[0][0] * cov[1][1] - cov[0][1] ** 2 <= 0.0:
        return MOST_SQUARES
    return min(MOST_SQUARES, squared_distance(*off, (cov[0][0], cov[0][1], cov[1][1])))


class Tracks:
    """Samples of every track, and the true target of each."""

    def __init__(self, truth: TruthOf) -> None:
        self._truth = truth
        self._samples: dict[int, list[dict[int, Sample]]] = {}
        self.calibrated_s: float | None = None
        """Flight time of the first ``calibrated``."""

    def add(self, line: Line) -> None:
        """Process the next line of a targets file."""
        if line["type"] == "target" and line["state"] in ANSWERS and line["relative"] is not None:
            if line["lat"] is not None and (samples := self._truth.samples(line)):
                self._samples.setdefault(line["track"], []).append(samples)
        elif line["type"] == "calibration" and line["status"] == "calibrated" and self.calibrated_s is None:
            self.calibrated_s = self._truth.flight_s(line)

    def matched(self) -> tuple[dict[int, list[Sample]], int]:
        """Samples by true target, and the number of ghosts.

        A track belongs to the target that is nearest at the track's end, or to another within its 99.9 % ellipse. A
        target has one track at a time, the nearest first; a track that no target is left for is a ghost.
        """
        pairs = []
        for track, lines in self._samples.items():
            last = lines[-1]
            nearest = min(last, key=lambda k: last[k].relative_m)
            pairs += [(last[k].relative_m, track, k) for k in last
                      if k == nearest or last[k].relative_square < CHI2_999]  # fmt: skip
        found: dict[int, list[int]] = {}
        placed: set[int] = set()
        for _, track, index in sorted(pairs):
            if track not in placed and not any(self._overlap(track, other) for other in found.get(index, [])):
                found.setdefault(index, []).append(track)
                placed.add(track)
        samples = {
            index: sorted((line[index] for track in tracks for line in self._samples[track]), key=lambda s: s.flight_s)
            for index, tracks in found.items()
        }
        return samples, len(self._samples) - len(placed)

    def _overlap(self, one: int, other: int) -> bool:
        (a, b), (c, d) = (
            [next(iter(self._samples[track][end].values())).flight_s for end in (0, -1)] for track in (one, other)
        )
        return a <= d and c <= b


def flight_score(
    tracks: Tracks, simulation: Simulation, targets: int, first_seen_s: float | None, *, seed: int, cpu_s: float
) -> FlightScore:
    """The figures of one flight, from its tracks."""
    by_target, ghosts = tracks.matched()
    seconds, fps = simulation.options.seconds, simulation.options.camera.fps
    settled = {k: [s for s in each if s.flight_s >= SETTLED_SHARE * seconds] for k, each in by_target.items()}
    samples = [sample for each in settled.values() for sample in each]
    calibrated_s = None
    if tracks.calibrated_s is not None and first_seen_s is not None:
        calibrated_s = max(0.0, tracks.calibrated_s - first_seen_s)
    return FlightScore(
        seed=seed,
        targets=targets,
        missed=targets - len(by_target),
        ghosts=ghosts,
        relative_m=_rms(s.relative_m for s in samples),
        absolute_m=_rms(s.absolute_m for s in samples),
        relative_square=_mean(s.relative_square for s in samples),
        absolute_square=_mean(s.absolute_square for s in samples),
        relative_inside=_mean(float(s.relative_square <= CHI2_95) for s in samples),
        absolute_inside=_mean(float(s.absolute_square <= CHI2_95) for s in samples),
        calibrated_s=calibrated_s,
        cpu_s=cpu_s,
        cells={str(index): _cells(each, seconds, fps) for index, each in sorted(settled.items())},
    )


def _cells(samples: Sequence[Sample], seconds: float, fps: float) -> list[float | None]:
    """By the frame's number, which is the same for every estimator."""
    parts: list[list[float]] = [[] for _ in range(CELLS)]
    for sample in samples:
        share = (sample.frame / (fps * seconds) - SETTLED_SHARE) / (1.0 - SETTLED_SHARE)
        parts[min(CELLS - 1, max(0, int(share * CELLS)))].append(sample.relative_m)
    return [None if (value := _rms(part)) is None else float(f"{value:.3g}") for part in parts]


def _mean(values: Iterable[float]) -> float | None:
    found = list(values)
    return mean(found) if found else None


def _rms(values: Iterable[float]) -> float | None:
    square = _mean(value * value for value in values)
    return None if square is None else sqrt(square)


class KindScore(msgspec.Struct, frozen=True, kw_only=True):
    """The flights of one kind. Pairs are (median or mean over the flights, worst flight)."""

    flights: int
    answered: int
    relative_m: tuple[float, float]
    absolute_m: tuple[float, float]
    relative_square: tuple[float, float]
    absolute_square: tuple[float, float]
    relative_inside: float
    absolute_inside: float
    calibrated: int
    calibrated_s: float
    """Median of the flights, those that never were as the longest; inf: never."""
    missed: int
    targets: int
    ghosts: int
    cpu_s: float


def kind_score(flights: Sequence[FlightScore]) -> KindScore:
    """The figures of a kind: medians of errors, means of squares and shares."""

    def values(name: str) -> list[float]:
        return [value for each in flights if (value := getattr(each, name)) is not None]

    def pair(name: str, middle: Any) -> tuple[float, float]:
        found = values(name)
        return (middle(found), max(found)) if found else (inf, inf)

    shares = {name: values(name) for name in ("relative_inside", "absolute_inside")}
    return KindScore(
        flights=len(flights),
        answered=len(values("relative_m")),
        relative_m=pair("relative_m", median),
        absolute_m=pair("absolute_m", median),
        relative_square=pair("relative_square", mean),
        absolute_square=pair("absolute_square", mean),
        **{name: mean(found) if found else 0.0 for name, found in shares.items()},
        calibrated=len(values("calibrated_s")),
        calibrated_s=median(inf if each.calibrated_s is None else each.calibrated_s for each in flights),
        missed=sum(each.missed for each in flights),
        targets=sum(each.targets for each in flights),
        ghosts=sum(each.ghosts for each in flights),
        cpu_s=sum(each.cpu_s for each in flights),
    )
