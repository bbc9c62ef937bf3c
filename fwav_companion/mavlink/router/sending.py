"""Encodes our messages to frames for each destination link."""

from __future__ import annotations

from collections import deque
from typing import Final

from fwav_companion.errors import EncodeError
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.own_frames import OwnFrames
from fwav_companion.mavlink.router.routing import Port, Router
from fwav_companion.mavlink.router.signing_policy import Keyring
from fwav_companion.mavlink.wire.codec import frame, pack
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.frames import CHECKSUM_LENGTH, FLAG_SIGNED, HEADER_V2, SIGNATURE_LENGTH
from fwav_companion.types import Destination, Outgoing

TIMESYNC: Final = BY_NAME["TIMESYNC"].msgid
MAX_TIMESYNCS: Final = 64
"""TIMESYNC requests remembered: six seconds at 10 Hz, longer than any useful answer takes."""


class Sender:
    """Encodes, numbers and signs our messages.

    Each component of ours has a separate sequence counter for each link, as in ArduPilot and PX4: every peer then
    counts true losses, independently of other links.
    """

    def __init__(self, router: Router, keyring: Keyring) -> None:
        self._router = router
        self._sequences: dict[tuple[str, int, int], int] = {}
        self.own_frames = OwnFrames()
        self.timesyncs: deque[int] = deque(maxlen=MAX_TIMESYNCS)
        """ts1 of our newest TIMESYNC messages: answers to our requests repeat it."""
        self._signers = {port.name: keyring.signer(port) for port in router.ports}

    def encode(self, outgoing: Outgoing, now: HostNs) -> list[tuple[str, bytes]]:
        """Return (link, frame) for every link. Raises EncodeError if there is no such message, field or link."""
        definition, payload = pack(outgoing.name, outgoing.fields)
        system, component = outgoing.system or self._router.system, outgoing.component
        stream = (definition.msgid, system << 8 | component, definition.instance(payload))
        if definition.msgid == TIMESYNC:
            self.timesyncs.append(int(outgoing.fields["ts1"]))
        frames = []
        for port in self._ports_to(outgoing, now):
            if not port.limiter.passes(stream, self._size(port, payload), now):
                continue
            seq = self._sequences.get((port.name, system, component), 0)
            self._sequences[port.name, system, component] = (seq + 1) & 0xFF
            signer = self._signers[port.name]
            if signer is None:
                data = frame(definition, payload, system=system, component=component, seq=seq)
            else:
                unsigned = frame(definition, payload, system=system, component=component, seq=seq, flags=FLAG_SIGNED)
                data = signer.sign(unsigned, now)
            self.own_frames.add(data)
            frames.append((port.name, data))
        return frames

    def _size(self, port: Port, payload: bytes) -> int:
        signature = 0 if self._signers[port.name] is None else SIGNATURE_LENGTH
        return HEADER_V2 + len(payload) + CHECKSUM_LENGTH + signature

    def _ports_to(self, outgoing: Outgoing, now: HostNs) -> list[Port]:
        ports = [port for port in self._router.ports if port.up]
        match outgoing.to:
            case Destination.EVERYONE:
                return ports
            case Destination.GROUND_LINKS:
                return [port for port in ports if port.is_gcs]
            case Destination.GROUND:
                through_autopilot = not self._router.hears_ground_station(now)
                return [port for port in ports if port.is_gcs or (through_autopilot and port.is_autopilot)]
            case Destination.AUTOPILOT:
                autopilots = [port for port in ports if port.is_autopilot]
                return [port for port in autopilots if port.hears_system(self._router.vehicle)] or autopilots
            case Destination.REPLY:
                return self._port_of_reply(outgoing, ports)

    def _port_of_reply(self, outgoing: Outgoing, ports: list[Port]) -> list[Port]:
        names = [port.name for port in self._router.ports]
        if outgoing.link not in names:
            raise EncodeError(f"{outgoing.name} is to go to link {outgoing.link!r}; there are {', '.join(names)}")
        return [port for port in ports if port.name == outgoing.link]
