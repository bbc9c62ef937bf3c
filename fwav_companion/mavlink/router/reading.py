"""Reads the frames that are addressed to us or to all: messages for the client, and those for the router itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.acceptance import Acceptance
from fwav_companion.mavlink.router.routing import RADIO_REPORTS, Port, Router
from fwav_companion.mavlink.router.signing_policy import Trust
from fwav_companion.mavlink.wire.codec import decode
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.enums import MAV_TYPE_GCS
from fwav_companion.mavlink.wire.foreign_bytes import ForeignBytes
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.types import Message

_HEARTBEAT: Final = BY_NAME["HEARTBEAT"]
_SYSTEM_TIME: Final = BY_NAME["SYSTEM_TIME"]
_TYPE_OFFSET: Final = _HEARTBEAT.fields["type"].offset
_BOOT_OFFSET: Final = _SYSTEM_TIME.fields["time_boot_ms"].offset
_TXBUF_OFFSET: Final = BY_NAME["RADIO_STATUS"].fields["txbuf"].offset
"""The older message RADIO has the field at the same offset."""
FOLLOWED: Final = RADIO_REPORTS | {_HEARTBEAT.msgid, _SYSTEM_TIME.msgid}
"""Ids of the messages that the router needs itself."""


class FrameReader:
    """Decodes the wanted messages, and follows stations, clocks and radios for the router."""

    def __init__(self, router: Router, acceptance: Acceptance, wanted: Iterable[str], *, foreign: ForeignBytes) -> None:
        """``wanted``: names of the messages to decode. ``foreign``: counts of the accepted frames."""
        self._foreign = foreign
        self._router = router
        self._acceptance = acceptance
        self._wanted = frozenset(BY_NAME[name].msgid for name in wanted)
        self.watched = self._wanted | FOLLOWED
        """Ids of the messages that are read."""

    def read(self, port: Port, frame: RawFrame, *, trust: Trust, messages: list[Message], now: HostNs) -> bool:
        """Read a watched message of a known sender if it is addressed to us. Returns False if it is not accepted."""
        if not (port.is_autopilot or self._acceptance.is_believed(port, frame)):
            return False
        flow = frame.flow
        if flow.stream.targeted and not self._router.is_for_us(frame.target_system, frame.target_component):
            return True
        if trust is Trust.UNSIGNED_REQUEST:
            port.refused_unsigned += 1
            return False
        port.signed_unverified += trust is Trust.OPEN and frame.signed
        if flow.msgid in FOLLOWED:
            if flow.msgid in RADIO_REPORTS:
                self.on_radio(port, frame, messages, now)
                return True
            self._follow(port, frame, now)
        if flow.msgid in self._wanted:
            messages.append(decode(frame, port.name, signed=trust is Trust.SIGNED, foreign=self._foreign))
        return True

    def on_copy(self, port: Port, frame: RawFrame, now: HostNs) -> bool:
        """Note that a sender is there by a frame that came by another link before, and is not read: a stranger there
        may send a station's heartbeats in advance. Returns whether the frame is of a known id.
        """
        if frame.known and frame.msgid == _HEARTBEAT.msgid:
            self._note_presence(port, frame, now)
        return frame.known

    def on_radio(self, port: Port, frame: RawFrame, messages: list[Message], now: HostNs) -> None:
        """Read a radio's report."""
        self._router.on_radio(port, frame.payload_byte(_TXBUF_OFFSET), now)
        if frame.msgid in self._wanted:
            messages.append(decode(frame, port.name))

    def _follow(self, port: Port, frame: RawFrame, now: HostNs) -> None:
        """Follow the sender's clock and presence."""
        if frame.msgid == _SYSTEM_TIME.msgid:
            boot_ms = int.from_bytes(frame.payload[_BOOT_OFFSET : _BOOT_OFFSET + 4], "little")
            self._router.on_clock(port, frame, boot_ms, now)
        elif frame.msgid == _HEARTBEAT.msgid:
            self._note_presence(port, frame, now)

    def _note_presence(self, port: Port, frame: RawFrame, now: HostNs) -> None:
        """Keep what the sender of a heartbeat has on the link."""
        sender = frame.system << 8 | frame.component
        self._router.merged.heard(port.name, sender, now)
        if port.merges_rate_requests:
            port.ration.hear(port.source or sender, now)
        if frame.payload_byte(_TYPE_OFFSET) == MAV_TYPE_GCS:
            port.ground_station_ns = now
