"""Gross mistakes in the mount, noticed and named rather than estimated: an image upside down, turned, or mirrored.

A target that stands makes its sights meet on the ground under the right mount, and scatters them over the field under
a wrong one, too far for any track to be believed. So single sights are kept whether or not they belong to a track, and
tried with the image turned and mirrored: if that gathers them, it is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from statistics import median

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3, multiply, transform
from fwav_companion.nouns import GroundFix

Turn = tuple[int, int, int, int]
"""x' = a x + b y, y' = c x + d y of the camera's ray."""

CANDIDATES: tuple[tuple[str, Turn], ...] = (
    ("the image is upside down: turn the mount by 180 degrees about the camera's axis", (-1, 0, 0, -1)),
    ("the image is turned by 90 degrees counterclockwise", (0, -1, 1, 0)),
    ("the image is turned by 90 degrees clockwise", (0, 1, -1, 0)),
    ("the image is mirrored left to right", (-1, 0, 0, 1)),
    ("the image is mirrored top to bottom", (1, 0, 0, -1)),
)
"""What is wrong, and the turn that rights it."""
AS_CONFIGURED: Turn = (1, 0, 0, 1)

EVERY_NS = 200 * NS_PER_MS
"""Between two sights that are kept: sixty of them span many headings."""
MOST_KEPT = 60
LEAST_KEPT = 30
WILD = 0.12
"""Scatter over height under the configured mount, above which it is asked why: a delay of 35 ms makes as much on a
flapping camera, a mount off by a few degrees less. Neither is gathered by a turn of the image."""
GATHERED = 0.45
"""Scatter against that of the configured mount, below which a candidate explains it: a metre of wandering position is
left even by the right one."""


class _Sight(msgspec.Struct, frozen=True, gc=False):
    host_ns: HostNs
    label: str
    ray: Vector3
    ned_from_camera: Matrix3
    camera_ned: Vector3
    drop_m: float


class Suspicion(msgspec.Struct, frozen=True):
    """The single sights so far, and what they say. Immutable."""

    sights: tuple[_Sight, ...] = ()
    fresh: int = 0
    """Kept since the last judgement."""
    text: str = ""
    """What is wrong, as a sentence for people; empty: nothing."""

    def seen(self, fixes: Sequence[GroundFix]) -> Suspicion:
        """After a frame; only one that saw a single thing tells what was seen."""
        if len(fixes) != 1:
            return self
        sighting = fixes[0].sighting
        if self.sights and sighting.frame_host_ns - self.sights[-1].host_ns < EVERY_NS:
            return self
        ned_from_body = matrix_from_quaternion(sighting.state.ned_from_carrier)
        sight = _Sight(
            sighting.frame_host_ns,
            sighting.detection.label,
            sighting.ray.direction,
            multiply(ned_from_body, sighting.body_from_camera),
            sighting.camera_ned,
            fixes[0].position_ned[2] - sighting.camera_ned[2],
        )
        sights = (*self.sights, sight)[-MOST_KEPT:]
        if len(sights) < LEAST_KEPT or self.fresh + 1 < LEAST_KEPT // 2:
            return Suspicion(sights, self.fresh + 1, self.text)
        return Suspicion(sights, 0, _judged(sights))


def _judged(sights: Sequence[_Sight]) -> str:
    label = sights[-1].label
    own = [sight for sight in sights if sight.label == label]
    height = median(sight.drop_m for sight in own)
    configured = _scatter(own, AS_CONFIGURED)
    if len(own) < LEAST_KEPT or configured < WILD * height:
        return ""
    scatter, text = min((_scatter(own, turn), text) for text, turn in CANDIDATES)
    return text if scatter < GATHERED * configured else ""


def _scatter(sights: Sequence[_Sight], turn: Turn) -> float:
    """Median distance of the ground points from their middle, metres; far where half the rays miss the ground."""
    points = [point for sight in sights if (point := _ground_point(sight, turn)) is not None]
    if 2 * len(points) < len(sights):
        return float("inf")
    north, east = median(n for n, _ in points), median(e for _, e in points)
    return median(hypot(n - north, e - east) for n, e in points)


def _ground_point(sight: _Sight, turn: Turn) -> tuple[float, float] | None:
    (x, y, z), (a, b, c, d) = sight.ray, turn
    north, east, down = transform(sight.ned_from_camera, (a * x + b * y, c * x + d * y, z))
    if down < 0.05:
        return None
    reach = sight.drop_m / down
    return (sight.camera_ned[0] + reach * north, sight.camera_ned[1] + reach * east)
