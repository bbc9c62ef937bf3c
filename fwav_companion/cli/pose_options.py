"""Options of `locate` and `detect` about the poses of pictures."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fwav_companion.errors import InputFileError, UserError
from fwav_companion.libraries import require

if TYPE_CHECKING:
    from fwav_companion.photographs.picture_pose import NoPose, PictureLens, PicturePose


def given_angles(arguments: argparse.Namespace) -> tuple[float, float, float] | None:
    """Roll, pitch and yaw of --angles, degrees. UserError."""
    if arguments.angles is None:
        return None
    roll, pitch, yaw = numbers("--angles", arguments.angles, ("ROLL", "PITCH", "YAW"), 360.0)
    return (roll, pitch, yaw)


class GivenPoses(NamedTuple):
    """What a file of --poses says about pictures, by their names."""

    poses: Mapping[str, PicturePose | NoPose]
    lenses: Mapping[str, PictureLens]


def given_poses(arguments: argparse.Namespace, pictures: Callable[[], Sequence[Path]]) -> GivenPoses | None:
    """The poses of --poses. InputFileError where the file is none of the known tables.

    ``pictures``: returns the files whose positions align a model that has no place on the map.
    """
    from fwav_companion.photographs.pose_tables import is_colmap, parse_pose_table
    from fwav_companion.photographs.table_crs import required_crs
    from fwav_companion.photographs.table_poses import poses_of_table

    crs = None if arguments.poses_crs is None else required_crs(arguments.poses_crs)
    if arguments.poses is None:
        return None
    path: Path = arguments.poses
    path, name = (path / "images.txt" if path.is_dir() else path), str(arguments.poses)
    text = text_of(path)
    if is_colmap(text):
        return _of_colmap(path, text, pictures())
    return GivenPoses(poses_of_table(parse_pose_table(text, name), name, crs), {})


def _of_colmap(path: Path, text: str, pictures: Sequence[Path]) -> GivenPoses:
    require("--poses of COLMAP", "numpy", "PIL")
    from fwav_companion.photographs.colmap import aligned_poses, parse_colmap
    from fwav_companion.photographs.files import read_tags
    from fwav_companion.photographs.pose_from_tags import pose_from_tags

    cameras = path.with_name("cameras.txt")
    model = parse_colmap(text, text_of(cameras) if cameras.is_file() else "", str(path))
    tagged = {each.name: pose_from_tags(read_tags(each)) for each in pictures}
    return GivenPoses(aligned_poses(model, tagged, str(path)), model.lens_by_file())


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
