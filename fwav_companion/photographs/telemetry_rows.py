"""One instant of a video's telemetry, whatever file or track it is from."""

from __future__ import annotations

from math import radians, tan

import msgspec

from fwav_companion.photographs.picture_pose import AltDatum

FILM_WIDTH_MM = 36.0


class TelemetryRow(msgspec.Struct, frozen=True, kw_only=True):
    """What the telemetry says about one instant; None for what it does not."""

    at_s: float
    """Time of the video, seconds; of a subtitle its beginning."""
    until_s: float
    lat_deg: float | None = None
    lon_deg: float | None = None
    above_takeoff_m: float | None = None
    absolute_m: float | None = None
    absolute_datum: AltDatum | None = None
    """Datum of the absolute altitude; None: the layout does not state it."""
    angles_deg: tuple[float, float, float] | None = None
    """Roll, pitch and yaw of the gimbal; pitch 0 is the horizon."""
    focal_35mm: float | None = None
    """35 mm equivalent focal length, millimetres, zoom included."""
    time_unix: float | None = None
    """UTC; None where the telemetry has no time with a zone."""


def is_place(lat: float | None, lon: float | None) -> bool:
    """Whether the numbers are a place on the earth; 0, 0 is a receiver without a fix."""
    return lat is not None and lon is not None and (lat, lon) != (0.0, 0.0) and abs(lat) <= 90.0 and abs(lon) <= 180.0


def focal_of_field(hfov_deg: float | None) -> float | None:
    """35 mm equivalent of a horizontal field of view; None where that is none of a lens."""
    if hfov_deg is None or not 0.1 < hfov_deg < 170.0:
        return None
    return 0.5 * FILM_WIDTH_MM / tan(radians(0.5 * hfov_deg))
