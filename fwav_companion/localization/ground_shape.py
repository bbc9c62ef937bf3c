"""How the shape of the ground about a ray's end adds to its uncertainty, and when one claim cannot hold it.

The ray's angle in its vertical plane is normal; the distance of the ground at each angle is known. An edge near the ray
makes two groups of distances: one before it, one behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, sqrt

import msgspec

from fwav_companion.geometry.ellipses import ELLIPSE_95
from fwav_companion.geometry.vectors import Vector3, dot
from fwav_companion.localization.ground_profile import turned_up

TURN_SIGMAS = tuple(0.25 * step for step in range(-10, 11))
"""Angles at which the distance of the ground is taken, in sigmas: a jump is placed to an eighth of a sigma."""
TURN_WEIGHTS = tuple(exp(-0.5 * sigmas * sigmas) for sigmas in TURN_SIGMAS)
"""Density of a normal distribution at these angles, not normalised."""
NEEDED_TURNS = TURN_SIGMAS.index(2.0) + 1
"""Angles that need a place on the model: rays up to two sigmas shallower."""
SIDE_SIGMAS, SIDE_WEIGHT = sqrt(3.0), 1.0 / 6.0
"""Outer points of the three-point Gauss-Hermite rule, and the weight of each."""
MOST_TURN = 0.3
"""Largest sigma of the angle that is examined, radians."""
MOST_REACH = 0.3
"""Largest reach that is examined: two sigma of it still lead to the plane about the point."""
EDGE_SIGMAS = 1.645
"""Places beyond this angle have less than 5 % of the probability: a claim of 90 % need not hold them."""
MOST_WIDENED = 1.5
"""Largest factor by which a claim is widened so that its 95 % ellipse holds every place within EDGE_SIGMAS."""
LEAST_EDGE_M = 2.0
"""Distance of two places, metres, up to which they count as one."""
LEAST_UPRIGHT = 0.02
"""Least down component of a normal for which an error along the ray is expressed as one of the ground's level."""
LEAST_PLANAR_DESCENT = 0.3
"""Least descent of a turned ray to the plane about the point, as a part of the ray's own descent."""
MOST_SCATTER = 0.15
"""Largest scatter of the distance by the ground's shape, as a part of the distance: the localizer's LARGEST_STRETCH."""


class RayOnSurface(msgspec.Struct, frozen=True, gc=False):
    """A unit ray with its end on a surface."""

    direction: Vector3
    normal: Vector3
    """Unit normal of the surface at the end, NED, downward."""
    distance_m: float

    @property
    def descent(self) -> float:
        """Cosine of the angle between ray and normal."""
        return dot(self.normal, self.direction)

    def planar_m(self, turned: Vector3) -> float:
        """Distance along a turned ray to the plane about the end; at most several times that of the ray itself."""
        return self.distance_m * self.descent / max(dot(self.normal, turned), LEAST_PLANAR_DESCENT * self.descent)


def level_scatter_m(
    ray: RayOnSurface, sigma: float, distances: Sequence[float], *, linear_m: float, side_m2: float = 0.0
) -> float | None:
    """One sigma of the ground's level that stands for its shape, metres; None where one claim cannot hold the places.

    ``sigma``: of the ray's angle, radians. ``distances``: at TURN_SIGMAS, perhaps fewer. ``linear_m``: sigma along the
    ray on a plane. ``side_m2``: variance by turns to the sides. A claim holds the places where its 95 % ellipse holds
    every one within EDGE_SIGMAS; it may be widened for that by MOST_WIDENED.
    """
    variance = farthest = 0.0
    for weight, sigmas, distance_m in zip(TURN_WEIGHTS, TURN_SIGMAS, distances, strict=False):
        variance += weight * (distance_m - ray.planar_m(turned_up(ray.direction, sigmas * sigma))) ** 2
        if abs(sigmas) <= EDGE_SIGMAS:
            farthest = max(farthest, abs(distance_m - ray.distance_m))
    variance = variance / sum(TURN_WEIGHTS[: len(distances)]) + side_m2
    claimed_m = sqrt(linear_m * linear_m + variance)
    if farthest > max(ELLIPSE_95 * claimed_m, LEAST_EDGE_M):
        if farthest > ELLIPSE_95 * MOST_WIDENED * claimed_m:
            return None
        variance = (farthest / ELLIPSE_95) ** 2 - linear_m * linear_m
    if sqrt(variance) > MOST_SCATTER * ray.distance_m:
        return None
    return sqrt(variance) * ray.descent / max(ray.normal[2], LEAST_UPRIGHT)
