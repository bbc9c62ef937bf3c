"""What was found for the newest frames, so that a late frame does not find it again with later telemetry."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

from fwav_companion.estimation.errors import Array


class ReportedMotion(NamedTuple):
    """The camera's reported motion at an instant."""

    t: float  # s
    position: Array  # (3,) m north, east, height
    velocity: Array  # (3,) m/s

    def at(self, t: float) -> Array:
        """Position (3,) at a later instant, carried on by the velocity."""
        return self.position + self.velocity * (t - self.t)


_Found = TypeVar("_Found")
_FOUND_KEPT = 512  # half a second at 240 frames/s, as late as a frame comes; two a frame


class FoundOnce(Generic[_Found]):
    """What was found for the newest frames, by the frame's stamp and whatever else it depends on."""

    def __init__(self) -> None:
        self._found: dict[object, _Found] = {}

    def get(self, key: object) -> _Found | None:
        """What was found; None where it was not yet, or too long ago."""
        return self._found.get(key)

    def keep(self, key: object, found: _Found) -> _Found:
        """Keep it, and return it."""
        self._found[key] = found
        if len(self._found) > _FOUND_KEPT:
            del self._found[next(iter(self._found))]
        return found
