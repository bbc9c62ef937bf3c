"""Notices that a gimbal does not do what is commanded: the pilot's stick, or a gimbal that never moves. Pure.

No message says that a pilot moves the gimbal. It had been at the command, is not at a limit, and moved away from it: a
gimbal that lags is where some command of the last second sent it. One that stops on its way, at a limit without a
report, came nearer to the command.
"""

from __future__ import annotations

from collections import deque
from math import degrees, radians
from typing import Final

from fwav_companion.acting.aim import Angles, angle_between
from fwav_companion.geometry.stamps import NS_PER_S, HostNs

AT_COMMAND: Final = radians(3.0)
LAG_NS: Final = NS_PER_S
"""Longest lag of a gimbal that follows."""
AWAY_NS: Final = NS_PER_S
FARTHER: Final = radians(1.0)
"""Least way by which a gimbal that a stick moved is farther from the command than where it was last at one."""
COMMANDED: Final = radians(10.0)
"""Least way that is commanded before a gimbal can be said not to move."""
MOVED: Final = 0.2
"""Least share of it that a moving gimbal goes."""
STUCK_NS: Final = 3 * NS_PER_S


class GimbalWatch:
    """Compares each command with where the gimbal looks."""

    def __init__(self) -> None:
        self._start: Angles | None = None
        """Look when the gimbal was last at its command; at first, the first one."""
        self._moved = 0.0
        """Largest way from there."""
        self._was_there = False
        self._commands: deque[tuple[HostNs, Angles]] = deque()
        self._far_since_ns: HostNs | None = None
        self._away_since_ns: HostNs | None = None

    @property
    def is_away(self) -> bool:
        """Whether the gimbal left its commands by itself: what the picture shows is then no error of the pointing."""
        return self._away_since_ns is not None

    def on_command(self, command: Angles, look: Angles | None, now: HostNs, *, at_limit: bool) -> None:
        """Take a command and the gimbal's reported look at that instant; None: not known."""
        self._commands.append((now, command))
        while self._commands[0][0] < now - LAG_NS:
            self._commands.popleft()
        if look is None:
            self._away_since_ns = None
            return
        if angle_between(command, look) <= AT_COMMAND:
            self._start, self._moved, self._was_there = look, 0.0, True
        start = self._start = self._start or look
        self._moved = max(self._moved, angle_between(look, start))
        commanded = angle_between(command, start)
        far = commanded >= COMMANDED and self._moved < MOVED * commanded
        self._far_since_ns = (self._far_since_ns or now) if far else None
        farther = self._was_there and not at_limit and angle_between(command, look) > commanded + FARTHER
        away = farther and all(angle_between(each, look) > AT_COMMAND for _, each in self._commands)
        self._away_since_ns = (self._away_since_ns or now) if away else None

    def by_stick(self, now: HostNs) -> bool:
        """Whether the gimbal has been away from its commands for a second."""
        return self._away_since_ns is not None and now - self._away_since_ns >= AWAY_NS

    def stuck(self, command: Angles, now: HostNs) -> str | None:
        """What was commanded and what moved, in degrees, where the gimbal does not follow; else None."""
        if self._far_since_ns is None or now - self._far_since_ns < STUCK_NS or self._start is None:
            return None
        return f"commanded {degrees(angle_between(command, self._start)):.0f} deg, moved {degrees(self._moved):.0f}"
