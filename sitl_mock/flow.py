"""The autopilot's position by optical flow: its own local frame, which drifts by a share of the way flown."""

from __future__ import annotations

from math import hypot
from random import Random

from sitl_mock.flight import Flight
from sitl_mock.rotation import Vector

STEP_S = 0.1
"""Step of the integration of the way."""


class Flow:
    """Error of the local position: in one direction that the seed draws, each axis one sigma times the way flown."""

    def __init__(self, flight: Flight, drift: float, seed: int) -> None:
        rng = Random(f"{seed}/flow")
        self._flight = flight
        self._by_way = (drift * rng.gauss(0.0, 1.0), drift * rng.gauss(0.0, 1.0))
        self._ways_m = [0.0]
        """Way flown until each step."""

    def way_m(self, flight_s: float) -> float:
        """Horizontal way flown until an instant, metres."""
        whole = max(0.0, flight_s) / STEP_S
        while len(self._ways_m) <= int(whole) + 1:
            north, east, _ = self._flight.at((len(self._ways_m) - 0.5) * STEP_S).velocity
            self._ways_m.append(self._ways_m[-1] + hypot(north, east) * STEP_S)
        before, after = self._ways_m[int(whole)], self._ways_m[int(whole) + 1]
        return before + (whole - int(whole)) * (after - before)

    def error(self, flight_s: float) -> Vector:
        """Local position minus truth, NED, metres."""
        way_m = self.way_m(flight_s)
        return (self._by_way[0] * way_m, self._by_way[1] * way_m, 0.0)
