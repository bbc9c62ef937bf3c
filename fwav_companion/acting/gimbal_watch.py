"""Notices that a gimbal does not do what is commanded: the pilot's stick, or a gimbal that never moves. Pure.

No message says that a pilot moves the gimbal. It had been at the command, is not at a limit, and moved away from a
command that is steady.
"""

from __future__ import annotations

from math import degrees, radians
from typing import Final

from fwav_companion.acting.aim import Angles, apart
from fwav_companion.geometry.stamps import NS_PER_S, HostNs

AT_COMMAND: Final = radians(3.0)
STEADY: Final = radians(1.0)
"""Largest change of a command that counts as steady."""
STEADY_NS: Final = NS_PER_S
AWAY_NS: Final = NS_PER_S
COMMANDED: Final = radians(10.0)
"""Least way that is commanded before a gimbal can be said not to move."""
MOVED: Final = 0.2
"""Least share of it that a moving gimbal goes."""
STUCK_NS: Final = 3 * NS_PER_S


class GimbalWatch:
    """Compares each command with where the gimbal looks."""

    def __init__(self) -> None:
        self._began: Angles | None = None
        self._moved = 0.0
        self._far_since_ns: HostNs | None = None
        self._was_there = False
        self._steady: tuple[HostNs, Angles] | None = None
        self._away_since_ns: HostNs | None = None

    def on_command(self, command: Angles, look: Angles | None, now: HostNs, *, at_limit: bool) -> None:
        """Take a command and the gimbal's reported look at that instant; None: not known."""
        if self._steady is None or apart(self._steady[1], command) > STEADY:
            self._steady = (now, command)
        if look is None:
            self._away_since_ns = None
            return
        self._began = self._began or look
        self._moved = max(self._moved, apart(look, self._began))
        far = apart(command, self._began) >= COMMANDED and self._moved < MOVED * apart(command, self._began)
        self._far_since_ns = (self._far_since_ns or now) if far else None
        there = apart(command, look) <= AT_COMMAND
        self._was_there = self._was_there or there
        is_steady = now - self._steady[0] >= STEADY_NS
        away = self._was_there and is_steady and not there and not at_limit
        self._away_since_ns = (self._away_since_ns or now) if away else None

    def by_stick(self, now: HostNs) -> bool:
        """Whether the gimbal has been moved away from a steady command for a second."""
        return self._away_since_ns is not None and now - self._away_since_ns >= AWAY_NS

    def stuck(self, command: Angles, now: HostNs) -> str | None:
        """What was commanded and what moved, in degrees, where the gimbal does not follow; else None."""
        if self._far_since_ns is None or now - self._far_since_ns < STUCK_NS or self._began is None:
            return None
        return f"commanded {degrees(apart(command, self._began)):.0f} deg, moved {degrees(self._moved):.0f}"
