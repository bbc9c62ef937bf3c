"""Which of our commands an acknowledgement is about, where it names only the kind of command."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

import msgspec

from fwav_companion.geometry.stamps import HostNs

MAX_AWAITED = 256
Subject = TypeVar("Subject")


class _Awaited(msgspec.Struct, frozen=True):
    command: int
    subject: object
    until_ns: HostNs


class AckOrder(Generic[Subject]):
    """Acknowledgements come in the order of the commands: the oldest command of the kind that still waits is meant.

    Two rules keep it in step where an acknowledgement is lost: one of a later command of another kind passes over what
    was sent before it, and no command waits longer than its sender does.
    """

    __slots__ = ("_awaited", "_timeout_ns")

    def __init__(self, timeout_ns: int):
        self._timeout_ns = timeout_ns
        self._awaited: deque[_Awaited] = deque(maxlen=MAX_AWAITED)

    def clear(self) -> None:
        """No acknowledgement is awaited."""
        self._awaited.clear()

    def sent(self, command: int, subject: Subject | None, now: HostNs) -> None:
        """A command leaves. ``subject`` is returned when it is acknowledged; None where the answer does not matter."""
        self._awaited.append(_Awaited(command, subject, HostNs(now + self._timeout_ns)))

    def acknowledged(self, command: int, now: HostNs) -> Subject | None:
        """The subject of the command that was acknowledged."""
        while self._awaited:
            awaited = self._awaited.popleft()
            if awaited.command == command and now < awaited.until_ns:
                return awaited.subject  # type: ignore[return-value]
        return None
