"""Rows of a table of poses as poses of pictures: true north, gimbal angles, degrees. PURE."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, radians
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.mounts import euler_from_body_from_camera
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_euler
from fwav_companion.geometry.vectors import Matrix3, multiply
from fwav_companion.photographs.makers import ADJUSTED, CONSUMER, DISPUTED
from fwav_companion.photographs.picture_pose import AltDatum, Altitude, NoPose, PicturePose, Sigma
from fwav_companion.photographs.pose_from_tags import gimbal_angles_from_nadir_body
from fwav_companion.photographs.pose_tables import PoseTable, TablePose
from fwav_companion.photographs.table_crs import ACCEPTED, TableCrs

NED_FROM_ENU: Final[Matrix3] = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
DATUM_NOTE: Final = "the table does not state its altitudes' datum; taken as above sea level: give --alt-datum"


def poses_of_table(table: PoseTable, name: str, crs: TableCrs | None) -> dict[str, PicturePose | NoPose]:
    """The poses by the pictures' names; a NoPose has the place of a row without angles.

    ``crs``: where the file names none. InputFileError where neither does, or where a row is no place.
    """
    crs = table.crs or crs
    if crs is None:
        raise InputFileError(
            f"{name}: its first line is {table.first_line[:60]!r}: it names no coordinate system; give --poses-crs; "
            f"accepted: {ACCEPTED}"
        )
    found: dict[str, PicturePose | NoPose] = {}
    for row in table.rows:
        file = row.file.replace("\\", "/").rpartition("/")[2]
        if file in found:
            raise InputFileError(f"{name}: {file}: two rows for it; accepted: one for each picture")
        found[file] = _pose(row, name, crs, table.program)
    return found


def with_pose_of_table(
    tags: PicturePose | NoPose, file: str, table: Mapping[str, PicturePose | NoPose]
) -> PicturePose | NoPose:
    """The pose of the table; the angles of the picture's own tags where the table has none, as geo.txt may."""
    given = table.get(file, table.get(file.rpartition(".")[0]))  # Metashape's labels have no suffix
    if given is None:
        return NoPose("it is not in the table of --poses")
    if isinstance(given, PicturePose):
        return msgspec.structs.replace(given, above_takeoff=getattr(tags, "above_takeoff", None))
    if given.place is None or isinstance(tags, NoPose):
        return given
    kept = {name: getattr(given.place, name) for name in ("lat_deg", "lon_deg", "absolute", "layout", "notes")}
    return msgspec.structs.replace(
        tags, **kept, sigmas=msgspec.structs.replace(tags.sigmas, position_m=given.place.sigmas.position_m)
    )


def _pose(row: TablePose, name: str, crs: TableCrs, program: str) -> PicturePose | NoPose:
    try:
        lat, lon = crs.degrees(row.x, row.y)
    except ValueError as error:
        raise InputFileError(f"{name}: {row.file}: {row.x:g}, {row.y:g}: {error}") from None
    sigmas = ADJUSTED if row.enu_from_camera is not None else CONSUMER
    height = DISPUTED
    if row.sigma_m is not None:
        across, up = row.sigma_m
        sigmas = msgspec.structs.replace(sigmas, position_m=Sigma(across, across))
        height = Sigma(up, max(up, DISPUTED.shared))
    roll = pitch = yaw = 0.0
    if row.enu_from_camera is not None:
        turn = radians((row.grid or crs).convergence_deg(lat, lon))
        from_grid = matrix_from_quaternion(quaternion_from_euler(0.0, 0.0, turn))
        ned_from_camera = multiply(from_grid, multiply(NED_FROM_ENU, row.enu_from_camera))
        roll, pitch, yaw = map(degrees, euler_from_body_from_camera(ned_from_camera))
    elif row.ypr_deg is not None:
        roll, pitch, yaw = gimbal_angles_from_nadir_body(row.ypr_deg[2], row.ypr_deg[1], row.ypr_deg[0])
    pose = PicturePose(
        lat_deg=lat,
        lon_deg=lon,
        roll_deg=roll,
        pitch_deg=pitch,
        yaw_deg=yaw,
        absolute=None if row.z is None else Altitude(row.z, AltDatum.EGM96, height, DATUM_NOTE),
        above_takeoff=None,
        sigmas=sigmas,
        layout=program,
    )
    if row.enu_from_camera is None and row.ypr_deg is None:
        return NoPose("neither the table nor the tags have its angles; give --angles ROLL,PITCH,YAW", pose)
    return pose
