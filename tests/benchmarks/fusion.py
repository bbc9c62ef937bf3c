"""Fusion of a fleet: CPU until all that 200 vehicles report is fused, beside that of 10 vehicles.

``python -m tests.benchmarks.fusion``
"""

from __future__ import annotations

import numpy as np

from fwav_companion.ground.fusion.fleet_fusion import FleetFusion
from fwav_companion.ground.fusion.reported_tracks import ReportedTrack
from tests.benchmarks.figure import Figure, interleaved

FEW, MANY, TRACKS = 10, 200, 64
EXTENT_M = 60.0
STEP_S = 0.1
"""Less than the fusion's own: a report must not be old before its turn comes."""
START_UNIX = 1_790_000_000.0
SIGMAS = np.array([1.0, 1.0, 0.01])
"""A vehicle's own errors: north and east, metres, and heading, radians."""
NOISE_M = 0.2
MOST_GROWTH = 2.0
"""Most growth of the cost beside that of the number of vehicles."""


def reports(vehicles: int) -> dict[str, list[ReportedTrack]]:
    """What each vehicle reports of the same persons on one field."""
    draw = np.random.default_rng(8)
    places = draw.uniform(0.0, EXTENT_M, (TRACKS, 2))
    return {f"v{number}": [_track(at, places[at] + draw.normal(0.0, NOISE_M, 2), f"v{number}") for at in range(TRACKS)]
            for number in range(vehicles)}  # fmt: skip


def _track(number: int, position: np.ndarray, vehicle: str) -> ReportedTrack:
    return ReportedTrack(
        vehicle=vehicle,
        track=number,
        label="person",
        confirmed=True,
        position=position,
        noise=NOISE_M**2 * np.eye(2),
        shared=np.zeros((2, 2)),
        jacobian=np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        at_unix=START_UNIX,
        seen_unix=START_UNIX,
    )


class Fleet:
    """A fleet whose reports are all fused."""

    def __init__(self, reported: dict[str, list[ReportedTrack]]) -> None:
        self._reported, self._fusion, self._now, self.steps = reported, FleetFusion(), START_UNIX, 0
        self._report()
        while sum(len(target.members) for target in self._fusion.targets) < len(reported) * TRACKS:
            self._step()
            if self.steps > 30:
                raise AssertionError("some tracks are never fused")

    def again(self) -> None:
        """Fuse the reports that follow."""
        self._report()
        self._step()

    def _report(self) -> None:
        for name, tracks in self._reported.items():
            self._fusion.on_tracks(name, tracks, SIGMAS, self._now)

    def _step(self) -> None:
        self._fusion.step(self._now)
        self._now += STEP_S
        self.steps += 1


def measure() -> list[Figure]:
    few, many = reports(FEW), reports(MANY)
    fleets = Fleet(few), Fleet(many)
    first_s = interleaved(lambda: Fleet(few), lambda: Fleet(many), rounds=3)
    later_s = interleaved(fleets[0].again, fleets[1].again, rounds=5)
    return [_growth("first reports", *first_s), _growth("a later report", *later_s)]


def _growth(what: str, few_s: float, many_s: float) -> Figure:
    """The cost of many vehicles over that of few, over their number."""
    detail = f"{FEW} vehicles {few_s * 1e3:.0f} ms, {MANY} {many_s * 1e3:.0f} ms, {TRACKS} tracks each"
    ratio = many_s / few_s / (MANY / FEW)
    return Figure(f"fusion of a fleet, {what}: a vehicle's cost beside that of ten", ratio, MOST_GROWTH, False, detail)


if __name__ == "__main__":
    print(*measure(), sep="\n")
