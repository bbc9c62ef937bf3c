"""The inputs of a replay that a recording's folder holds."""

from __future__ import annotations

import argparse
from pathlib import Path

from fwav_companion.config import load
from fwav_companion.errors import ConfigError, InputFileError, UserError
from fwav_companion.recording.folder import DETECTIONS, TELEMETRY


def take_from_folder(arguments: argparse.Namespace) -> None:
    """Set telemetry, detections, configuration and camera file to those in the folder. `--config` overrides its own.

    UserError where another option names the same, InputFileError where the folder does not hold them.
    """
    folder = Path(arguments.folder)
    for option in ("telemetry", "poses", "detections"):
        if getattr(arguments, option) is not None:
            raise UserError(f"--{option} and the folder {folder}: accepted: one of the two")
    if not folder.is_dir():
        raise InputFileError(f"{folder}: not a folder; accepted: a recording's folder, or --telemetry and --detections")
    arguments.telemetry = [str(_held(folder, TELEMETRY))]
    arguments.detections = [str(_held(folder, DETECTIONS))]
    if arguments.config is None:
        arguments.config = str(_configuration(folder))
        arguments.set = [*_camera(folder, arguments.config), *arguments.set]


def _held(folder: Path, name: str) -> Path:
    path = folder / name
    if not path.is_file():
        raise InputFileError(f"{folder}: it has no {name}; accepted: a recording's folder")
    return path


def _configuration(folder: Path) -> Path:
    """The one configuration in the folder: a recording stores it under the name that it had."""
    found = sorted(folder.glob("*.toml"))
    if len(found) != 1:
        held = ", ".join(path.name for path in found) or "none"
        raise InputFileError(f"{folder}: its configurations (*.toml) are {held}; accepted: one, or --config FILE")
    return found[0]


def _camera(folder: Path, config: str) -> list[str]:
    """The setting that names the camera file's copy in the folder, wherever the flight had the file."""
    try:
        name = load(config).calibration_path.name
    except ConfigError:  # a configuration that is wrong is reported when it is read
        return []
    return [f"camera.calibration={(folder / name).resolve()}"] if (folder / name).is_file() else []
