"""Poses of pictures as rows of a file of poses. PURE.

A row holds one altitude: an absolute one that is trusted, else the height above the take-off, else what there is. Its
sigmas are the picture's own.
"""

from __future__ import annotations

from typing import Final

from fwav_companion.photographs.picture_pose import AltDatum, Altitude, PicturePose

TRUSTED_M: Final = 5.0
"""Largest shared sigma of an absolute altitude that is preferred to the height above the take-off, metres."""
COLUMNS: Final = (
    "file", "frame", "time_unix", "lat", "lon", "alt", "alt_datum", "roll_deg", "pitch_deg", "yaw_deg",
    "position_sigma_m", "height_sigma_m", "attitude_sigma_deg", "width", "height",
)  # fmt: skip


def pose_row(
    file: str, pose: PicturePose, size: tuple[int, int], alt_datum: AltDatum | None = None
) -> dict[str, str | float | int] | None:
    """The columns of a pose; None where the picture has no altitude. ``alt_datum``: of the absolute altitude."""
    altitude = _altitude(pose, alt_datum)
    if altitude is None:
        return None
    return {
        "file": file,
        "lat": pose.lat_deg,
        "lon": pose.lon_deg,
        "alt": altitude.metres,
        "alt_datum": altitude.datum.value,
        "roll_deg": round(pose.roll_deg, 6),
        "pitch_deg": round(pose.pitch_deg, 6),
        "yaw_deg": round(pose.yaw_deg, 6),
        "position_sigma_m": pose.sigmas.position_m.own,
        "height_sigma_m": altitude.sigma.own,
        "attitude_sigma_deg": pose.sigmas.attitude_deg.own,
        "width": size[0],
        "height": size[1],
    }


def _altitude(pose: PicturePose, alt_datum: AltDatum | None) -> Altitude | None:
    absolute = pose.absolute
    if alt_datum is not None and absolute is not None and alt_datum is not AltDatum.TAKEOFF:
        return Altitude(absolute.metres, alt_datum, absolute.sigma)
    if absolute is not None and absolute.sigma.shared <= TRUSTED_M and alt_datum is None:
        return absolute
    return pose.above_takeoff or (absolute if alt_datum is None else None)
