"""Tables of poses by photogrammetry programs, recognised by their content. PURE.

| file | angles |
|---|---|
| OpenDroneMap geo.txt | yaw, pitch, roll of a body whose camera looks down, from true north; may be missing |
| OpenDroneMap shots.geojson | axis and angle (Rodrigues), from grid to camera |
| Pix4D calibrated_external_camera_parameters | omega, phi, kappa, from grid north |
| Pix4D calibrated_camera_parameters | matrix from grid to camera |
| Metashape cameras, omega phi kappa | as Pix4D's |
| Metashape reference | yaw, pitch, roll as in geo.txt |

Omega, phi, kappa: R(world from camera) = Rx(omega) Ry(phi) Rz(kappa), camera x right, y up, z backwards; world x east,
y north, z up.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from math import cos, isfinite, radians, sin
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.map_grid import utm_from_degrees
from fwav_companion.geometry.rotations import exp, matrix_from_quaternion
from fwav_companion.geometry.vectors import Matrix3, multiply, transpose
from fwav_companion.photographs.table_crs import TableCrs, table_crs

ACCEPTED: Final = (
    "OpenDroneMap's geo.txt or shots.geojson, Pix4D's calibrated_external_camera_parameters.txt or "
    "calibrated_camera_parameters.txt, Metashape's omega-phi-kappa or reference table"
)
FLIP: Final[Matrix3] = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
"""From camera axes y up, z backwards to y down, z forward."""
MOST_ROWS: Final = 200_000
NUMBERS_OF_PIX4D: Final = 26
"""K (9), radial (3), tangential (2), centre (3), R (9)."""
OWN_COLUMN: Final = "roll_deg"
"""In the header of the files of poses that `detect` writes and `replay` reads."""
PICTURE_OF_PIX4D: Final = re.compile(r"^(.+?)\s+\d+\s+\d+$")
COLMAP: Final = re.compile(r"#.*IMAGE_ID,\s*QW", re.IGNORECASE)
FIRST_LINES: Final = 6


class TablePose(msgspec.Struct, frozen=True, kw_only=True):
    """One row: a camera in the table's coordinate system."""

    file: str
    x: float
    y: float
    z: float | None
    enu_from_camera: Matrix3 | None = None
    """Camera x right, y down, z forward; east and north of the table's grid."""
    ypr_deg: tuple[float, float, float] | None = None
    """Yaw, pitch and roll of a body whose camera looks down, from true north."""
    grid: TableCrs | None = None
    """The grid that ``enu_from_camera`` counts from, where it is not the table's coordinate system."""
    sigma_m: tuple[float, float] | None = None
    """Of the horizontal position and of the height."""


class PoseTable(msgspec.Struct, frozen=True, kw_only=True):
    """The rows of a file."""

    program: str
    crs: TableCrs | None
    """None where the file does not name it."""
    rows: tuple[TablePose, ...]
    first_line: str


def is_pose_table(text: str) -> bool:
    """Whether the content is one of the known tables, and not a file of poses of our own."""
    lines = text.removeprefix("\ufeff").splitlines()
    if any(OWN_COLUMN in line for line in lines[:20]):
        return False
    first = next((line.strip() for line in lines if line.strip()), "")
    return any(is_it(first, text) for is_it, _, _ in READERS)


def is_colmap(text: str) -> bool:
    """Whether the content is COLMAP's images.txt, by the remarks at its beginning."""
    return any(COLMAP.search(line) for line in text.splitlines()[:FIRST_LINES])


def parse_pose_table(text: str, name: str) -> PoseTable:
    """The rows. InputFileError with the first line where the content is none of the known tables."""
    lines = [line.strip() for line in text.removeprefix("\ufeff").splitlines()]
    filled = [(number, line) for number, line in enumerate(lines, start=1) if line]
    first = filled[0][1] if filled else ""
    if is_colmap(text):
        raise InputFileError(
            f"{name}: its first line is {first[:60]!r}: COLMAP's world has no place on the map; accepted: in `locate` "
            f"and `detect` with pictures whose tags have positions; {ACCEPTED}"
        )
    for is_it, program, read in READERS:
        if is_it(first, text):
            crs, rows = read(text, filled, name)
            found = tuple(rows)
            if not found or len(found) > MOST_ROWS:
                raise InputFileError(f"{name}: {len(found)} poses; accepted: 1 to {MOST_ROWS} rows of {program}")
            return PoseTable(program=program, crs=crs, rows=found, first_line=first)
    raise InputFileError(f"{name}: its first line is {first[:60]!r}; accepted: {ACCEPTED}")


Lines = Sequence[tuple[int, str]]
Read = tuple[TableCrs | None, Iterator[TablePose]]


def _geo_txt(_text: str, lines: Lines, name: str) -> Read:
    """Columns by their number: image x y [z] [yaw pitch roll] [sigma sigma]; NaN angles are none."""

    def rows() -> Iterator[TablePose]:
        for number, line in lines[1:]:
            if line.startswith("#"):
                continue
            file, *parts = line.split()
            where = f"{name}: line {number}"
            if len(parts) < 2:
                raise InputFileError(f"{where}: {line[:60]!r}; accepted: image x y [z] [yaw pitch roll] [sigmas]")
            x, y = _numbers(parts[:2], where)
            (z,) = _numbers(parts[2:3], where) if len(parts) > 2 else (None,)
            angles = None
            if len(parts) >= 6 and "nan" not in "".join(parts[3:6]).lower():
                yaw, pitch, roll = _numbers(parts[3:6], where)
                angles = (yaw, pitch, roll)
            sigma = None
            if len(parts) >= 8:
                across, up = _numbers(parts[6:8], where)
                sigma = (across, up) if across > 0.0 and up > 0.0 else None
            yield TablePose(file=file, x=x, y=y, z=z, ypr_deg=angles, sigma_m=sigma)

    return table_crs(lines[0][1]), rows()


def _shots(text: str, _lines: Lines, name: str) -> Read:
    """Places in degrees in the geometry; the rotation counts from the grid of its UTM zone."""

    def rows() -> Iterator[TablePose]:
        grid: TableCrs | None = None
        try:
            features = json.loads(text)["features"]
            for feature in features:
                properties, place = feature["properties"], feature["geometry"]["coordinates"]
                turn = _numbers(properties["rotation"], name)
                lon, lat, *height = _numbers(place, name)
                if grid is None:  # one zone for the whole project
                    utm = utm_from_degrees(lat, lon)
                    grid = TableCrs() if utm is None else TableCrs(utm.zone, lat < 0.0)
                camera_from_enu = matrix_from_quaternion(exp((turn[0], turn[1], turn[2])))
                yield TablePose(
                    file=str(properties["filename"]),
                    x=lon,
                    y=lat,
                    z=height[0] if height else None,
                    enu_from_camera=transpose(camera_from_enu),
                    grid=grid,
                )
        except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
            raise InputFileError(f"{name}: {type(error).__name__}: {error}; accepted: {ACCEPTED}") from None

    return TableCrs(), rows()


def _omega_phi_kappa(_text: str, lines: Lines, name: str) -> Read:
    """Pix4D's and Metashape's columns: file X Y Z omega phi kappa, by blanks, tabs or commas."""

    def rows() -> Iterator[TablePose]:
        for number, line in lines:
            parts = _split(line)
            if line.startswith("#") or parts[0].lower() in ("imagename", "photoid"):
                continue
            where = f"{name}: line {number}"
            if len(parts) < 7:
                raise InputFileError(f"{where}: {line[:60]!r}; accepted: name X Y Z omega phi kappa")
            x, y, z, omega, phi, kappa = _numbers(parts[1:7], where)
            turn = multiply(multiply(_about_x(radians(omega)), _about_y(radians(phi))), _about_z(radians(kappa)))
            yield TablePose(file=parts[0], x=x, y=y, z=z, enu_from_camera=multiply(turn, FLIP))

    return _named_crs(lines), rows()


def _reference(_text: str, lines: Lines, name: str) -> Read:
    """Metashape's reference: columns by the header, with commas or tabs."""
    header_at = next(i for i, (_, line) in enumerate(lines) if "yaw" in line.lower())
    columns = [each.strip().lower() for each in _split(lines[header_at][1].lstrip("#"))]
    wanted = [("x/longitude", "x/easting", "longitude", "x"), ("y/latitude", "y/northing", "latitude", "y"),
              ("z/altitude", "altitude", "z"), ("yaw",), ("pitch",), ("roll",)]  # fmt: skip
    places = [next((columns.index(each) for each in names if each in columns), None) for names in wanted]
    degrees = any("longitude" in each for each in columns) and "x/longitude" not in columns

    def rows() -> Iterator[TablePose]:
        for number, line in lines[header_at + 1 :]:
            parts = _split(line)
            where = f"{name}: line {number}"
            if line.startswith("#"):
                continue
            if None in places or len(parts) <= max(each or 0 for each in places):
                raise InputFileError(f"{where}: {line[:60]!r}; accepted: Label, X, Y, Z, Yaw, Pitch, Roll")
            x, y, z, yaw, pitch, roll = _numbers([parts[each or 0] for each in places], where)
            yield TablePose(file=parts[0], x=x, y=y, z=z, ypr_deg=(yaw, pitch, roll))

    return (TableCrs() if degrees else _named_crs(lines)), rows()


def _pix4d_matrices(_text: str, lines: Lines, name: str) -> Read:
    """A line with the name and the size, then numbers, one picture after the other."""

    def rows() -> Iterator[TablePose]:
        file, numbers, where = "", list[float](), name
        for number, line in [*lines, (0, "end 0 0")]:
            try:
                values = [float(each) for each in line.split()]
            except ValueError:
                if file and len(numbers) == NUMBERS_OF_PIX4D:
                    x, y, z = numbers[14:17]
                    r = numbers[17:26]
                    matrix = ((r[0], r[3], r[6]), (r[1], r[4], r[7]), (r[2], r[5], r[8]))  # transposed
                    yield TablePose(file=file, x=x, y=y, z=z, enu_from_camera=matrix)
                elif file and numbers:
                    raise InputFileError(f"{where}: {len(numbers)} numbers of {file}; accepted: 26") from None
                named = PICTURE_OF_PIX4D.match(line)
                file, numbers, where = named[1] if named else "", [], f"{name}: line {number}"
                continue
            if not all(map(isfinite, values)):
                raise InputFileError(f"{name}: line {number}: {line[:60]!r} is no number")
            numbers += values

    return None, rows()


def _named_crs(lines: Lines) -> TableCrs | None:
    """The coordinate system that a remark names: an EPSG code, or WGS 84 without a projection."""
    for _, line in lines:
        if not line.startswith("#"):
            break
        if "PROJCS" in line:
            code = re.findall(r'AUTHORITY\["EPSG","(\d+)"\]\]\s*$', line)
            return table_crs(f"EPSG:{code[0]}") if code else None
        if re.search(r'GEOGCS\["WGS 84"', line):
            return TableCrs()
        found = table_crs(line.lstrip("# ").removeprefix("CoordinateSystem:"))
        if found is not None:
            return found
    return None


def _split(line: str) -> list[str]:
    parts = re.split(r"\s*[,\t;]\s*", line) if re.search(r"[,\t;]", line) else line.split()
    return [each.strip().strip('"') for each in parts]


def _numbers(parts: Sequence[object], where: str) -> list[float]:
    try:
        numbers = [float(each) for each in parts]  # type: ignore[arg-type]
    except (TypeError, ValueError):
        numbers = [float("nan")]
    if not all(map(isfinite, numbers)):
        raise InputFileError(f"{where}: {' '.join(map(str, parts))[:60]!r} are not all numbers")
    return numbers


def _about_x(a: float) -> Matrix3:
    return ((1.0, 0.0, 0.0), (0.0, cos(a), -sin(a)), (0.0, sin(a), cos(a)))


def _about_y(a: float) -> Matrix3:
    return ((cos(a), 0.0, sin(a)), (0.0, 1.0, 0.0), (-sin(a), 0.0, cos(a)))


def _about_z(a: float) -> Matrix3:
    return ((cos(a), -sin(a), 0.0), (sin(a), cos(a), 0.0), (0.0, 0.0, 1.0))


Is = Callable[[str, str], bool]
READERS: Final[tuple[tuple[Is, str, Callable[[str, Lines, str], Read]], ...]] = (
    (lambda first, text: first.startswith("{") and '"rotation"' in text, "shots.geojson", _shots),
    (lambda first, _: first.lower().startswith("imagename") and "omega" in first.lower(), "Pix4D", _omega_phi_kappa),
    (lambda first, _: first.lower().startswith("filename imagewidth"), "Pix4D's matrices", _pix4d_matrices),
    (lambda first, text: first.startswith("#") and "omega" in text[:2000].lower(), "Metashape", _omega_phi_kappa),
    (lambda first, text: first.startswith("#") and "yaw" in text[:4000].lower(), "Metashape's reference", _reference),
    (lambda first, _: table_crs(first) is not None, "geo.txt", _geo_txt),
)
