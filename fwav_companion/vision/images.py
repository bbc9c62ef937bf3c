"""Pictures with their stamps, and the protocols of sources and detectors.

Only the vision process loads this module: the daemon handles neither pictures nor numpy.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import isfinite, nan
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from fwav_companion.errors import CompanionError
from fwav_companion.vision.wire import MAX_DETECTIONS

Pixels = NDArray[np.uint8]
"""(height, width) grey levels, or (height, width, 3) in OpenCV's order blue, green, red."""
Found = dict[str, Any]
"""One detection in the wire format: u, v, sigma, label, box, id, corners."""

STAMPS = ("time_unix", "time_monotonic", "time_boot")


class SourceLostError(CompanionError):
    """The source does not exist, or was lost; the worker opens it again later."""


class SourceEndedError(CompanionError):
    """The source has delivered its last picture."""


@dataclass(frozen=True)
class Picture:
    """One frame of a camera."""

    pixels: Pixels
    stamp: dict[str, float]
    """Exactly one of time_unix, time_monotonic, time_boot, in seconds."""
    number: int | None = None
    exposure_s: float | None = None
    clock: str = ""
    """Source of the stamp: sensor, driver, arrival, server, file; "": the name of the stamp."""
    skipped: int = 0
    """Number of pictures that were skipped before it."""
    file: str = ""
    """Name of the picture's file; "" for a camera."""


class DetectorError(CompanionError):
    """The detector cannot work: its model or its library."""


class Source(Protocol):
    """An open source of pictures, used until it raises, then closed."""

    def read(self, timeout_s: float) -> Picture | None:
        """The next picture; None if none comes in time. Raises SourceLostError or SourceEndedError."""

    def close(self) -> None:
        """Release the source; never raises."""


class Detector(Protocol):
    """Finds targets in a picture."""

    def detect(self, pixels: Pixels) -> list[Found]:
        """The detections, in the picture's own pixels; (0, 0) is the centre of its first pixel."""


def grey(pixels: Pixels) -> Pixels:
    """Grey levels of a grey or colour picture."""
    if pixels.ndim == 2:
        return pixels
    import cv2

    converted: Pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    return converted


def parse_line(line: bytes | str, what: str) -> dict[str, Any]:
    """The JSON object that describes a picture in a pipe or a folder. SourceLostError if the line is not an object."""
    try:
        described = json.loads(line)
    except (ValueError, RecursionError):
        described = None
    if not isinstance(described, dict):
        raise SourceLostError(f"{what}: not a JSON object")
    return described


def stamp_of(described: dict[str, Any], what: str) -> dict[str, float]:
    """The stamp of a picture by its description. SourceLostError unless there is exactly one."""
    stamps = {name: _number(described[name]) for name in STAMPS if isinstance(described.get(name), int | float)}
    if len(stamps) != 1 or not all(map(isfinite, stamps.values())):
        raise SourceLostError(f"{what}: accepted: exactly one of {', '.join(STAMPS)}")
    return stamps


def number_of(described: dict[str, Any]) -> int | None:
    """The optional ``frame``."""
    number = described.get("frame")
    return number if isinstance(number, int) and not isinstance(number, bool) else None


def exposure_of(described: dict[str, Any]) -> float | None:
    """The optional ``exposure_s``."""
    exposure_s = described.get("exposure_s")
    seconds = _number(exposure_s) if isinstance(exposure_s, int | float) else nan
    return seconds if isfinite(seconds) else None


def _number(value: float) -> float:
    """The value as a float; NaN for one of JSON's unbounded integers that is too large."""
    try:
        return float(value)
    except OverflowError:
        return nan


def frame_bytes(picture: Picture, found: list[Found], kept: int | None = None) -> bytes:
    """The detections of a picture in the wire format. ``kept``: the picture's number if it is kept for clicks."""
    height, width = picture.pixels.shape[:2]
    frame = {**picture.stamp, "size": [width, height], "detections": found[:MAX_DETECTIONS]}
    if picture.number is not None:
        frame["frame"] = picture.number
    if picture.exposure_s is not None:
        frame["exposure_s"] = picture.exposure_s
    if kept is not None:
        frame["picture"] = kept
    if picture.file:
        frame["file"] = picture.file
    return msgspec.json.encode(frame)
