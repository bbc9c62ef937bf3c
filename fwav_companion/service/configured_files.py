"""SHELL: reads the files that a configuration names: camera, elevation, and the copies for a recording."""

from __future__ import annotations

import json
from pathlib import Path

from fwav_companion.camera import Calibration, parse_calibration
from fwav_companion.config import Config, load, parse
from fwav_companion.errors import ConfigError, InputFileError
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import content, open_regular
from fwav_companion.types.secrets import secrets_of

LARGEST_BYTES = 1 << 20
"""Largest size of a calibration file: it has some hundred bytes; a file of a megabyte is another file."""


def load_calibration(config: Config) -> Calibration:
    """The camera file's content. ConfigError if none is configured, InputFileError if it cannot be read or parsed."""
    path = config.calibration_path
    try:
        with open_regular(path) as file:
            data = file.read(LARGEST_BYTES + 1)
        if len(data) > LARGEST_BYTES:
            raise InputFileError(f"{path}: longer than {LARGEST_BYTES} bytes; accepted: a camera file")
        return parse_calibration(data.decode(), str(path), camera=config.calibration_camera)
    except OSError as error:
        where = f"{path} ([camera] calibration of {config.file})"
        raise InputFileError(f"{where}: {error.strerror}; accepted: a camera file, as `init` writes one") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path}: byte {error.start} is not UTF-8; accepted: a camera file in YAML") from None


def load_elevation(config: Config) -> tuple[ElevationTile, ...]:
    """The tiles of [ground] terrain; empty for other ground models. InputFileError if a file is malformed."""
    if config.ground.model != "terrain" or not config.ground.terrain:
        return ()
    from fwav_companion.service.elevation_files import read_elevation  # lazily: few boards need it

    return read_elevation([config.resolve(path) for path in config.ground.terrain])


def recorded_extra_files(config: Config) -> dict[str, bytes]:
    """The present configuration, redacted, and camera file, by the names under which a recording stores them."""
    if not config.record.directory:
        return {}
    paths = [Path(config.file), *([config.calibration_path] if config.localizes else [])]
    try:
        files = {path.name: content(path) for path in paths}
    except OSError as error:
        raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a readable file") from None
    return {**files, paths[0].name: _redacted(files[paths[0].name].decode("utf-8-sig"), config).encode()}


def _redacted(text: str, config: Config) -> str:
    """The text of a configuration without its passwords and tokens. ConfigError if one of them cannot be found."""
    for secret, shown in secrets_of(config):
        text = text.replace(secret, shown)
    if any(secrets_of(parse(text, config.file))):
        raise ConfigError(
            f"{config.file}: a password or token is written with escapes, so that the recording's copy would show it; "
            "accepted: its plain characters"
        )
    return text


def recorded_configuration(folder: Path) -> tuple[str, list[str]]:
    """The one configuration in a recording's folder, and the setting that names the camera file's copy there.

    A recording stores both under their original names. InputFileError if there are several configurations.
    """
    found = sorted(folder.glob("*.toml"))
    if len(found) != 1:
        held = ", ".join(path.name for path in found) or "no configuration (*.toml)"
        raise InputFileError(f"{folder}: it has {held}; accepted: one configuration, or --config FILE")
    return str(found[0]), _recorded_camera(folder, str(found[0]))


def _recorded_camera(folder: Path, config: str) -> list[str]:
    """The setting that names the camera file's copy in the folder, wherever the flight had the file."""
    try:
        flown = load(config)
        name, camera = flown.calibration_path.name, flown.calibration_camera
    except ConfigError:  # a configuration that is wrong is reported when it is read
        return []
    if not (folder / name).is_file():
        return []
    named = str((folder / name).resolve()) + (f"#{camera}" if camera else "")
    quoted = json.dumps(named, ensure_ascii=False).replace("\x7f", "\\u007f")
    return [f"camera.calibration={quoted}"]  # in quotes: a folder's name may have spaces
