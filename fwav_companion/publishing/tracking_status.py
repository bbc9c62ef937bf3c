"""CAMERA_TRACKING_IMAGE_STATUS (275) and CAMERA_TRACKING_GEO_STATUS (276), field by field; unknown is NaN. Pure."""

from __future__ import annotations

from math import atan2, hypot, inf, nan, pi, sqrt
from typing import Any

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.publishing import enums
from fwav_companion.publishing.target_report import TargetReport, degrees_e7, float32, target_report
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track, TrackState

STALE_NS = NS_PER_S
"""Age of the newest frame beyond which a target counts as predicted."""
FORGOTTEN_NS = 10 * NS_PER_S
"""Age of the newest frame beyond which a target is not sent."""
MIN_RADIUS = 0.01
RADIUS_SIGMAS = 3.0
COURSE_SIGMAS = 2.0
"""Speed in its own sigmas below which the course is unknown."""


class ImagePlace(msgspec.Struct, frozen=True):
    """Place of a target in the newest picture, pixels."""

    point: tuple[float, float]
    sigma_px: float
    box: tuple[float, float, float, float] | None = None
    """Left, top, right, bottom; None where the detector gave no box."""


def tracking_flags(track: Track | None, now: HostNs) -> int:
    """CAMERA_TRACKING_STATUS_FLAGS; COASTING while the target is predicted and not seen."""
    if track is None:
        return enums.CAMERA_TRACKING_STATUS_FLAGS_IDLE
    predicted = track.state is not TrackState.CONFIRMED or now - track.host_ns > STALE_NS
    coasting = enums.CAMERA_TRACKING_STATUS_FLAGS_COASTING if predicted else 0
    return enums.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE | coasting


def image_status(track: Track | None, place: ImagePlace | None, size: tuple[int, int], now: HostNs) -> dict[str, Any]:
    """Fields of 275. ``place``: None where the target's pixel is unknown."""
    fields: dict[str, Any] = {
        "tracking_status": tracking_flags(track, now),
        "tracking_mode": enums.CAMERA_TRACKING_MODE_NONE,
        "target_data": enums.CAMERA_TRACKING_TARGET_DATA_IN_STATUS if track is not None else 0,
        **dict.fromkeys(("point_x", "point_y", "radius"), nan),
        **dict.fromkeys(("rec_top_x", "rec_top_y", "rec_bottom_x", "rec_bottom_y"), nan),
    }
    if track is None:
        return fields
    fields["tracking_mode"] = enums.CAMERA_TRACKING_MODE_POINT
    if place is None or min(size) <= 0:
        return fields
    if place.box is not None:
        left, top, right, bottom = place.box
        fields["tracking_mode"] = enums.CAMERA_TRACKING_MODE_RECTANGLE
        fields["rec_top_x"], fields["rec_top_y"] = normalized((left, top), size)
        fields["rec_bottom_x"], fields["rec_bottom_y"] = normalized((right, bottom), size)
    else:
        fields["point_x"], fields["point_y"] = normalized(place.point, size)
        fields["radius"] = min(max(RADIUS_SIGMAS * place.sigma_px / size[0], MIN_RADIUS), 1.0)
    return fields


def geo_status(track: Track, situation: Situation) -> dict[str, Any] | None:
    """Fields of 276; None without a global position, because the message has no value for an unknown latitude."""
    target = target_report(track, situation)
    if target.place is None:
        return None
    return {
        "tracking_status": tracking_flags(track, situation.now_ns),
        "lat": degrees_e7(target.place.lat_deg),
        "lon": degrees_e7(target.place.lon_deg),
        "alt": float32(target.place.alt_amsl_m),
        "h_acc": float32(target.horizontal_sigma_m),
        "v_acc": float32(target.vertical_sigma_m),
        "dist": float32(target.distance_m),
        **_velocity(target),
    }


def normalized(pixel: tuple[float, float], size: tuple[int, int]) -> tuple[float, float]:
    """Pixel in MAVLink's range 0 to 1. Its 0 is the image's left edge, half a pixel before this package's 0."""
    u, v = ((at + 0.5) / extent for at, extent in zip(pixel, size, strict=True))
    return (min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0))


def pixel(normalized_point: tuple[float, float], size: tuple[int, int]) -> tuple[float, float]:
    """Pixel of a point in MAVLink's range 0 to 1: the inverse of :func:`normalized`."""
    return (normalized_point[0] * size[0] - 0.5, normalized_point[1] * size[1] - 0.5)


def _velocity(target: TargetReport) -> dict[str, float]:
    """vel_*, vel_acc, hdg and hdg_acc; the course only where the speed exceeds :data:`COURSE_SIGMAS`."""
    velocity, cov = target.track.velocity_ned, target.track.velocity_cov
    fields = dict.fromkeys(("vel_n", "vel_e", "vel_d", "vel_acc", "hdg", "hdg_acc"), nan)
    if velocity is None:
        return fields
    fields |= {"vel_n": float32(velocity[0]), "vel_e": float32(velocity[1]), "vel_d": float32(velocity[2])}
    speed = hypot(velocity[0], velocity[1])
    sigma = sqrt(max(0.0, cov[0][0], cov[1][1])) if cov is not None else inf
    fields["vel_acc"] = float32(sigma)
    if speed > COURSE_SIGMAS * sigma:
        fields["hdg"] = atan2(velocity[1], velocity[0])
        fields["hdg_acc"] = min(atan2(sigma, speed), pi)
    return fields
