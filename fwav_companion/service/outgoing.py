"""SHELL: what the flow wants sent, onto the links."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from fwav_companion.errors import EncodeError
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.links.base import Link
from fwav_companion.mavlink.router.coalescing import coalesced
from fwav_companion.mavlink.router.node import Node
from fwav_companion.service.journal import Journal
from fwav_companion.types import Outgoing


class Outbox:
    """Messages of ours to whom they are meant for; what goes to one link at one time goes together."""

    def __init__(
        self,
        node: Node,
        links: Mapping[str, Link],
        map_link: Link | None,
        journal: Journal,
        on_fault: Callable[[str, Exception], None],
    ) -> None:
        """``map_link``: where Cursor on Target goes. ``on_fault``: told of a message that cannot be sent."""
        self._node = node
        self._links = links
        self._map_link = map_link
        self._journal = journal
        self._on_fault = on_fault

    def send(self, messages: Sequence[Outgoing], datagrams: Sequence[bytes], now: HostNs) -> None:
        """All of them, in order. One that cannot be encoded is a mistake of ours, and costs itself alone."""
        sends: list[tuple[str, bytes]] = []
        for message in messages:
            try:
                frames = self._node.encode(message, now)
            except EncodeError as error:
                self._on_fault(f"{message.name} was not sent", error)
                continue
            sends += frames
            if frames:
                self._journal.sent(frames[0][1], now)
        for name, data in coalesced(sends):
            self._links[name].send(data)
        if self._map_link is not None:
            for datagram in datagrams:
                self._map_link.send(datagram)
