"""SHELL: finds another `run` that is active, by the status file that it rewrites each second."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import msgspec

from fwav_companion.on_disk import content

FRESH_S: Final = 3.0
"""Largest age of the status of an active service, which rewrites it once a second."""


class _Sign(msgspec.Struct):
    """The part of a status that shows whether its service is active."""

    pid: int
    time_monotonic: float


def is_active(pid: int, time_monotonic: float) -> bool:
    """Whether the status of this process and time belongs to an active service."""
    return 0.0 <= time.monotonic() - time_monotonic <= FRESH_S and pid > 0 and _lives(pid)


def other_run(paths: Sequence[Path]) -> tuple[int, Path] | None:
    """The process id of another active service and its status file, one of these paths; None if there is none."""
    for path in paths:
        with suppress(OSError, ValueError, RecursionError, msgspec.DecodeError):
            sign = msgspec.json.decode(content(path), type=_Sign)
            if sign.pid != os.getpid() and is_active(sign.pid, sign.time_monotonic):
                return sign.pid, path
    return None


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except PermissionError:  # it exists and is another user's
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True
