"""The point that a detection marks: the centre of a marker, or a point of a standing target above its foot."""

from __future__ import annotations

from math import acos, cos, hypot, radians

import msgspec

from fwav_companion.geometry.rotations import exp, rotate
from fwav_companion.geometry.vectors import Matrix3, Vector3, cross, dot, norm, scale
from fwav_companion.types import Corners, Detection, ElevatedTarget, Lens, NoRay, Outline, Pixel, Sighting

NEAR_NADIR = cos(radians(15.0))
"""Cosine of the angle to the nadir within which a thing hides its own foot: the box's centre marks its middle."""
CUT_PX = 1.0
"""Distance from the image's edge, px, within which a box is cut off by it: detectors clip boxes to the image, in whole
pixels."""
HALVINGS = 20
"""Bisections of the angle to the nadir, at most 90 degrees: to 1e-4 degrees, a thousandth of a pixel at 600 px/rad."""

ANKLE_SHARE, ANKLE_SIGMA_SHARE = 0.039, 0.02
"""Height of the ankles above the ground over a person's height (Drillis and Contini 1966), and one sigma: keypoints
mark the joint or the shoe."""
EDGE_FACTOR = 1.75
"""One sigma of an edge of a box over that of its centre, across the edge: 1.5 to 2. Two independent edges give 1.41."""
BOX_END_SHARE = 0.058
"""One sigma of where a box ends above or below the foot, over the thing's height: detectors end it early by 0 to 10 %
(legs, shadow, grass), and no average removes it. Root mean square of a uniform distribution."""
SAME_PX = 0.5
"""Distance from the crossing of a marker's diagonals, px, within which the marker's pixel is meant to be its centre."""


class Anchor(msgspec.Struct, frozen=True, gc=False):
    """The point of a standing target that a detection marks."""

    height_m: float
    """Height above the foot, metres."""
    sigma_m: float
    """One sigma of the height, metres: one error in all sightings of a target."""
    pixel: Pixel | None = None
    """Pixel of the point where it is not the detection's own."""
    edge_axis: int | None = None
    """Axis, 0 for u and 1 for v, along which an edge of the box decides the pixel; None where no edge does."""


def anchor_of(target: ElevatedTarget, detection: Detection, ned_from_camera: Matrix3, lens: Lens) -> Anchor:
    """The point that the detection of a standing target marks, by its anchor."""
    if target.anchor == "bottom":
        foot = foot_pixel(detection, ned_from_camera, lens)
        if foot is not None:
            return Anchor(0.0, BOX_END_SHARE * target.height_m, foot, _edge_axis(detection, foot))
    if target.anchor == "ankles" and detection.foot is not None:
        return Anchor(ANKLE_SHARE * target.height_m, ANKLE_SIGMA_SHARE * target.height_m, detection.foot)
    share = {"center": 0.5, "bottom": 0.5, "top": 1.0, "ankles": 0.5, "ground": 0.0}[target.anchor]
    return Anchor(share * target.height_m, share * target.sigma_m)


def foot_pixel(detection: Detection, ned_from_camera: Matrix3, lens: Lens) -> Pixel | None:
    """The pixel where the image of the vertical through the box's centre leaves the thing downward in the world.

    It leaves the outline of a turned box or a mask, where the detection has one, else the box. None where that pixel is
    not the foot: without a box, within 15 degrees of the nadir, with a box that the image cuts off.
    """
    box = detection.box
    if box is None or not _is_whole(box, lens.image_size):
        return None
    centre = lens.camera_ray_and_derivatives_from_pixel(0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
    down = ned_from_camera[2]  # the third row: down, NED, in camera axes
    if isinstance(centre, NoRay) or dot(centre.direction, down) > NEAR_NADIR:
        return None
    return _leaving(detection.outline or _outline_of(box), centre.direction, down, lens)


def marker_centre(detection: Detection, lens: Lens) -> Pixel:
    """The pixel of a marker's centre: the pixel of its detection, corrected for the distortion of its diagonals.

    In space the diagonals cross at the centre. The lens bends straight lines, so that the diagonals between the corners
    in the image cross elsewhere: by 0.2 px for a tag of 80 px and the paper's lens. A detection's pixel that is not
    that crossing marks another point and is not corrected.
    """
    given, corners = (detection.u, detection.v), detection.corners
    if corners is None or not _is_crossing(given, corners):
        return given
    rays = [lens.camera_ray_and_derivatives_from_pixel(u, v) for u, v in corners]
    a, b, c, d = (None if isinstance(ray, NoRay) else ray.direction for ray in rays)
    if a is None or b is None or c is None or d is None:
        return given
    centre = cross(cross(a, c), cross(b, d))
    pixel = lens.pixel_from_camera_point(centre if dot(centre, a) > 0.0 else scale(centre, -1.0))
    return given if isinstance(pixel, NoRay) else pixel


def _is_crossing(pixel: Pixel, corners: Corners) -> bool:
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners
    area = (cx - ax) * (dy - by) - (cy - ay) * (dx - bx)
    if area == 0.0:
        return False
    share = ((bx - ax) * (dy - by) - (by - ay) * (dx - bx)) / area
    return hypot(ax + share * (cx - ax) - pixel[0], ay + share * (cy - ay) - pixel[1]) <= SAME_PX


def _leaving(outline: Outline, ray: Vector3, down: Vector3, lens: Lens) -> Pixel | None:
    """The last pixel inside the outline along the image of the vertical, from a ray toward the nadir.

    Points of the vertical lie in the plane of the ray and the nadir, so their rays are ``ray`` turned in that plane.
    """
    axis = cross(ray, down)
    length = norm(axis)
    if length == 0.0:
        return None
    turn = scale(axis, acos(max(-1.0, min(1.0, dot(ray, down)))) / length)
    inside, beyond, foot = 0.0, 1.0, None
    for _ in range(HALVINGS):
        share = 0.5 * (inside + beyond)
        pixel = lens.pixel_from_camera_point(rotate(exp(scale(turn, share)), ray))
        if isinstance(pixel, NoRay) or not _holds(outline, pixel):
            beyond = share
        else:
            inside, foot = share, pixel
    return foot


def _is_whole(box: tuple[float, float, float, float], image_size: tuple[int, int]) -> bool:
    """Whether the image does not cut the box off."""
    left, top, right, bottom = box
    width, height = image_size
    within = left > CUT_PX - 0.5 and top > CUT_PX - 0.5
    return within and right < width - 0.5 - CUT_PX and bottom < height - 0.5 - CUT_PX


def _edge_axis(detection: Detection, foot: Pixel) -> int:
    """The axis across the side of the box that is nearest to the foot: left and right are sides along u."""
    left, top, right, bottom = detection.box or (0.0, 0.0, 0.0, 0.0)
    across = min(foot[0] - left, right - foot[0])
    return 0 if across < min(foot[1] - top, bottom - foot[1]) else 1


def _outline_of(box: tuple[float, float, float, float]) -> Outline:
    left, top, right, bottom = box
    return ((left, top), (right, top), (right, bottom), (left, bottom))


def _holds(outline: Outline, pixel: Pixel) -> bool:
    """Whether a convex outline, in either order, holds a pixel: it lies on one side of all edges."""
    u, v = pixel
    sides = [
        (cu - bu) * (v - bv) - (cv - bv) * (u - bu)
        for (bu, bv), (cu, cv) in zip(outline, outline[1:] + outline[:1], strict=True)
    ]
    return min(sides) >= 0.0 or max(sides) <= 0.0


def anchored(sighting: Sighting, target: ElevatedTarget, lens: Lens) -> Sighting:
    """The sighting of the point that the detection of a standing target marks.

    The row stays that of the box's centre: over a box of 50 rows the readout of 30 ms lasts 3 ms longer.
    """
    anchor = anchor_of(target, sighting.detection, sighting.ned_from_camera, lens)
    ray = None if anchor.pixel is None else lens.camera_ray_and_derivatives_from_pixel(*anchor.pixel)
    return msgspec.structs.replace(
        sighting,
        ray=sighting.ray if ray is None or isinstance(ray, NoRay) else ray,
        anchor_height_m=anchor.height_m,
        anchor_sigma_m=anchor.sigma_m,
        pixel_sigma=_of_edge(sighting.pixel_sigma, anchor.edge_axis),
    )


def _of_edge(sigma: tuple[float, float], axis: int | None) -> tuple[float, float]:
    """The pixel noise of a point on an edge of the box, from that of its centre."""
    if axis is None:
        return sigma
    su, sv = sigma
    return (EDGE_FACTOR * su, sv) if axis == 0 else (su, EDGE_FACTOR * sv)
