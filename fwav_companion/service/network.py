"""Our place in the MAVLink network, as the configuration has it."""

from __future__ import annotations

from difflib import get_close_matches

from fwav_companion.config import Config
from fwav_companion.errors import ConfigError
from fwav_companion.links.url import UdpUrl
from fwav_companion.mavlink.router.node import LinkPolicy, Node, SigningPolicy
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.pipeline.pipeline_factory import WANTED, own_components


def make_node(config: Config, signing_key: bytes | None, signing_timestamp: int) -> Node:
    """The node of all links. ``signing_timestamp``: where signatures go on, if there is a key.

    ConfigError where a link's max_rate_hz names no message.
    """
    _require_message_names(config)
    policies = [
        LinkPolicy(
            name=link.name,
            role=link.role,
            max_rate_hz=link.max_rate_hz,
            forward_rate_requests=link.forward_rate_requests,
            datagrams=isinstance(link.parsed_url, UdpUrl),
        )
        for link in config.link
    ]
    signing = None
    if signing_key is not None and config.signing is not None:
        accept_unsigned = frozenset(config.signing.accept_unsigned)
        signing = SigningPolicy(key=signing_key, timestamp=signing_timestamp, accept_unsigned=accept_unsigned)
    return Node(policies, WANTED, components=sorted(own_components(config)), signing=signing)


def _require_message_names(config: Config) -> None:
    """Here and not where the file is read: only who opens links needs MAVLink's definitions."""
    for number, link in enumerate(config.link, start=1):
        for name in link.max_rate_hz:
            if name not in BY_NAME:
                near = get_close_matches(name.upper(), BY_NAME, n=1)
                accepted = f'did you mean "{near[0]}"?' if near else "accepted: a message of the ardupilotmega dialect"
                where = f'{config.file}: [[link]] {number} "{link.name}" max_rate_hz'
                raise ConfigError(f"{where}: no MAVLink message is called {name}; {accepted}")
