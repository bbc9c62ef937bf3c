"""Finds the inputs of a replay in a recording's folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from fwav_companion.errors import InputFileError, UserError
from fwav_companion.recording.folder import DETECTIONS, TELEMETRY
from fwav_companion.service.configured_files import recorded_configuration


def take_from_folder(arguments: argparse.Namespace) -> None:
    """Set telemetry, detections, configuration and camera file to the folder's. `--config` overrides the configuration.

    UserError if another option names one of these inputs, InputFileError if the folder does not have them.
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
        arguments.config, camera = recorded_configuration(folder)
        arguments.set = [*camera, *arguments.set]


def _held(folder: Path, name: str) -> Path:
    path = folder / name
    if not path.is_file():
        raise InputFileError(f"{folder}: it has no {name}; accepted: a recording's folder")
    return path
