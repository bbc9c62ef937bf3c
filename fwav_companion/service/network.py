"""SHELL: the daemon in the MAVLink network: the node of all links, and the sending of its messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches

from fwav_companion.config import Config
from fwav_companion.config.room_options import link_policies, signing_policy
from fwav_companion.config.rules import CAMERA_COMPONENT_ID
from fwav_companion.errors import ConfigError, EncodeError
from fwav_companion.fair_queues import Origin
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.links.base import Link
from fwav_companion.mavlink.router.coalescing import coalesced
from fwav_companion.mavlink.router.node import Node
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.pipeline.pipeline_factory import WANTED
from fwav_companion.service.journal import Journal
from fwav_companion.types import Outgoing


def make_node(config: Config, signing_key: bytes | None, signing_timestamp: int) -> Node:
    """The node of all links. ``signing_timestamp``: the first timestamp of the service's signatures, if it has a key.

    ConfigError if a link's max_rate_hz names an unknown message.
    """
    _require_message_names(config)
    signing = signing_policy(config, signing_key, signing_timestamp)
    return Node(
        link_policies(config), WANTED, components=(config.vehicle.component_id, CAMERA_COMPONENT_ID), signing=signing
    )


def _require_message_names(config: Config) -> None:
    """Check the message names. This is not done while the file is read: only the daemon needs MAVLink's definitions."""
    for number, link in enumerate(config.link, start=1):
        for name in link.max_rate_hz:
            if name not in BY_NAME:
                near = get_close_matches(name.upper(), BY_NAME, n=1)
                accepted = f'did you mean "{near[0]}"?' if near else "accepted: a message of the ardupilotmega dialect"
                where = f'{config.file}: [[link]] {number} "{link.name}" max_rate_hz'
                raise ConfigError(f"{where}: no MAVLink message is called {name}; {accepted}")


class Outbox:
    """Sends the service's messages over the links of their destinations, in one write for each link."""

    def __init__(
        self,
        node: Node,
        links: Mapping[str, Link],
        map_link: Link | None,
        journal: Journal,
        on_fault: Callable[[str, Exception], None],
    ) -> None:
        """``map_link``: the link of Cursor on Target. ``on_fault``: called for a message that cannot be encoded."""
        self._node = node
        self._links = links
        self._map_link = map_link
        self._journal = journal
        self._on_fault = on_fault

    def send(self, messages: Sequence[Outgoing], datagrams: Sequence[bytes], now: HostNs) -> None:
        """Send all messages in order, a TIMESYNC behind the others: what follows it would date its reception back.

        A message that cannot be encoded is an internal fault; the others are sent.
        """
        ordered = sorted(messages, key=lambda message: message.name == "TIMESYNC")
        for name, data in coalesced(self._frames(ordered, now)):
            self._links[name].send(data)
        if self._map_link is not None:
            for datagram in datagrams:
                self._map_link.send(datagram)

    def forward(
        self, forwards: Sequence[tuple[str, bytes]], followed: Sequence[Outgoing], now: HostNs, *, origin: Origin
    ) -> None:
        """Forward received frames unchanged, followed by the service's own messages, in one write for each link."""
        if followed:
            forwards = coalesced([*forwards, *self._frames(followed, now)])
        for name, data in forwards:
            self._links[name].send(data, origin=origin)

    def _frames(self, messages: Sequence[Outgoing], now: HostNs) -> list[tuple[str, bytes]]:
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
        return sends
