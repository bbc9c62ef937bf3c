"""Buffer of the pipeline's outputs until they are taken. Pure."""

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
    """Outputs of the pipeline, in order."""

    messages: list[Outgoing] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    datagrams: list[bytes] = field(default_factory=list)
    """Cursor on Target events."""


class OutputBuffer:
    """Buffers messages and notices; encodes the notices for the ground."""

    def __init__(self, rooms: Components, ledger: TargetLog, *, live: bool) -> None:
        """``live``: false in a replay, where no message is sent."""
        self._rooms = rooms
        self._ledger = ledger
        self._live = live
        self.messages: list[Outgoing] = []
        self.notices: list[Notice] = []

    def notify(self, notices: Iterable[Notice], now: HostNs) -> None:
        """Take notices for the log, and for ground stations once the vehicle is known."""
        for notice in notices:
            self.notices.append(notice)
            if self._live and self._rooms.identity.knows_its_vehicle:
                self.messages += self._rooms.publisher.on_notice(notice, now)

    @property
    def has_outputs(self) -> bool:
        """Whether :meth:`take` would return anything; after most messages it would not."""
        return bool(self.messages or self.notices or self._ledger.has_lines or self._rooms.publisher.has_datagrams)

    def take(self) -> Outputs:
        """Outputs since the last call."""
        outputs = Outputs(self.messages, self._ledger.take(), self.notices, self._rooms.publisher.datagrams())
        self.messages, self.notices = [], []
        return outputs
