"""Finds the command of ours that an acknowledgement belongs to: COMMAND_ACK carries only the kind of command."""

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
    """Matches acknowledgements to commands in order of sending: an acknowledgement belongs to the oldest pending
    command of its kind.

    Two rules resynchronise it after a lost acknowledgement: an acknowledgement of a later command of another kind
    discards the commands sent before that one, and no command is pending longer than its sender's timeout.
    """

    __slots__ = ("_awaited", "_timeout_ns")

    def __init__(self, timeout_ns: int):
        self._timeout_ns = timeout_ns
        self._awaited: deque[_Awaited] = deque(maxlen=MAX_AWAITED)

    def clear(self) -> None:
        """Forget all pending commands."""
        self._awaited.clear()

    def sent(self, command: int, subject: Subject | None, now: HostNs) -> None:
        """Note a command that is sent. ``subject`` is returned when it is acknowledged; None if the answer does not
        matter.
        """
        self._awaited.append(_Awaited(command, subject, HostNs(now + self._timeout_ns)))

    def acknowledged(self, command: int, now: HostNs) -> Subject | None:
        """Return the subject of the acknowledged command; None if there is none."""
        while self._awaited:
            awaited = self._awaited.popleft()
            if awaited.command == command and now < awaited.until_ns:
                return awaited.subject  # type: ignore[return-value]
        return None
