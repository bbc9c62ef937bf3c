"""Poses of pictures as rows of a file of poses. PURE.

A row holds one altitude: an absolute one that is trusted, else the height above the take-off, else what there is. Its
sigmas are the picture's own; its biases are what all pictures of its source share, and so is the delay of a video's
telemetry.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Final

from fwav_companion.photographs.picture_pose import AltDatum, Altitude, PicturePose
from fwav_companion.photographs.stated_datum import with_stated_datum

TRUSTED_M: Final = 5.0
"""Largest shared sigma of an absolute altitude that is preferred to the height above the take-off, metres."""
SHARED: Final = ("position_bias_m", "height_bias_m", "heading_bias_deg", "mount_bias_deg", "time_offset_sigma_s")
COLUMNS: Final = (
    "file", "frame", "time_unix", "lat", "lon", "alt", "alt_datum", "takeoff_alt", "roll_deg", "pitch_deg", "yaw_deg",
    "position_sigma_m", "height_sigma_m", "attitude_sigma_deg", *SHARED, "width", "height",
)  # fmt: skip


def pose_row(
    file: str, pose: PicturePose, size: tuple[int, int] | None, alt_datum: AltDatum | None = None
) -> dict[str, str | float | int] | None:
    """The columns of a pose; None where the picture has no altitude. ``size``: None where it is not known.

    ``alt_datum``: of the absolute altitude, which then counts in any case; None: by the picture's tags.
    """
    altitude = _altitude(pose, alt_datum)
    if altitude is None:
        return None
    shared = {
        "position_bias_m": pose.sigmas.position_m.shared,
        "height_bias_m": altitude.sigma.shared,
        "heading_bias_deg": pose.sigmas.heading_deg,
        "mount_bias_deg": pose.sigmas.attitude_deg.shared,
    }
    if pose.motion is not None:
        shared["time_offset_sigma_s"] = pose.motion.delay_sigma_s
    return {
        "file": file,
        "lat": pose.lat_deg,
        "lon": pose.lon_deg,
        "alt": altitude.metres,
        "alt_datum": altitude.datum.value,
        "roll_deg": round(pose.roll_deg, 6),
        "pitch_deg": round(pose.pitch_deg, 6),
        "yaw_deg": round(pose.yaw_deg, 6),
        "position_sigma_m": round(pose.sigmas.position_m.own, 4),
        "height_sigma_m": round(altitude.sigma.own, 4),
        "attitude_sigma_deg": round(pose.sigmas.attitude_deg.own, 4),
        **shared,
        **({} if size is None else {"width": size[0], "height": size[1]}),
    }


def poses_csv(rows: Sequence[Mapping[str, str | float | int]]) -> str:
    """The rows as a file of poses; columns that no row has are left out."""
    columns = [name for name in COLUMNS if any(name in row for row in rows)]
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _altitude(pose: PicturePose, alt_datum: AltDatum | None) -> Altitude | None:
    pose = with_stated_datum(pose, alt_datum)
    absolute = pose.absolute
    if absolute is not None and (absolute.sigma.shared <= TRUSTED_M or alt_datum is not None):
        return absolute
    return pose.above_takeoff or absolute
