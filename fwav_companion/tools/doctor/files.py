"""SHELL: what the configuration names on disk, or why it cannot be had."""

from __future__ import annotations

from collections.abc import Sequence

from fwav_companion.camera import Calibration
from fwav_companion.config import Config, load_signing_key
from fwav_companion.errors import UserError
from fwav_companion.localization import ElevationTile
from fwav_companion.service.configured_files import load_calibration, load_elevation
from fwav_companion.tools.doctor.evidence import Files


def load_files(config: Config) -> tuple[Files, bytes | None]:
    """The files, and the signing key beside them: evidence goes into reports, a key never."""
    calibration: Calibration | None = None
    elevation: Sequence[ElevationTile] = ()
    key: bytes | None = None
    calibration_error = elevation_error = key_error = ""
    if config.localizes:
        try:
            calibration = load_calibration(config)
        except UserError as error:
            calibration_error = str(error)
    try:
        elevation = load_elevation(config)
    except UserError as error:
        elevation_error = str(error)
    try:
        key = load_signing_key(config)
    except UserError as error:
        key_error = str(error)
    files = Files(
        calibration=calibration,
        calibration_error=calibration_error,
        elevation=elevation,
        elevation_error=elevation_error,
        key_error=key_error,
    )
    return files, key
