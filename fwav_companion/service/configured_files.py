"""SHELL: the files that a configuration names: camera, elevation, and what is kept beside a recording."""

from __future__ import annotations

from pathlib import Path

from fwav_companion.camera import Calibration, parse_calibration
from fwav_companion.config import Config
from fwav_companion.errors import InputFileError
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import content, opened

LARGEST_BYTES = 1 << 20
"""A calibration has some hundred bytes; what has a megabyte is another file."""


def load_calibration(config: Config) -> Calibration:
    """Its content. ConfigError where none is named, InputFileError where it cannot be read or is no camera file."""
    path = config.calibration_path
    try:
        with opened(path) as file:
            data = file.read(LARGEST_BYTES)
        return parse_calibration(data.decode(), str(path))
    except OSError as error:
        where = f"{path} ([camera] calibration of {config.file})"
        raise InputFileError(f"{where}: {error.strerror}; accepted: a camera file, as `init` writes one") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path}: byte {error.start} is not UTF-8; accepted: a camera file in YAML") from None


def load_elevation(config: Config) -> tuple[ElevationTile, ...]:
    """What [ground] terrain names, where the ground is terrain. InputFileError for a file that is none."""
    if config.ground.model != "terrain" or not config.ground.terrain:
        return ()
    from fwav_companion.service.elevation_files import (
        read_elevation,  # here: GeoTIFF needs a library that few boards carry
    )

    return read_elevation([config.resolve(path) for path in config.ground.terrain])


def recording_companions(config: Config) -> dict[str, bytes]:
    """The configuration and its camera file as they are now, by the names under which a recording keeps them."""
    if not config.record.directory:
        return {}
    paths = [Path(config.file), *([config.calibration_path] if config.localizes else [])]
    try:
        return {path.name: content(path) for path in paths}
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a file that can be read") from None
