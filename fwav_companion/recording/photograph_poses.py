"""Poses of photographs from a CSV file, one row a picture. PURE."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite, radians

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.rotations import Quaternion, quaternion_from_euler

PLACE, ANGLES = ("lat", "lon"), ("roll_deg", "pitch_deg", "yaw_deg")
SIGMAS = ("position_sigma_m", "height_sigma_m", "attitude_sigma_deg")
SHARED = ("position_bias_m", "height_bias_m", "heading_bias_deg", "mount_bias_deg", "time_offset_sigma_s")
ACCEPTED = (
    "one row a picture with file, frame or time_unix, lat, lon, alt with alt_datum (or alt_amsl), roll_deg, pitch_deg, "
    "yaw_deg, optionally position_sigma_m, height_sigma_m, attitude_sigma_deg, takeoff_alt"
)
DATUMS = ("egm96", "ellipsoid", "takeoff")
TOTAL = "total"
Undulation = Callable[[float, float], float]
"""Height of the geoid above the ellipsoid by latitude and longitude, degrees; metres."""
LARGEST_ANGLE_DEG, LARGEST_SIGMA = 360.0, 10_000.0
"""Largest angle and sigma, the limits of [camera.mount] and of [uncertainty]; a larger number is in other units."""
SAME_TIME_S = 0.01
"""Largest difference of two times of one picture, s: files have hundredths of a second, and two pictures are at least
30 ms apart."""


class PhotographPose(msgspec.Struct, frozen=True, kw_only=True):
    """Pose of the camera in one picture."""

    frame: int | None
    """Number of the picture, as in the detections, or of the row; None: the row has a time alone."""
    time_unix: float | None
    file: str = ""
    """Name of the picture, where neither number nor time say which it is; "": they do."""
    place: Geodetic
    """Centre of the camera; altitude above EGM96, or above the take-off."""
    takeoff_alt_m: float | None = None
    """Altitude of the take-off above EGM96, metres."""
    above_takeoff: bool = False
    """Whether the altitude counts from a take-off whose own altitude is not known."""
    ned_from_carrier: Quaternion
    """Attitude of a carrier whose x axis is the optical axis, image right along y."""
    position_sigma_m: float | None
    """One sigma of the place, each horizontal axis, metres; None: by the configuration."""
    height_sigma_m: float | None
    """One sigma of the altitude, metres; None: by the configuration."""
    attitude_sigma: float | None
    """One sigma about each axis, radians; None: by the configuration."""


class SharedSigmas(msgspec.Struct, frozen=True, kw_only=True):
    """One sigma of the errors that all pictures of a file share, in the units of [uncertainty]; None: not stated."""

    position_bias_m: float | None = None
    height_bias_m: float | None = None
    heading_bias_deg: float | None = None
    mount_bias_deg: float | None = None
    time_offset_sigma_s: float | None = None
    """Delay of a video's telemetry against its pictures; None for photographs."""

    def or_larger(self, other: SharedSigmas) -> SharedSigmas:
        """The larger one of each: of pictures from several sources the worst counts for all."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in SHARED)
        known = ([value for value in pair if value is not None] for pair in pairs)
        return SharedSigmas(**{name: max(values, default=None) for name, values in zip(SHARED, known, strict=True)})


class PosesFile(msgspec.Struct, frozen=True):
    """The poses of a file, and what its sigmas mean."""

    poses: tuple[PhotographPose, ...]
    sigmas_are_total: bool
    """Whether a row's sigma also covers what all pictures share (`# sigmas: total`); else it is the picture's own."""
    shared: SharedSigmas = SharedSigmas()


def parse_poses(text: str, name: str, undulation_m: Undulation) -> PosesFile:
    """The poses of a file, all above EGM96. InputFileError names the line and what is accepted."""
    remarks, body = _remarks(text.removeprefix("\ufeff"))  # a spreadsheet's byte order mark
    poses: list[PhotographPose] = []
    taken: set[object] = set()
    shared = SharedSigmas()
    for number, row in _rows(body, name):
        where = f"{name}: line {number}"
        if row.get("alt_datum") is None and "alt_datum" in remarks:
            row = {**row, "alt_datum": remarks["alt_datum"]}
        pose = _pose(row, where, len(poses), undulation_m)
        key = pose.file or (pose.time_unix if pose.frame is None else pose.frame)
        if (pose.frame is None, key) in taken:
            raise InputFileError(f"{where}: a second row for picture {key}; accepted: {ACCEPTED}")
        taken.add((pose.frame is None, key))
        poses.append(pose)
        shared = shared.or_larger(SharedSigmas(**{name: _sigma(row, name, where) for name in SHARED}))
    if not poses:
        raise InputFileError(f"{name}: it has no pose; accepted: {ACCEPTED}")
    return PosesFile(tuple(poses), remarks.get("sigmas") == TOTAL, shared)


def _remarks(text: str) -> tuple[dict[str, str], str]:
    """The `# key: value` lines, and the text with empty lines in their place."""
    remarks, lines = {}, text.split("\n")
    for index, line in enumerate(lines):
        if line.startswith("#"):
            key, _, value = line[1:].partition(":")
            remarks[key.strip()] = value.strip()
            lines[index] = ""
    return remarks, "\n".join(lines)


def _rows(text: str, name: str) -> Iterator[tuple[int, Mapping[str, str | None]]]:
    before = len(text) - len(text.lstrip("\r\n"))  # the reader takes an empty line for the one that names the columns
    skipped = text[:before].count("\n")
    reader = csv.DictReader(io.StringIO(text[before:], newline=""), skipinitialspace=True)
    try:
        for row in reader:
            yield skipped + reader.line_num, row
    except csv.Error as error:
        raise InputFileError(f"{name}: line {skipped + reader.line_num}: {error}; accepted: {ACCEPTED}") from error


def _pose(row: Mapping[str, str | None], where: str, index: int, undulation_m: Undulation) -> PhotographPose:
    frame, time_unix = _frame(row, where), _number(row, "time_unix", where)
    file = ""
    if frame is None and time_unix is None:
        file = (row.get("file") or "").strip().replace("\\", "/").rpartition("/")[2]
        if not file:
            raise InputFileError(f"{where}: no file, frame or time_unix; accepted: {ACCEPTED}")
        frame = index  # where the detections name no files, the order of this file is that of the pictures
    lat, lon = _all_of(row, PLACE, where)
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
        raise InputFileError(f"{where}: lat {lat:g}, lon {lon:g} is out of range; accepted: degrees")
    angles = _all_of(row, ANGLES, where)
    if max(map(abs, angles)) > LARGEST_ANGLE_DEG:
        raise InputFileError(f"{where}: the angles {angles} are out of range; accepted: degrees from -360 to 360")
    roll, pitch, yaw = map(radians, angles)
    takeoff_alt_m = _number(row, "takeoff_alt", where)
    alt = _altitude(row, where, (lat, lon), takeoff_alt_m, undulation_m)
    position, height, attitude = (_sigma(row, key, where) for key in SIGMAS)
    return PhotographPose(
        frame=frame,
        time_unix=time_unix,
        file=file,
        place=Geodetic.from_degrees(lat, lon, alt),
        takeoff_alt_m=takeoff_alt_m,
        above_takeoff=takeoff_alt_m is None and (row.get("alt_datum") or "").strip() == "takeoff",
        ned_from_carrier=quaternion_from_euler(roll, pitch, yaw),
        position_sigma_m=position,
        height_sigma_m=height,
        attitude_sigma=None if attitude is None else radians(attitude),
    )


def _altitude(
    row: Mapping[str, str | None],
    where: str,
    place: tuple[float, float],
    takeoff_alt_m: float | None,
    undulation_m: Undulation,
) -> float:
    """The altitude above EGM96, metres: H = h - N for one above the ellipsoid; or above an unknown take-off."""
    metres, datum = _number(row, "alt", where), (row.get("alt_datum") or "").strip()
    if metres is None:
        (metres,) = _all_of(row, ("alt_amsl",), where)
        datum = "egm96"
    if datum not in DATUMS:
        raise InputFileError(f"{where}: alt_datum is {datum!r}; accepted: {', '.join(DATUMS)}")
    if datum == "ellipsoid":
        return metres - undulation_m(*place)
    if datum == "takeoff":
        return metres + (takeoff_alt_m or 0.0)
    return metres


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
