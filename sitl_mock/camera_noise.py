"""Random draws of the camera and its detector: from one stream as they come, or from a stream for each cause."""

from __future__ import annotations

from random import Random
from typing import Protocol


class CameraNoise(Protocol):
    """Draws of one camera. ``next_target`` comes once for each target of each frame, in view or not."""

    latency: Random
    clutter: Random
    """False detections and outliers."""
    order: Random
    """Order of the detections in a frame."""

    def next_target(self) -> None:
        """Begins the draws of the next target."""

    def is_missed(self, share: float) -> bool:
        """Whether this target is missed."""

    def offset(self, sigma: float) -> tuple[float, float]:
        """Error of this target's pixel."""


class SharedStream:
    """All draws from one stream: a target out of view draws nothing."""

    def __init__(self, seed: int) -> None:
        self.latency = self.clutter = self.order = self._rng = Random(f"{seed}/camera")

    def next_target(self) -> None:
        """Draws nothing."""

    def is_missed(self, share: float) -> bool:
        """Whether this target is missed."""
        return bool(share) and self._rng.random() < share

    def offset(self, sigma: float) -> tuple[float, float]:
        """Error of this target's pixel."""
        return (self._rng.gauss(0.0, sigma), self._rng.gauss(0.0, sigma)) if sigma else (0.0, 0.0)


class StreamsByCause:
    """A stream for each cause, with as many draws for a target in view as for one out of it."""

    def __init__(self, seed: int) -> None:
        self.latency, self.clutter, self.order, self._missed, self._pixel = (
            Random(f"{seed}/camera/{cause}") for cause in ("latency", "clutter", "order", "missed", "pixel")
        )
        self._chance, self._unit = 0.0, (0.0, 0.0)

    def next_target(self) -> None:
        """Draws everything about the next target."""
        self._chance = self._missed.random()
        self._unit = (self._pixel.gauss(0.0, 1.0), self._pixel.gauss(0.0, 1.0))

    def is_missed(self, share: float) -> bool:
        """Whether this target is missed."""
        return self._chance < share

    def offset(self, sigma: float) -> tuple[float, float]:
        """Error of this target's pixel."""
        return (sigma * self._unit[0], sigma * self._unit[1])
