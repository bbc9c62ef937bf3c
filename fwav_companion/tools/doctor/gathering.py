"""SHELL: reads the configured files, and the status of a running service or of one that it runs itself."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping, Sequence
from os.path import realpath
from pathlib import Path
from typing import Any, Final

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config, load_signing_key
from fwav_companion.errors import UserError
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import content
from fwav_companion.service.configured_files import load_calibration, load_elevation
from fwav_companion.service.latest_file import status_paths
from fwav_companion.service.other_run import is_active
from fwav_companion.tools.doctor.evidence import Files
from fwav_companion.tools.doctor.run_status import run_status
from fwav_companion.types.status import RunStatus

NOWHERE: Final = "/dev/null/status.json"
"""Path of the status file that is never written: `check` leaves nothing behind and needs no writable disk."""


class HeardStatus(msgspec.Struct, frozen=True):
    """A status, typed for judging and as it was written."""

    typed: RunStatus
    written: Mapping[str, Any]


def load_files(config: Config) -> tuple[Files, bytes | None]:
    """Return the configured files, and the signing key separately: evidence goes into reports, a key never does."""
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


def running_status(config: Config) -> HeardStatus | None:
    """Return the freshest status of a service that runs with this configuration; None if none runs."""
    found = [status for path in status_paths(config.status_path) if (status := _status_of(path, config)) is not None]
    return max(found, key=lambda status: status.typed.time_monotonic, default=None)


def _status_of(path: Path, config: Config) -> HeardStatus | None:
    """Return a fresh status of a living process; None also if it is unreadable or has another version's form."""
    try:
        written = msgspec.json.decode(content(path))
        typed = run_status(written)
        if typed is None or not typed.config_path:
            return None
        ours = realpath(typed.config_path) == realpath(config.file)
        fresh = is_active(typed.pid, typed.time_monotonic)
    except (OSError, ValueError, ArithmeticError, RecursionError, msgspec.DecodeError):
        return None
    return HeardStatus(typed, written) if ours and fresh else None


def listen(config: Config, files: Files, signing_key: bytes | None, seconds: float) -> HeardStatus:
    """Run the service quietly for some seconds and return its status: it requests rates and time, and sends no more."""
    from fwav_companion.service.daemon import Service

    logging.getLogger("fwav_companion").addHandler(logging.NullHandler())

    async def hear() -> RunStatus:
        service = Service(quiet(config), files.calibration, signing_key, elevation=files.elevation, extra_files={})
        return await service.listen(seconds)

    status = asyncio.run(hear())
    written = msgspec.json.decode(msgspec.json.encode(status))
    return HeardStatus(run_status(written) or RunStatus(), written)


def quiet(config: Config) -> Config:
    """Return the configuration without outputs that other programs act on or that are kept."""
    replace = msgspec.structs.replace
    publish = replace(
        config.publish,
        landing_target=False,
        statustext=False,
        named_values=False,
        adsb=False,
        cot="",
        cot_package="",
        camera_tracking=False,
    )
    return replace(
        config,
        publish=publish,
        record=replace(config.record, directory=""),
        tracking=replace(config.tracking, self_calibration=False),
        status=replace(config.status, file=NOWHERE),
    )
