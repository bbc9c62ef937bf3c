"""Gross mistakes in the mount, noticed and named rather than estimated: an image upside down, turned or mirrored, or a
camera that looks elsewhere than it is told to.

A target that stands makes its sights meet on the ground under the right mount, and scatters them over the field under
a wrong one, too far for any track to be believed. So single sights are kept whether or not they belong to a track, and
tried under other mounts: if one of those gathers them, it is told, and by how much all that is told may be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import acos, degrees, pi, radians
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.mounts import corrected_mount, euler_from_body_from_camera
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, multiply, scale
from fwav_companion.self_calibration.delayed_poses import VehiclePose
from fwav_companion.self_calibration.single_sights import (
    CommonPoint,
    SingleSight,
    meeting,
    misplaced_m,
    missed,
    sight_of,
)
from fwav_companion.types import GroundFix, VehicleState

Turn: TypeAlias = tuple[int, int, int, int]
"""x' = a x + b y, y' = c x + d y of the camera's ray."""

CANDIDATES: tuple[tuple[str, Turn], ...] = (
    ("the image is upside down: turn the mount by 180 degrees about the camera's axis", (-1, 0, 0, -1)),
    ("the image is turned by 90 degrees counterclockwise", (0, -1, 1, 0)),
    ("the image is turned by 90 degrees clockwise", (0, 1, -1, 0)),
    ("the image is mirrored left to right", (-1, 0, 0, 1)),
    ("the image is mirrored top to bottom", (1, 0, 0, -1)),
)
"""What is wrong, and the turn that rights it."""

EVERY_NS = 200 * NS_PER_MS
"""Between two sights that are kept: sixty of them span many headings."""
MOST_KEPT = 80
LEAST_KEPT = 30
FRESH = 10
"""Sights between two judgements, two seconds and more."""
FORETOLD_NS = 3 * NS_PER_S
"""By then who walks where nobody should is 4 m away."""
LEAST_FITTED, LEAST_FORETOLD = 15, 8
ANOTHER_DELAY_S = 0.01
"""A delay that was found is so different: the sights before it were of other attitudes."""
WILD = 0.12
"""Spread under the configured mount, rad, above which it is asked why: a delay of 35 ms makes as much on a flapping
camera, a mount off by a few degrees less. Neither is gathered by another mount."""
CLOSE = 0.08
"""Spread up to which sights meet: 35 ms of delay leave 0.07 on a flapping camera, a metre of wandering 0.05."""
GATHERED = 0.45
"""Spread against that of the configured mount, below which a candidate explains it: a metre of wandering position is
left even by the right one."""
AS_GOOD, SHARP = 1.25, 0.02
"""Spread against that of mounts near it, up to which a turned image is the simpler word for it, or by itself: a degree,
what pixels leave."""
SMALL = radians(8.0)
"""Where a mount off by less gathers the sights, too, there is no gross mistake: few views hardly tell one from another.
Self-calibration finds the mount then, and the targets are doubted until it did."""
NAMED = radians(12.0)
"""A mount off by more is named. Of mounts off by 10 degrees self-calibration found all, of those off by 15 nine in ten,
by 20 half."""

STEPS = tuple(map(radians, (40.0, 20.0, 10.0, 5.0, 2.0)))
"""Of the search among mounts: the first reaches half way to the next start."""
SMALL_STEPS = tuple(map(radians, (4.0, 2.0, 1.0)))
QUARTER = radians(90.0)
STARTS: tuple[Vector3, ...] = (
    ZERO3,
    (QUARTER, 0.0, 0.0),
    (-QUARTER, 0.0, 0.0),
    (0.0, QUARTER, 0.0),
    (0.0, -QUARTER, 0.0),
    (0.0, 0.0, QUARTER),
    (0.0, 0.0, -QUARTER),
    (0.0, 0.0, 2.0 * QUARTER),
)
"""Rotation vectors, body axes."""
AXES: tuple[Vector3, ...] = (
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
)


class MountMistake(msgspec.Struct, frozen=True):
    """A mount that explains what was seen, where the configured one does not."""

    there: CommonPoint
    text: str
    """As a sentence for people; empty: no gross one."""
    misplaced_m: float
    """So far off lies what is told of places, median."""


class MountCheck(msgspec.Struct, frozen=True):
    """The single sights so far, and what they say. Immutable."""

    foretold_ns: int = FORETOLD_NS
    """So far ahead a mount must tell what is seen, before it is believed."""
    sights: tuple[SingleSight, ...] = ()
    fresh: int = 0
    """Kept since the last judgement."""
    mistake: MountMistake | None = None

    @property
    def text(self) -> str:
        """What is grossly wrong, as a sentence for people; empty: nothing."""
        return "" if self.mistake is None else self.mistake.text

    def seen(self, fixes: Sequence[GroundFix], stood: Callable[[VehicleState], VehiclePose]) -> MountCheck:
        """After a frame; only one that saw a single thing tells what was seen. ``stood``: how the vehicle stood at a
        capture, by the delay that is known by now.
        """
        if len(fixes) != 1 or (self.sights and fixes[0].sighting.frame_host_ns - self.sights[-1].host_ns < EVERY_NS):
            return self
        sight = sight_of(fixes[0], stood(fixes[0].sighting.state))
        if self.sights and abs(sight.delay_s - self.sights[-1].delay_s) > ANOTHER_DELAY_S:
            return MountCheck(self.foretold_ns, (sight,), mistake=self.mistake)
        sights = (*self.sights, sight)[-MOST_KEPT:]
        own = [each for each in sights if each.label == sight.label]
        if len(own) < LEAST_KEPT or self.fresh + 1 < FRESH:
            return MountCheck(self.foretold_ns, sights, self.fresh + 1, self.mistake)
        return MountCheck(self.foretold_ns, sights, 0, _judged(own, self.mistake, self.foretold_ns))


def _judged(sights: Sequence[SingleSight], before: MountMistake | None, foretold_ns: int) -> MountMistake | None:
    """What is wrong by these sights; what was found ``before`` stands until the configured mount gathers them so much
    better.
    """
    configured = meeting(sights, sights[-1].body_from_camera)
    if before is not None:
        there = meeting(sights, before.there.body_from_camera)
        before = None if configured.spread < GATHERED * there.spread else _mistake(sights, there, before.text)
    if configured.spread < WILD or (before is not None and before.text):
        return before
    image = _image(sights, configured)
    if image is not None:
        return _mistake(sights, *image)
    suspect = _foretelling(sights, configured, foretold_ns)
    if suspect is None:
        return before
    there = _searched(sights, [suspect], SMALL_STEPS)
    return _mistake(sights, there, _named(configured.body_from_camera, there.body_from_camera))


def _mistake(sights: Sequence[SingleSight], there: CommonPoint, text: str) -> MountMistake:
    return MountMistake(there, text, misplaced_m(sights, there))


def _enough(configured: CommonPoint) -> float:
    """The spread below which another mount explains what this one does not."""
    return min(CLOSE, GATHERED * configured.spread)


def _image(sights: Sequence[SingleSight], configured: CommonPoint) -> tuple[CommonPoint, str] | None:
    """The turned or mirrored image that explains these sights, and better than a mount a little off does."""
    mount = configured.body_from_camera
    turned = [(meeting(sights, _turned(mount, turn)), text) for text, turn in CANDIDATES]
    best, text = min(turned, key=lambda each: each[0].spread)
    if best.spread >= _enough(configured):
        return None
    others = _searched(sights, [configured, best], SMALL_STEPS)
    return (best, text) if best.spread < max(SHARP, AS_GOOD * others.spread) else None


def _foretelling(sights: Sequence[SingleSight], configured: CommonPoint, foretold_ns: int) -> CommonPoint | None:
    """A mount that explains the earlier sights, and thereby the last ones.

    Three numbers can be fitted to much: to a target that walks, too. What they foretell then is where it was.
    """
    until_ns = sights[-1].host_ns - foretold_ns
    earlier = [each for each in sights if each.host_ns <= until_ns]
    last = sights[len(earlier) :]
    if len(earlier) < LEAST_FITTED or len(last) < LEAST_FORETOLD:
        return None
    suspect = _suspect(earlier, meeting(earlier, configured.body_from_camera))
    return suspect if suspect is not None and missed(last, suspect) < _enough(configured) else None


def _suspect(sights: Sequence[SingleSight], configured: CommonPoint) -> CommonPoint | None:
    """The mount that explains these sights, one near the configured one first; None: there is none."""
    near = _searched(sights, [configured], SMALL_STEPS, SMALL)
    if near.spread < _enough(configured):
        return near
    starts = [meeting(sights, corrected_mount(configured.body_from_camera, start)) for start in STARTS]
    found = _searched(sights, starts, STEPS)
    return found if found.spread < _enough(configured) else None


def _spread(there: CommonPoint) -> float:
    return there.spread


def _turned(mount: Matrix3, turn: Turn) -> Matrix3:
    a, b, c, d = turn
    return multiply(mount, ((a, b, 0.0), (c, d, 0.0), (0.0, 0.0, 1.0)))


def _mirrors(turn: Turn) -> bool:
    a, b, c, d = turn
    return a * d < b * c


def _searched(
    sights: Sequence[SingleSight], starts: Sequence[CommonPoint], steps: Sequence[float], within: float = pi
) -> CommonPoint:
    """The rotation of the mount that gathers the sights best: from the best start by steps about body axes."""
    best = start = min(starts, key=_spread)
    for step in steps:
        while True:
            near = [corrected_mount(best.body_from_camera, scale(axis, step)) for axis in AXES]
            tried = [meeting(sights, each) for each in near if _angle(start.body_from_camera, each) <= within]
            found = min(tried, key=_spread, default=best)
            if found.spread >= best.spread:
                break
            best = found
    return best


def _angle(a: Matrix3, b: Matrix3) -> float:
    """Of the rotation that carries one mount to the other, rad."""
    trace = sum(x * y for row, other in zip(a, b, strict=True) for x, y in zip(row, other, strict=True))
    return acos(max(-1.0, min(1.0, 0.5 * (trace - 1.0))))


def _named(configured: Matrix3, found: Matrix3) -> str:
    """What is wrong with a mount, in words; none where it is off by little. A turned image on a mount a little off is
    still a turned image.
    """
    off = _angle(configured, found)
    if off < NAMED:
        return ""
    for text, turn in CANDIDATES:
        if not _mirrors(turn) and _angle(_turned(configured, turn), found) < NAMED:
            return text
    roll, pitch, yaw = (round(degrees(angle)) for angle in euler_from_body_from_camera(found))
    return (
        f"it is off by about {degrees(off):.0f} degrees: what is seen meets in one place with about "
        f"roll_deg = {roll}, pitch_deg = {pitch}, yaw_deg = {yaw}"
    )
