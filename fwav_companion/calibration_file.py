"""SHELL: the camera file that a configuration names."""

from __future__ import annotations

from fwav_companion.camera import Calibration, parse_calibration
from fwav_companion.config import Config
from fwav_companion.errors import InputFileError

LARGEST_BYTES = 1 << 20
"""A calibration has some hundred bytes; what has a megabyte is another file."""


def load_calibration(config: Config) -> Calibration:
    """Its content. ConfigError where none is named, InputFileError where it cannot be read or is no camera file."""
    path = config.calibration_path
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES)
        return parse_calibration(data.decode(), str(path))
    except OSError as error:
        where = f"{path} ([camera] calibration of {config.file})"
        raise InputFileError(f"{where}: {error.strerror}; accepted: a camera file, as `init` writes one") from None
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path}: byte {error.start} is not UTF-8; accepted: a camera file in YAML") from None
