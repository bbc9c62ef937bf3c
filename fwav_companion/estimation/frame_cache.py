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


_Value = TypeVar("_Value")
_MOST = 512  # half a second at 240 frames/s, as late as a frame comes; two a frame


class FrameCache(Generic[_Value]):
    """What was found for the newest frames, by the frame's stamp and whatever else it depends on."""

    def __init__(self) -> None:
        self._values: dict[object, _Value] = {}

    def get(self, key: object) -> _Value | None:
        """What was found; None where it was not yet, or too long ago."""
        return self._values.get(key)

    def keep(self, key: object, value: _Value) -> _Value:
        """Keep it, and return it."""
        self._values[key] = value
        if len(self._values) > _MOST:
            del self._values[next(iter(self._values))]
        return value
