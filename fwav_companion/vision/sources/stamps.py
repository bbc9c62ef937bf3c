"""The line of JSON that goes with a picture in a pipe or a folder: its stamp, and what else is known of it."""

from __future__ import annotations

import json
from math import isfinite, nan
from typing import Any

from fwav_companion.vision.images import SourceLostError

STAMPS = ("time_unix", "time_monotonic", "time_boot")


def parse_line(line: bytes | str, what: str) -> dict[str, Any]:
    """The object of a line. SourceLostError where it is none."""
    try:
        told = json.loads(line)
    except (ValueError, RecursionError):
        told = None
    if not isinstance(told, dict):
        raise SourceLostError(f"{what}: not a JSON object")
    return told


def stamp_of(told: dict[str, Any], what: str) -> dict[str, float]:
    """The one stamp of a picture. SourceLostError where there is not exactly one."""
    stamps = {name: _number(told[name]) for name in STAMPS if isinstance(told.get(name), int | float)}
    if len(stamps) != 1 or not all(map(isfinite, stamps.values())):
        raise SourceLostError(f"{what}: accepted: exactly one of {', '.join(STAMPS)}")
    return stamps


def number_of(told: dict[str, Any]) -> int | None:
    """``frame``, where it is told."""
    number = told.get("frame")
    return number if isinstance(number, int) and not isinstance(number, bool) else None


def exposure_of(told: dict[str, Any]) -> float | None:
    """``exposure_s``, where it is told."""
    exposure_s = told.get("exposure_s")
    seconds = _number(exposure_s) if isinstance(exposure_s, int | float) else nan
    return seconds if isfinite(seconds) else None


def _number(told: float) -> float:
    """JSON's whole numbers have no end."""
    try:
        return float(told)
    except OverflowError:
        return nan
