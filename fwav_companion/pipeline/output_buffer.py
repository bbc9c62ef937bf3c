"""Buffer of the pipeline's outputs until they are taken. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.components import Components
from fwav_companion.pipeline.target_log import TargetLog
from fwav_companion.recording.line_types import Line
from fwav_companion.types import Notice, Outgoing
from fwav_companion.types.spots import SpotMessage


@dataclass(slots=True)
class Outputs:
    """Outputs of the pipeline, in order."""

    messages: list[Outgoing] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    datagrams: list[bytes] = field(default_factory=list)
    """Cursor on Target events."""
    spot_messages: list[SpotMessage] = field(default_factory=list)
    """Orders for the camera process."""


class OutputBuffer:
    """Buffers messages and notices; encodes the notices for the ground."""

    def __init__(self, components: Components, target_log: TargetLog, *, live: bool) -> None:
        """``live``: false in a replay, where no message is sent."""
        self._components = components
        self._target_log = target_log
        self._live = live
        self.messages: list[Outgoing] = []
        self.notices: list[Notice] = []

    def notify(self, notices: Iterable[Notice], now: HostNs) -> None:
        """Take notices for the log, and for ground stations once the vehicle is known."""
        for notice in notices:
            self.notices.append(notice)
            self._target_log.note(notice)
            if self._live and self._components.identity.knows_its_vehicle:
                self.messages += self._components.publisher.on_notice(notice, now)

    @property
    def has_outputs(self) -> bool:
        """Whether :meth:`take` would return anything; after most messages it would not."""
        return bool(
            self.messages
            or self.notices
            or self._target_log.lines
            or self._components.publisher.has_datagrams
            or (self._components.spots is not None and self._components.spots.has_orders)
        )

    def take(self) -> Outputs:
        """Outputs since the last call."""
        components = self._components
        outputs = Outputs(
            self.messages,
            self._target_log.take(),
            self.notices,
            components.publisher.datagrams(),
            [] if components.spots is None else components.spots.take_orders(),
        )
        self.messages, self.notices = [], []
        return outputs
