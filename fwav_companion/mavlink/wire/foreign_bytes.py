"""Counts the bytes of accepted frames by the sender's system: those of other systems travel beside an exchange.

The same frames are in a recording, so that a replay counts as the flight did. A frame counts with the length that a
recording keeps: MAVLink 2 without a signature, which holds for MAVLink 1 within two bytes.
"""

from __future__ import annotations

from typing import Final

OVERHEAD: Final = 12
"""Bytes of a MAVLink 2 frame beside its payload, without a signature."""


class ForeignBytes:
    """Byte counts since the start, by system id."""

    __slots__ = ("_by_system", "_total")

    def __init__(self) -> None:
        self._by_system = [0] * 256
        self._total = 0

    def add(self, system: int, frame: bytes) -> None:
        """Count an accepted frame of a system."""
        size = OVERHEAD + frame[1]
        self._total += size
        self._by_system[system] += size

    def beside(self, system: int) -> int:
        """Return the bytes of all systems but this one."""
        return self._total - self._by_system[system]
