"""Chooses the message from which attitudes are taken."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry.events import AttitudeSource

EULER, QUATERNION = "ATTITUDE", "ATTITUDE_QUATERNION"

FALL_BACK_NS = 10 * NS_PER_S
"""Silence of ATTITUDE_QUATERNION, through several renewed requests, after which it counts as refused. A shorter time
would be wrong: after a reboot ATTITUDE arrives first, and on an ArduPlane with a trim it is degrees off."""


class AttitudeChoice:
    """Choice of one source at a time, because the two messages may differ by a constant."""

    __slots__ = ("_asked_for", "_quaternion_ns", "source")

    def __init__(self, attitude_message: str) -> None:
        self._asked_for = attitude_message
        self._quaternion_ns = HostNs(0)
        self.source: str | None = None if attitude_message == "auto" else attitude_message
        """Message in use; None before the first."""

    def take(self, name: str, now: HostNs) -> tuple[bool, tuple[AttitudeSource, ...]]:
        """(whether this message's attitude is used, the change of source that it makes)."""
        if self._asked_for != "auto":
            return name == self._asked_for, ()
        if name == QUATERNION:
            self._quaternion_ns = now
        if self.source is None:
            self.source = name
        if name == self.source:
            return True, ()
        if name == EULER and now - self._quaternion_ns < FALL_BACK_NS:
            return False, ()
        before, self.source = self.source, name
        return True, (AttitudeSource(name, before),)
