"""Whether a frame could have shown a target that it does not show. PURE."""

from __future__ import annotations

from typing import Protocol

from fwav_companion.geometry.small_matrices import horizontal_sigma
from fwav_companion.geometry.vectors import Matrix3, Vector3, dot, norm, subtract, transform
from fwav_companion.types import FrameView, Sighting

AROUND = ((1.0, 0.0), (-0.5, 0.866), (-0.5, -0.866))
"""Three directions, north and east: an image edge that cuts the inner half of their circle cuts one of them off."""
TOWARD_COSINE = 0.985
"""Cosine of the largest angle between a sighting and its target, 10 degrees: a delay of 50 ms turns a sight by 8
degrees at the fastest instant of a beat of 5 degrees at 5 Hz."""


class ReportedPlace(Protocol):
    """A target's place in the frame of the vehicle's reports."""

    @property
    def apparent_ned(self) -> Vector3:
        """Position as single fixes show it, NED, metres."""

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of that relative to the vehicle, NED, m^2."""


def is_missed_detection(view: FrameView, label: str, target: ReportedPlace, margin_m: float | None) -> bool:
    """Whether the frame covers the target and has no sighting that may be of this target.

    The frame must cover the target's position and, unless ``margin_m`` is None, a circle of one sigma plus ``margin_m``
    around it.
    """
    place_ned = target.apparent_ned
    if not view.could_see(place_ned):
        return False
    if margin_m is not None:
        margin_m += horizontal_sigma(target.relative_cov)
        north, east, down = place_ned
        if not all(view.could_see((north + margin_m * n, east + margin_m * e, down)) for n, e in AROUND):
            return False
    return not any(sighting.detection.label == label and _is_toward(sighting, place_ned) for sighting in view.unplaced)


def _is_toward(sighting: Sighting, place_ned: Vector3) -> bool:
    """Whether a sighting without a fix, such as a too shallow one, is in the direction of this place."""
    seen = transform(sighting.ned_from_camera, sighting.ray.direction)
    to_place = subtract(place_ned, sighting.camera_ned)
    return dot(seen, to_place) >= TOWARD_COSINE * norm(to_place)
