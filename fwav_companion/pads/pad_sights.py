"""Replaces the sightings of a pad's tags by one of its landing point, and measures heights by the sizes of tags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final, TypeAlias

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.geometry.vectors import Vector3, dot, scale, subtract, transform, transpose
from fwav_companion.pads.corner_order import clockwise
from fwav_companion.pads.pad_layout import PadLayout
from fwav_companion.pads.pad_measurement import PadMeasurement, TagSight, measured_pad
from fwav_companion.pads.pad_pose import Array, PadPose
from fwav_companion.types import (
    Corners,
    ElevatedTarget,
    Lens,
    NoRay,
    Pad,
    PadContradiction,
    PadTag,
    Pixel,
    Ray,
    Reason,
    Sighting,
    SizeHeight,
)

CORNER_SIGMA_FACTOR: Final = 2.0
"""One sigma of a corner over that of the centre that its detector states: the centre is the mean of four corners."""
SCALE_SIGMA: Final = 0.01
"""One sigma of the height's scale: prints are scaled by up to half a percent, focal lengths are known to one."""
SAME_POINT_M: Final = 0.01
"""Distance from a tag's centre within which the landing point needs no heading, metres."""
EXPECTED_NS: Final = 2 * NS_PER_S
"""Age up to which a pad's last pose decides between two copies of a tag."""
LEAST_SIGMA_PX: Final = 0.01
SAME_PAD_M: Final = 2.0
"""Distance from a pad's last landing point within which a target's place is the pad's, metres: its position wanders."""
_OVERHEAD: Final = (0.0, 0.0, 1.0)

CouldSee: TypeAlias = Callable[[Vector3], bool]
Refused: TypeAlias = tuple[int, Reason, float | None]
"""Index of a detection, the reason, and no time to an attitude."""


class PadSights:
    """The pads of a flight, picture by picture."""

    def __init__(self, pads: Sequence[Pad], sized: Sequence[ElevatedTarget], lens: Lens) -> None:
        """``sized``: the targets; those with a size are tags that measure the height."""
        self._lens = lens
        self._pads = [FollowedPad(PadLayout(pad)) for pad in pads]
        self._of_tag = {tag.label: pad for pad in self._pads for tag in pad.layout.pad.tags}
        self._sized = {each.label: _lone_tag(each.label, each.size_m) for each in sized if each.size_m is not None}

    def joined(self, sightings: Sequence[Sighting]) -> tuple[tuple[Sighting, ...], list[Refused]]:
        """The sightings with each pad once, in the order of the frame, and the detections without a sighting."""
        joined: list[Sighting] = []
        refused: list[Refused] = []
        of_pads: dict[str, list[Sighting]] = {}
        for sighting in sightings:
            label = sighting.detection.label
            pad = self._of_tag.get(label)
            if pad is not None:
                of_pads.setdefault(pad.layout.pad.label, []).append(sighting)
            elif (layout := self._sized.get(label)) is not None:
                joined.append(self._with_size(sighting, layout))
            else:
                joined.append(sighting)
        for pad in self._pads:
            of_pad = of_pads.get(pad.layout.pad.label)
            if of_pad is not None:
                of_point, others = pad.sighting(of_pad, self._lens)
                refused.extend(others)
                if of_point is not None:
                    joined.append(of_point)
        joined.sort(key=lambda sighting: sighting.index)
        return tuple(joined), refused

    @property
    def contradictions(self) -> list[PadContradiction]:
        """The tags that are not where their pads have them."""
        return [found for pad in self._pads for found in pad.contradictions.values()]

    def could_see(self, could_see: CouldSee) -> CouldSee:
        """Whether a place is in view; near the landing point of a pad, whether one of its tags is.

        The landing point may be out of view while the tags are in it, and the other way round.
        """
        known = [place for pad in self._pads if (place := pad.place) is not None]
        return TagsInView(could_see, known) if known else could_see

    def _with_size(self, sighting: Sighting, layout: PadLayout) -> Sighting:
        """The sighting of a single tag with the height that its size shows."""
        sight = tag_sight(sighting, 0, sighting, self._lens)
        measured = None if sight is None else measured_pad(layout, [sight], shift=0, expected=None)
        if measured is None:
            return sighting
        place, cov = measured.pose.level_place(layout.centre(0), measured.middle)
        return msgspec.structs.replace(sighting, size_height=_size_height(place, cov))


class FollowedPad:
    """One pad: what is known of it from earlier pictures, and its sighting in the present one."""

    def __init__(self, layout: PadLayout) -> None:
        self.layout = layout
        self.contradictions: dict[str, PadContradiction] = {}
        """The tags that contradict the pad, by label, with their newest displacement."""
        self._shift = 0
        self._last: tuple[HostNs, Array, PadPose] | None = None
        """Capture of the last pose, the pad's origin in local NED, and the pose."""
        self._relative = False
        """Whether that origin is relative to the camera."""

    def sighting(self, tags: Sequence[Sighting], lens: Lens) -> tuple[Sighting | None, list[Refused]]:
        """The sighting of the landing point, or None; and the other detections with their reasons."""
        reference = max(tags, key=lambda sighting: _shortest_side(sighting.detection.corners))
        sights = [
            sight
            for sighting in tags
            if (sight := tag_sight(sighting, self.layout.number[sighting.detection.label], reference, lens)) is not None
        ]
        expected = self._expected(reference)
        measured = measured_pad(self.layout, sights, shift=self._shift, expected=expected) if sights else None
        if measured is None:
            return self._without_pose(tags)
        self._shift = measured.shift
        for each in measured.contradictions:
            before = self.contradictions.get(each.tag)
            pictures = 1 if before is None else before.pictures + 1
            self.contradictions[each.tag] = msgspec.structs.replace(each, pictures=pictures)
        origin = np.array(reference.camera_ned) + measured.pose.origin
        self._last = (reference.host_ns, origin, measured.pose)
        self._relative = reference.relative
        return self._of_landing_point(reference, measured, lens), _others(tags, measured)

    @property
    def place(self) -> PadPlace | None:
        """The pad in local NED by its last picture; None before one, and in a relative world."""
        if self._last is None or self._relative:
            return None
        _, origin, pose = self._last
        landing_point = origin + pose.ned_from_pad @ self.layout.landing_point
        return PadPlace(landing_point, origin + self.layout.corners @ pose.ned_from_pad.T)

    def _expected(self, reference: Sighting) -> PadPose | None:
        if self._last is None or not 0 <= reference.host_ns - self._last[0] <= EXPECTED_NS:
            return None
        _, origin, pose = self._last
        moved = origin - np.array(reference.camera_ned)
        return PadPose(pose.ned_from_pad, moved, pose.cov, pose.squares, pose.prior_square)

    def _without_pose(self, tags: Sequence[Sighting]) -> tuple[Sighting | None, list[Refused]]:
        """A tag's own sighting as the pad's where its centre is the landing point; it shows no height."""
        for sighting in tags:
            centre = self.layout.centre(self.layout.number[sighting.detection.label])
            if hypot(*(centre - self.layout.landing_point)[:2]) <= SAME_POINT_M:
                others: list[Refused] = [(s.index, Reason.PART_OF_PAD, None) for s in tags if s is not sighting]
                return self._labelled(sighting, (sighting.detection.u, sighting.detection.v)), others
        return None, [(sighting.index, Reason.NO_PAD_POSE, None) for sighting in tags]

    def _of_landing_point(self, reference: Sighting, measured: PadMeasurement, lens: Lens) -> Sighting:
        """The sighting of the landing point; its ray's sigma has the corners' noise and the heading's error."""
        place, cov = measured.pose.level_place(self.layout.landing_point, measured.middle)
        range_m = float(np.linalg.norm(place))
        along = place / range_m
        across = np.eye(3) - np.outer(along, along)
        variances, axes = np.linalg.eigh(across @ cov @ across / range_m**2)  # ascending; the first is of the ray
        per_px = hypot(*reference.ray.d_du)
        camera_from_ned = transpose(reference.ned_from_camera)
        direction = transform(camera_from_ned, _vector(along))
        ray = Ray(
            direction,
            transform(camera_from_ned, _vector(axes[:, 2] * per_px)),
            transform(camera_from_ned, _vector(axes[:, 1] * per_px)),
        )
        sigma = np.maximum(np.sqrt(np.maximum(variances[[2, 1]], 0.0)) / per_px, LEAST_SIGMA_PX)
        pixel = lens.pixel_from_camera_point(direction)
        if isinstance(pixel, NoRay):
            pixel = (reference.detection.u, reference.detection.v)
        return msgspec.structs.replace(
            self._labelled(reference, pixel),
            index=measured.used[0],
            ray=ray,
            pixel_sigma=(float(sigma[0]), float(sigma[1])),
            size_height=_size_height(place, cov),
        )

    def _labelled(self, sighting: Sighting, pixel: Pixel) -> Sighting:
        """The sighting as one of the pad."""
        pad, detection = self.layout.pad, sighting.detection
        return msgspec.structs.replace(
            sighting,
            detection=msgspec.structs.replace(
                detection, u=pixel[0], v=pixel[1], label=pad.label, detector_id=None, box=None, corners=None
            ),
            anchor_height_m=pad.height_m,
            anchor_sigma_m=pad.height_sigma_m,
        )


@dataclass(frozen=True)
class PadPlace:
    """A pad in local NED, as the vehicle reported its own position then."""

    landing_point: Array
    """(3,) metres."""
    corners: Array
    """(T, 4, 3) corners of its tags, metres."""


@dataclass(frozen=True)
class TagsInView:
    """Whether a frame could show a target: a pad, where one of its tags is in view as a whole."""

    could_see: CouldSee
    """Whether a place is in view."""
    pads: Sequence[PadPlace]

    def __call__(self, position_ned: Vector3) -> bool:
        """Whether the frame could show a target at this place."""
        for pad in self.pads:
            moved = np.array(position_ned) - pad.landing_point
            if hypot(moved[0], moved[1]) <= SAME_PAD_M:
                moved[2] = 0.0
                return any(all(self.could_see(_vector(corner)) for corner in tag) for tag in pad.corners + moved)
        return self.could_see(position_ned)


def tag_sight(sighting: Sighting, tag: int, reference: Sighting, lens: Lens) -> TagSight | None:
    """The corners of a tag about the reference sighting's camera; None without a corner in the picture."""
    corners = None if sighting.detection.corners is None else clockwise(sighting.detection.corners)
    if corners is None:
        return None
    width, height = lens.image_size
    rays, pixel_from_ray, seen = np.array([_OVERHEAD] * 4), np.zeros((4, 2, 3)), np.zeros(4, np.bool_)
    for corner, (u, v) in enumerate(corners):
        ray = lens.camera_ray_and_derivatives_from_pixel(u, v)
        if not isinstance(ray, NoRay) and -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5:
            rays[corner], pixel_from_ray[corner], seen[corner] = ray.direction, _pixel_from_ray(ray), True
    if not seen.any():
        return None
    ned_from_camera = np.array(sighting.ned_from_camera)
    pixel_from_ray = pixel_from_ray @ ned_from_camera.T
    rays[seen] = rays[seen] @ ned_from_camera.T
    su, sv = sighting.pixel_sigma
    factor = 1.0 if sighting.detection.sigma is None else CORNER_SIGMA_FACTOR
    return TagSight(
        index=sighting.index,
        tag=tag,
        rays=rays,
        pixel_from_ray=pixel_from_ray,
        seen=seen,
        camera=np.array(sighting.camera_ned) - np.array(reference.camera_ned),
        sigma_px=factor * hypot(su, sv) / hypot(1.0, 1.0),
        side_px=_shortest_side(corners),
    )


def _pixel_from_ray(ray: Ray) -> tuple[Vector3, Vector3]:
    """d(pixel)/d(ray), two rows: the pseudo-inverse of the columns d(ray)/du and d(ray)/dv."""
    u, v = ray.d_du, ray.d_dv
    uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
    per_det = 1.0 / (uu * vv - uv * uv)
    by_u = subtract(scale(u, vv * per_det), scale(v, uv * per_det))
    return by_u, subtract(scale(v, uu * per_det), scale(u, uv * per_det))


def _others(tags: Sequence[Sighting], measured: PadMeasurement) -> list[Refused]:
    """The detections without a sighting of their own, with their reasons."""
    reasons = dict.fromkeys((sighting.index for sighting in tags), Reason.PART_OF_PAD)
    reasons |= dict.fromkeys(measured.copies, Reason.TAG_COPY)
    reasons |= dict.fromkeys(measured.left_out, Reason.CONTRADICTS_PAD)
    return [(index, reason, None) for index, reason in reasons.items() if index != measured.used[0]]


def _size_height(place: Array, cov: Array) -> SizeHeight:
    return SizeHeight(float(place[2]), float(np.sqrt(cov[2, 2])), SCALE_SIGMA)


def _shortest_side(corners: Corners | None) -> float:
    if corners is None:
        return 0.0
    following = corners[1:] + corners[:1]
    return min(hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(corners, following, strict=True))


def _lone_tag(label: str, size_m: float) -> PadLayout:
    """The layout of a single tag, whose centre is what its detections mark."""
    return PadLayout(Pad(label=label, tags=(PadTag(label=label, size_m=size_m),)))


def _vector(array: Array) -> Vector3:
    x, y, z = array.tolist()
    return (x, y, z)
