"""Whether a frame that brought no fix of a target speaks against it."""

from __future__ import annotations

from fwav_companion.geometry.vectors import Vector3, dot, norm, subtract, transform
from fwav_companion.types import FrameView, Sighting

AROUND = ((1.0, 0.0), (-0.5, 0.866), (-0.5, -0.866))
"""Three directions: an edge of the image that cuts the circle's inner half cuts one of them off."""
TOWARD_COSINE = 0.985
"""10 degrees: a delay of 50 ms turns a sight by 8 at the swiftest of a beat of 5 degrees at 5 Hz."""


def is_missed_detection(view: FrameView, label: str, place_ned: Vector3, margin_m: float) -> bool:
    """It would show a target there, or up to ``margin_m`` beside, and shows nothing that may be this one."""
    return _would_show(view, place_ned, margin_m) and not any(
        sighting.detection.label == label and _is_toward(sighting, place_ned) for sighting in view.unplaced
    )


def _would_show(view: FrameView, place_ned: Vector3, margin_m: float) -> bool:
    north, east, down = place_ned
    return view.could_see(place_ned) and (
        margin_m == 0.0 or all(view.could_see((north + margin_m * n, east + margin_m * e, down)) for n, e in AROUND)
    )


def _is_toward(sighting: Sighting, place_ned: Vector3) -> bool:
    """Something was seen about there. Where it stands nobody can tell, at a shallow angle say; but it was seen."""
    seen = transform(sighting.ned_from_camera, sighting.ray.direction)
    to_place = subtract(place_ned, sighting.camera_ned)
    return dot(seen, to_place) >= TOWARD_COSINE * norm(to_place)
