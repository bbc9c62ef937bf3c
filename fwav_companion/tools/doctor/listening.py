"""SHELL: what the service hears: by its status file where it runs, else by running it quietly for some seconds."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from os.path import realpath
from pathlib import Path
from typing import Any, Final

import msgspec

from fwav_companion.camera import Calibration
from fwav_companion.config import Config
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import content
from fwav_companion.service.latest_file import status_paths
from fwav_companion.tools.doctor.status_form import is_of_our_form

FRESH_S: Final = 3.0
"""A status file is rewritten each second."""
NOWHERE: Final = "/dev/null/status.json"
"""No status file: a doctor leaves nothing behind, and needs no disk that can be written."""


def running_status(config: Config) -> Mapping[str, Any] | None:
    """The freshest status of a service that runs with this configuration; None where none does."""
    told = [status for path in status_paths(config.status.file) if (status := _status_of(path, config)) is not None]
    return max(told, key=lambda status: float(status["time_monotonic"]), default=None)


def _status_of(path: Path, config: Config) -> Mapping[str, Any] | None:
    """A fresh one of a process that lives. None too where we may not read it, or another version wrote it."""
    try:
        status = msgspec.json.decode(content(path))
        age_s = time.monotonic() - float(status["time_monotonic"])
        ours = realpath(status["config_path"]) == realpath(config.file)
        fresh = 0.0 <= age_s <= FRESH_S and _lives(int(status["pid"]))
    except (OSError, ValueError, ArithmeticError, KeyError, TypeError, RecursionError, msgspec.DecodeError):
        return None
    return status if ours and fresh and is_of_our_form(status) else None


def _lives(pid: int) -> bool:
    with suppress(PermissionError):  # it is there, and another user's
        os.kill(pid, 0)
    return True


def listen(
    config: Config,
    calibration: Calibration | None,
    signing_key: bytes | None,
    elevation: tuple[ElevationTile, ...],
    seconds: float,
) -> Mapping[str, Any]:
    """Run the service itself for so long: it asks for rates and the time, and steers, tells and records nothing."""
    from fwav_companion.service.daemon import Service

    logging.getLogger("fwav_companion").addHandler(logging.NullHandler())

    async def hear() -> Mapping[str, Any]:
        service = Service(quiet(config), calibration, signing_key, elevation=elevation, beside_recording={})
        return await service.listen(seconds)

    return asyncio.run(hear())


def quiet(config: Config) -> Config:
    """The same without what others would act on or keep."""
    replace = msgspec.structs.replace
    publish = replace(
        config.publish,
        landing_target=False,
        statustext=False,
        named_values=False,
        adsb=False,
        cot="",
        camera_tracking=False,
    )
    return replace(
        config,
        publish=publish,
        record=replace(config.record, directory=""),
        tracking=replace(config.tracking, self_calibration=False),
        status=replace(config.status, file=NOWHERE),
    )
