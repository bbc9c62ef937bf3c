"""What a camera hands on: one picture with its stamp, and the two contracts of this side of the room.

Loaded in the vision process alone: the daemon has no picture in it, and no numpy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fwav_companion.errors import CompanionError

Pixels = NDArray[np.uint8]
"""(height, width) grey levels, or (height, width, 3) in OpenCV's order blue, green, red."""
Found = dict[str, Any]
"""One detection as the wire has it: u, v, sigma, label, box, id, corners."""


class SourceLostError(CompanionError):
    """The source is not there, or no longer: it is opened again after a while."""


class SourceEndedError(CompanionError):
    """The source has shown everything it had."""


@dataclass(frozen=True)
class Picture:
    """One frame of a camera."""

    pixels: Pixels
    stamp: dict[str, float]
    """Exactly one of time_unix, time_monotonic, time_boot, in seconds."""
    number: int | None = None
    exposure_s: float | None = None


class Source(Protocol):
    """Something that delivers pictures; made open, used until it raises, then closed."""

    def read(self, timeout_s: float) -> Picture | None:
        """The next picture; None where none comes in time. Raises SourceLostError or SourceEndedError."""

    def close(self) -> None:
        """Let go of it; never raises."""


class Detector(Protocol):
    """Something that finds targets in a picture."""

    def detect(self, pixels: Pixels) -> list[Found]:
        """What was found, in the picture's own pixels; (0, 0) is the centre of its first pixel."""


def grey(pixels: Pixels) -> Pixels:
    """Grey levels of a picture of either form."""
    if pixels.ndim == 2:
        return pixels
    import cv2

    converted: Pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    return converted
