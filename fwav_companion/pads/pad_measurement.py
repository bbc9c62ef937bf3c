"""Which of a picture's tags measure a pad, and the pose that they give together.

All corners of all tags that count are solved at once (:func:`pad_pose`), so that the pose does not jump where tags come
and go. Left out are a second copy of a tag, and a tag that contradicts the others: its corners are off by more than
their noise and by more than a pad is built wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fwav_companion.pads.corner_order import SHIFTS
from fwav_companion.pads.pad_layout import PadLayout
from fwav_companion.pads.pad_pose import Array, PadPose, SeenPoints, level_pose, pad_pose
from fwav_companion.types import PadContradiction

MOST_SQUARE: Final = 16.0
"""Mean squared residual of a tag's corners, over 2 variances, beyond which it may contradict the others: 4 sigmas."""
LEAST_OFF_M: Final = 0.02
"""Least displacement of a contradicting tag, metres: less is how pads are built."""
LEAST_OFF_SHARE: Final = 0.01
"""The same as a share of the range: lenses are calibrated to a few pixels over the whole picture."""
FITTING_SQUARES: Final = 1e-4
"""Sum of squares over that of the rays about their mean below which the known first corner is right: another one turns
each tag by 90 degrees about its own centre, or all places by 90 degrees."""
SHIFTED_SHARE: Final = 0.1
"""Sum of squares with another first corner over that with the known one, below which the other is right."""


@dataclass(frozen=True)
class TagSight:
    """One detection of a pad's tag; NED axes about the reference camera."""

    index: int
    """Index of its detection in the picture."""
    tag: int
    """Number of the tag on its pad."""
    rays: Array
    """(4, 3) unit rays to its corners, clockwise in the image from the detector's first corner, NED."""
    pixel_from_ray: Array
    """(4, 2, 3) d(pixel)/d(ray), NED."""
    seen: NDArray[np.bool_]
    """(4,) whether the picture shows the corner."""
    camera: Array
    """(3,) camera at the instant of the tag's row, minus the reference camera, metres."""
    sigma_px: float
    """One sigma of a corner, each axis, pixels."""
    side_px: float
    """Shortest side in the image, pixels."""

    @property
    def direction(self) -> Array:
        """(3,) mean direction of the corners that are seen, NED, of no particular length."""
        direction: Array = self.rays[self.seen].mean(axis=0)
        return direction


@dataclass(frozen=True)
class PadMeasurement:
    """A pad by one picture."""

    pose: PadPose
    middle: Array
    """(3,) mean of the corners that count, on the pad, metres."""
    used: tuple[int, ...]
    """Indices of the detections that count; the largest tag's first."""
    copies: tuple[int, ...]
    """Indices of second copies of a tag."""
    left_out: tuple[int, ...]
    """Indices of the detections of contradicting tags."""
    contradictions: tuple[PadContradiction, ...]
    shift: int
    """Number of corners by which the detector's first corner follows the upper left one."""


def measured_pad(
    layout: PadLayout, sights: Sequence[TagSight], *, shift: int, expected: PadPose | None
) -> PadMeasurement | None:
    """The pad by the sights of its tags; None where they do not give a pose.

    ``shift``: of the detector's first corner, as known so far. ``expected``: the pad's predicted pose, which decides
    between two copies of a tag; None before the first picture.
    """
    chosen, copies = without_copies(layout, sights, shift, expected)
    shift = _known_shift(layout, chosen, shift)
    left_out: list[TagSight] = []
    found: list[PadContradiction] = []
    while True:
        points = seen_points(layout, chosen, shift)
        pose = pad_pose(points)
        if pose is None:
            return None
        worst = _contradicting(layout, chosen, points, pose, shift) if len(chosen) > 1 else None
        if worst is None:
            break
        sight, contradiction = worst
        chosen = [each for each in chosen if each is not sight]
        left_out.append(sight)
        found.append(contradiction)
    used = sorted(chosen, key=lambda sight: -sight.side_px)
    return PadMeasurement(
        pose=_inflated(pose, points),
        middle=points.at.mean(axis=0),
        used=tuple(sight.index for sight in used),
        copies=tuple(sight.index for sight in copies),
        left_out=tuple(sight.index for sight in left_out),
        contradictions=tuple(found),
        shift=shift,
    )


def seen_points(layout: PadLayout, sights: Sequence[TagSight], shift: int) -> SeenPoints:
    """The corners of all sights that the picture shows."""
    seen = np.concatenate([sight.seen for sight in sights])
    at = [np.roll(layout.corners[sight.tag], -shift, axis=0) for sight in sights]
    each = np.repeat(np.arange(len(sights)), 4)
    return SeenPoints(
        at=np.concatenate(at),
        rays=np.concatenate([sight.rays for sight in sights]),
        pixel_from_ray=np.concatenate([sight.pixel_from_ray for sight in sights]),
        camera=np.array([sight.camera for sight in sights])[each],
        sigma_px=np.array([sight.sigma_px for sight in sights])[each],
        tag=each,
    ).only(seen)


def without_copies(
    layout: PadLayout, sights: Sequence[TagSight], shift: int, expected: PadPose | None
) -> tuple[list[TagSight], list[TagSight]]:
    """The sights with each tag once, and the others.

    Of two copies, one of which is a picture of the tag, the one counts that is nearer to where the pad's other tags
    have it, else to where the pad is expected, else the larger one.
    """
    by_tag: dict[int, list[TagSight]] = {}
    for sight in sights:
        by_tag.setdefault(sight.tag, []).append(sight)
    alone = [same[0] for same in by_tag.values() if len(same) == 1]
    if len(alone) == len(sights):
        return alone, []
    pose = pad_pose(seen_points(layout, alone, shift)) if alone else None
    pose = pose or expected
    chosen, copies = list(alone), list[TagSight]()
    for tag, same in by_tag.items():
        if len(same) > 1:
            best = max(same, key=lambda sight: sight.side_px)
            if pose is not None:
                place = pose.place(layout.centre(tag))
                best = max(same, key=lambda sight: _cosine(sight.direction, place))
            chosen.append(best)
            copies.extend(sight for sight in same if sight is not best)
    return chosen, copies


def _cosine(a: Array, b: Array) -> float:
    return float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))


def _known_shift(layout: PadLayout, sights: Sequence[TagSight], shift: int) -> int:
    """The detector's first corner: the known one, unless two tags fit by another one alone."""
    if len(sights) < 2 or _level_squares(seen_points(layout, sights, shift)) < FITTING_SQUARES:
        return shift
    squares = [_level_squares(seen_points(layout, sights, each)) for each in SHIFTS]
    best = min(SHIFTS, key=lambda each: squares[each])
    return best if squares[best] < SHIFTED_SHARE * squares[shift] else shift


def _level_squares(points: SeenPoints) -> float:
    """Sum of the squared residuals of a level pad, over that of the rays about their mean."""
    found = level_pose(points)
    if found is None:
        return np.inf
    rotation, origin = found
    to_point = points.at @ rotation.T + origin - points.camera
    off = points.rays - to_point / np.linalg.norm(to_point, axis=1, keepdims=True)
    spread = points.rays - points.rays.mean(axis=0)
    return float((off * off).sum()) / float((spread * spread).sum())


def _contradicting(
    layout: PadLayout, sights: Sequence[TagSight], points: SeenPoints, pose: PadPose, shift: int
) -> tuple[TagSight, PadContradiction] | None:
    """The sight that contradicts the others most; None where all agree.

    Of two tags alone none can be outvoted: the smaller one in the picture is left out.
    """
    squares = np.array([pose.squares[points.tag == number].mean() / 2.0 for number in range(len(sights))])
    if squares.max() <= MOST_SQUARE:
        return None
    if len(sights) == 2:
        candidates = [min(sights, key=lambda sight: sight.side_px)]
    else:
        candidates = [sights[k] for k in np.argsort(-squares)[:3]]
    best: tuple[float, TagSight, PadPose] | None = None
    for sight in candidates:
        rest = pad_pose(seen_points(layout, [each for each in sights if each is not sight], shift))
        if rest is not None and (best is None or rest.cost < best[0]):
            best = (rest.cost, sight, rest)
    if best is None:
        return None
    _, sight, rest = best
    contradiction = _displacement(layout, sight, rest, shift)
    tolerated_m = max(LEAST_OFF_M, LEAST_OFF_SHARE * float(np.linalg.norm(rest.origin)))
    return None if contradiction.corner_off_m < tolerated_m else (sight, contradiction)


def _displacement(layout: PadLayout, sight: TagSight, pose: PadPose, shift: int) -> PadContradiction:
    """How far a tag lies from where its pad has it: its corners' rays, intersected with the pad's plane."""
    normal = pose.ned_from_pad[:, 2]
    reach = ((pose.origin - sight.camera) @ normal) / (sight.rays @ normal)  # (4,)
    on_pad = (sight.camera + reach[:, None] * sight.rays - pose.origin) @ pose.ned_from_pad  # (4, 3)
    off = (on_pad - np.roll(layout.corners[sight.tag], -shift, axis=0))[sight.seen]
    return PadContradiction(
        pad=layout.pad.label,
        tag=layout.label(sight.tag),
        off_m=float(np.linalg.norm(off.mean(axis=0))),
        corner_off_m=float(np.linalg.norm(off, axis=1).max()),
    )


def _inflated(pose: PadPose, points: SeenPoints) -> PadPose:
    """The pose with the covariance that its residuals show, where they are larger than the corners' sigmas."""
    freedom = 2 * len(points) + 2 - 6
    factor = max(1.0, pose.cost / freedom) if freedom > 0 else 1.0
    return PadPose(pose.ned_from_pad, pose.origin, pose.cov * factor, pose.squares, pose.prior_square)
