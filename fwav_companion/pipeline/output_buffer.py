"""What the flow has to say, gathered until it is taken. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.recording.lines import Line
from fwav_companion.types import Notice, Outgoing


@dataclass(slots=True)
class Outputs:
    """What the pipeline wants done, in order."""

    messages: list[Outgoing] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    datagrams: list[bytes] = field(default_factory=list)
    """Cursor on Target."""


class OutputBuffer:
    """Whoever has something to say adds to :attr:`messages`, or has people notified."""

    def __init__(self, rooms: Components, ledger: TargetLog, *, live: bool) -> None:
        """``live``: false where nothing may be said to anybody."""
        self._rooms = rooms
        self._ledger = ledger
        self._live = live
        self.messages: list[Outgoing] = []
        self.notices: list[Notice] = []

    def notify(self, notices: Iterable[Notice], now: HostNs) -> None:
        """For the log, and for ground stations once we know for whose vehicle we speak."""
        for notice in notices:
            self.notices.append(notice)
            if self._live and self._rooms.identity.knows_its_vehicle:
                self.messages += self._rooms.publisher.on_notice(notice, now)

    @property
    def has_outputs(self) -> bool:
        """:meth:`take` would hand back something: after most messages it would not."""
        return bool(self.messages or self.notices or self._ledger.has_lines or self._rooms.publisher.has_datagrams)

    def take(self) -> Outputs:
        """All since the last call."""
        outputs = Outputs(self.messages, self._ledger.take(), self.notices, self._rooms.publisher.datagrams())
        self.messages, self.notices = [], []
        return outputs
