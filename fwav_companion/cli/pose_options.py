"""Options of `locate` and `detect` about the poses of pictures."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fwav_companion.errors import InputFileError, UserError

if TYPE_CHECKING:
    from fwav_companion.photographs.picture_pose import NoPose, PicturePose


def given_angles(arguments: argparse.Namespace) -> tuple[float, float, float] | None:
    """Roll, pitch and yaw of --angles, degrees. UserError."""
    if arguments.angles is None:
        return None
    roll, pitch, yaw = numbers("--angles", arguments.angles, ("ROLL", "PITCH", "YAW"), 360.0)
    return (roll, pitch, yaw)


def given_poses(arguments: argparse.Namespace) -> dict[str, PicturePose | NoPose] | None:
    """The poses of --poses by the pictures' names. InputFileError where the file is none of the known tables."""
    from fwav_companion.photographs.pose_tables import parse_pose_table
    from fwav_companion.photographs.table_crs import required_crs
    from fwav_companion.photographs.table_poses import poses_of_table

    crs = None if arguments.poses_crs is None else required_crs(arguments.poses_crs)
    if arguments.poses is None:
        return None
    name = str(arguments.poses)
    return poses_of_table(parse_pose_table(text_of(arguments.poses), name), name, crs)


def numbers(option: str, text: str, names: Sequence[str], largest: float) -> list[float]:
    """The numbers of an option, in degrees. UserError names what is accepted."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != len(names) or not all(abs(number) <= largest for number in found):
        raise UserError(f"{option} {text}: accepted: {','.join(names)} in degrees")
    return found


def text_of(path: Path) -> str:
    """The content of a text file. InputFileError."""
    from fwav_companion.on_disk import content

    try:
        return content(path).decode()
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path}: byte {error.start} is not UTF-8; accepted: a text file") from None
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a readable file") from None
