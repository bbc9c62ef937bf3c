"""Poses of photographs from a CSV file, one row a picture. PURE."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, radians

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.rotations import Quaternion, quaternion_from_euler

PLACE, ANGLES = ("lat", "lon", "alt_amsl"), ("roll_deg", "pitch_deg", "yaw_deg")
SIGMAS = ("position_sigma_m", "height_sigma_m", "attitude_sigma_deg")
ACCEPTED = (
    "one row a picture with frame or time_unix, lat, lon, alt_amsl, roll_deg, pitch_deg, yaw_deg, "
    "optionally position_sigma_m, height_sigma_m, attitude_sigma_deg"
)
LARGEST_ANGLE_DEG, LARGEST_SIGMA = 360.0, 10_000.0
"""Largest angle and sigma, the limits of [camera.mount] and of [uncertainty]; a larger number is in other units."""
SAME_TIME_S = 0.01
"""Largest difference of two times of one picture, s: files have hundredths of a second, and two pictures are at least
30 ms apart."""


class PhotographPose(msgspec.Struct, frozen=True, kw_only=True):
    """Pose of the camera in one picture."""

    frame: int | None
    """Number of the picture, as in the detections; None: the row has a time."""
    time_unix: float | None
    place: Geodetic
    """Centre of the camera."""
    ned_from_carrier: Quaternion
    """Attitude of a carrier whose x axis is the optical axis, image right along y."""
    position_sigma_m: float | None
    """One sigma of the place, each horizontal axis, metres; None: by the configuration."""
    height_sigma_m: float | None
    """One sigma of the altitude, metres; None: by the configuration."""
    attitude_sigma: float | None
    """One sigma about each axis, radians; None: by the configuration."""


def parse_poses(text: str, name: str) -> list[PhotographPose]:
    """The poses of a file. InputFileError names the line and what is accepted."""
    poses: list[PhotographPose] = []
    taken: set[object] = set()
    for number, row in _rows(text, name):
        where = f"{name}: line {number}"
        pose = _pose(row, where)
        key = pose.time_unix if pose.frame is None else pose.frame
        if (pose.frame is None, key) in taken:
            raise InputFileError(f"{where}: a second row for picture {key}; accepted: {ACCEPTED}")
        taken.add((pose.frame is None, key))
        poses.append(pose)
    if not poses:
        raise InputFileError(f"{name}: it has no pose; accepted: {ACCEPTED}")
    return poses


def _rows(text: str, name: str) -> Iterator[tuple[int, Mapping[str, str | None]]]:
    text = text.removeprefix("\ufeff")  # a spreadsheet's byte order mark would become part of the first column's name
    reader = csv.DictReader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        raise InputFileError(f"{name}: line {reader.line_num}: {error}; accepted: {ACCEPTED}") from error


def _pose(row: Mapping[str, str | None], where: str) -> PhotographPose:
    frame, time_unix = _frame(row, where), _number(row, "time_unix", where)
    if frame is None and time_unix is None:
        raise InputFileError(f"{where}: no frame and no time_unix; accepted: {ACCEPTED}")
    lat, lon, alt = _all_of(row, PLACE, where)
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
        raise InputFileError(f"{where}: lat {lat:g}, lon {lon:g} is out of range; accepted: degrees")
    angles = _all_of(row, ANGLES, where)
    if max(map(abs, angles)) > LARGEST_ANGLE_DEG:
        raise InputFileError(f"{where}: the angles {angles} are out of range; accepted: degrees from -360 to 360")
    roll, pitch, yaw = map(radians, angles)
    position, height, attitude = (_sigma(row, key, where) for key in SIGMAS)
    return PhotographPose(
        frame=frame,
        time_unix=time_unix,
        place=Geodetic.from_degrees(lat, lon, alt),
        ned_from_carrier=quaternion_from_euler(roll, pitch, yaw),
        position_sigma_m=position,
        height_sigma_m=height,
        attitude_sigma=None if attitude is None else radians(attitude),
    )


def _frame(row: Mapping[str, str | None], where: str) -> int | None:
    text = (row.get("frame") or "").strip()
    try:
        return int(text) if text else None
    except ValueError:
        raise InputFileError(f"{where}: frame is {text!r}; accepted: a whole number") from None


def _all_of(row: Mapping[str, str | None], names: Sequence[str], where: str) -> list[float]:
    values = {name: _number(row, name, where) for name in names}
    missing = [name for name, value in values.items() if value is None]
    if missing:
        raise InputFileError(f"{where}: no {', '.join(missing)}; accepted: {ACCEPTED}")
    return [value for value in values.values() if value is not None]


def _sigma(row: Mapping[str, str | None], name: str, where: str) -> float | None:
    value = _number(row, name, where)
    if value is not None and not 0.0 <= value <= LARGEST_SIGMA:
        raise InputFileError(f"{where}: {name} is {value:g}; accepted: 0 to {LARGEST_SIGMA:g}")
    return value


def _number(row: Mapping[str, str | None], name: str, where: str) -> float | None:
    """The number in a column; None where the column is missing or empty."""
    text = (row.get(name) or "").strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputFileError(f"{where}: {name} is {text!r}; accepted: a number")
    return value
