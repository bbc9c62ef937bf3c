"""The surface as a function of place, exact: hills, trees and houses; what it hides from the camera.

Heights are metres above the take-off ground, which is level 0 at home.
"""

from __future__ import annotations

from collections import defaultdict
from math import cos, exp, hypot, sin
from random import Random
from typing import NamedTuple

from sitl_mock.options import Options
from sitl_mock.rotation import Vector

HILL_NORTH_M, HILL_EAST_M = 40.0, 55.0
"""Lengths over which the hills' phase advances by one radian."""
REACH = 4.0
"""Radius of a tree in its own sigmas: beyond it the crown is below 4 mm."""
HOUSE_HALF_M, HOUSE_HEIGHT_M = 5.0, 6.0
BUCKET_M = 16.0
STEP_M = 0.3
"""Step along a line of sight: less than a trunk's width."""
GRAZE_M = 0.3
"""Distance from the target at which a line of sight begins: the ground at the target itself hides nothing."""


class Tree(NamedTuple):
    """A round crown on the ground: a Gaussian bell."""

    north: float
    east: float
    height_m: float
    sigma_m: float

    def height_at(self, north: float, east: float) -> float:
        """Height above the ground, metres."""
        off = hypot(north - self.north, east - self.east) / self.sigma_m
        return self.height_m * exp(-0.5 * off * off) if off < REACH else 0.0

    @property
    def reach_m(self) -> float:
        """Distance beyond which the tree has no height."""
        return REACH * self.sigma_m


class House(NamedTuple):
    """A block with a flat roof, its sides along north and east."""

    north: float
    east: float

    def height_at(self, north: float, east: float) -> float:
        """Height above the ground, metres."""
        inside = abs(north - self.north) < HOUSE_HALF_M and abs(east - self.east) < HOUSE_HALF_M
        return HOUSE_HEIGHT_M if inside else 0.0

    @property
    def reach_m(self) -> float:
        """Half side."""
        return HOUSE_HALF_M


class Surface:
    """The surface of one flight; the seed decides where its trees and houses are."""

    def __init__(self, options: Options) -> None:
        self._o, self._centre = options.surface, options.flight.centre
        things = [*self._chosen(), *self._drawn(options)]
        self.is_level = not things and not self._o.relief_m
        """Whether the surface is the plane of the take-off ground."""
        self._buckets: dict[tuple[int, int], list[Tree | House]] = defaultdict(list)
        for thing in things:
            self._keep(thing)
        self._home_m = 0.0
        self._home_m = self.height_m(*options.autopilot.home_m)
        tallest = max((one.height_m if isinstance(one, Tree) else HOUSE_HEIGHT_M for one in things), default=0.0)
        self.highest_m = 2.0 * tallest + self._o.relief_m - self._home_m
        """Height that nothing exceeds: two crowns may overlap."""

    def height_m(self, north: float, east: float) -> float:
        """Height at a place in the world's NED, metres."""
        if self.is_level:
            return 0.0
        height = self._o.relief_m * sin(north / HILL_NORTH_M) * cos(east / HILL_EAST_M) - self._home_m
        for thing in self._buckets.get((int(north // BUCKET_M), int(east // BUCKET_M)), ()):
            height += thing.height_at(north, east)
        return height

    def hides(self, place: Vector, eye: Vector) -> bool:
        """Whether the surface lies between a place on it and the camera, both NED."""
        if self.is_level:
            return False
        way = [b - a for a, b in zip(place, eye, strict=True)]
        length = hypot(*way)
        north, east, down = (part / length for part in way)
        at = GRAZE_M
        while at < length and -(place[2] + at * down) <= self.highest_m:
            if self.height_m(place[0] + at * north, place[1] + at * east) > -(place[2] + at * down) + GRAZE_M:
                return True
            at += STEP_M
        return False

    def _keep(self, thing: Tree | House) -> None:
        first, last = (
            (int((thing.north + side) // BUCKET_M), int((thing.east + side) // BUCKET_M))
            for side in (-thing.reach_m, thing.reach_m)
        )
        for row in range(first[0], last[0] + 1):
            for column in range(first[1], last[1] + 1):
                self._buckets[row, column].append(thing)

    def _chosen(self) -> list[Tree]:
        north, east = self._centre
        return [Tree(north + n, east + e, height, height / 6.0) for n, e, height in self._o.tree_at]

    def _drawn(self, options: Options) -> list[Tree | House]:
        rng = Random(f"{options.seed}/surface")
        return [
            *(Tree(*self._place(options, rng, 0.0), rng.uniform(4.0, 9.0), rng.uniform(1.5, 3.0))
              for _ in range(self._o.trees)),
            *(House(*self._place(options, rng, HOUSE_HALF_M * 1.42)) for _ in range(self._o.houses)),
        ]  # fmt: skip

    def _place(self, options: Options, rng: Random, half_m: float) -> tuple[float, float]:
        """A place that keeps clear of the targets and of home."""
        half, clear_m = self._o.half_size_m, self._o.clear_m + half_m
        (north, east), home = self._centre, options.autopilot.home_m
        while True:
            n, e = rng.uniform(-half, half), rng.uniform(-half, half)
            near = any(hypot(n - target.north, e - target.east) < clear_m for target in options.targets)
            if not near and hypot(n + north - home[0], e + east - home[1]) > 4.0 * clear_m:
                return n + north, e + east
