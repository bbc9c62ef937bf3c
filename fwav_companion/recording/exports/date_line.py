"""Lines and rings cut in two where they cross the 180th meridian, as RFC 7946 (3.1.9) asks. Pure.

Of two points that follow one another, the shorter way is meant. A ring round a pole is not cut: no ellipse holds one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

Place = tuple[float, float]
"""Longitude, latitude, degrees."""
HALF = 180.0
WHOLE = 360.0


def cut_line(places: Sequence[Place]) -> list[list[Place]]:
    """The stretches between two crossings; each begins where the one before ends, on the other side's meridian."""
    stretches: list[list[Place]] = [[places[0]]]
    for before, place in pairwise(places):
        side = _crossed(before, place)
        if side:
            lat = _lat_at(side * HALF, before, (place[0] + side * WHOLE, place[1]))
            stretches[-1].append((side * HALF, lat))
            stretches.append([(-side * HALF, lat)])
        stretches[-1].append(place)
    return stretches


def cut_ring(ring: Sequence[Place]) -> list[list[Place]]:
    """A convex closed ring as one or two, each closed and run through the same way round."""
    line = _unwrapped(ring)
    lons = [lon for lon, _ in line]
    side = 1 if max(lons) > HALF else -1 if min(lons) < -HALF else 0
    if not side:
        return [list(ring)]
    here = _kept(line, side * HALF, beyond=-side)
    there = _kept(line, side * HALF, beyond=side)
    both = (here, [(lon - side * WHOLE, lat) for lon, lat in there])
    return [part for part in both if any(lon != part[0][0] for lon, _ in part)]  # one that only touches has no inside


def _crossed(before: Place, place: Place) -> int:
    """1 eastward over the meridian, -1 westward, 0 not."""
    apart = place[0] - before[0]
    return 1 if apart < -HALF else -1 if apart > HALF else 0


def _unwrapped(places: Iterable[Place]) -> list[Place]:
    """Longitudes that go on beyond 180."""
    line: list[Place] = []
    turns = 0
    before: Place | None = None
    for place in places:
        turns += _crossed(before, place) if before else 0
        line.append((place[0] + WHOLE * turns, place[1]))
        before = place
    return line


def _kept(ring: Sequence[Place], meridian: float, beyond: int) -> list[Place]:
    """What of a closed ring lies on this side of the meridian (1 east, -1 west), closed along it."""
    kept: list[Place] = []
    for before, place in pairwise(ring):
        inside, comes = ((lon - meridian) * beyond >= 0.0 for lon in (before[0], place[0]))
        if inside:
            kept.append(before)
        if inside != comes:
            kept.append((meridian, _lat_at(meridian, before, place)))
    return [*kept, kept[0]]


def _lat_at(meridian: float, before: Place, place: Place) -> float:
    share = (meridian - before[0]) / (place[0] - before[0])
    return before[1] + share * (place[1] - before[1])
