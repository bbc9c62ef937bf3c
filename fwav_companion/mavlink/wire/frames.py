"""Represents a frame as it arrived on a link: header read, payload untouched."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import msgspec
from fastcrc import crc16

from fwav_companion.mavlink.wire.definitions import Definition

MARKER_V1: Final = 0xFE
MARKER_V2: Final = 0xFD
FLAG_SIGNED: Final = 0x01
"""The only defined incompatibility flag: 13 bytes of signature follow the checksum."""
SIGNATURE_LENGTH: Final = 13
HEADER_V1: Final = 6
HEADER_V2: Final = 10
CHECKSUM_LENGTH: Final = 2

checksum: Final[Callable[[bytes], int]] = crc16.mcrf4xx
"""CRC-16/MCRF4XX, which MAVLink's documentation calls X.25."""


class Flow:
    """Data shared by all frames of one message of one sender. The component that handles frames may attach data to
    it.
    """

    __slots__ = ("component", "crc_byte", "definition", "msgid", "remembered", "stream", "system", "used", "version")

    def __init__(self, system: int, component: int, msgid: int, definition: Definition | None) -> None:
        self.system = system
        """The sender's system id."""
        self.component = component
        """The sender's component id."""
        self.msgid = msgid
        self.definition = definition
        """Definition of the message; None for an unknown message id, whose checksum has not been checked."""
        self.crc_byte = definition.crc_byte if definition else b""
        self.remembered = False
        """Whether the scanner's table holds the flow."""
        self.used = False
        """Whether a frame was received since the scanner's last check."""
        self.stream: Any = None
        self.version = -1
        """Version from which the owner of :attr:`stream` computed it."""


class RawFrame(msgspec.Struct, frozen=True, gc=False):
    """One frame as it arrived: header read, payload untouched."""

    data: bytes
    """Bytes of the frame, from the start byte to the end of the signature."""
    flow: Flow
    seq: int

    @property
    def definition(self) -> Definition | None:
        """Definition of the message; None for an unknown message id, whose checksum has not been checked."""
        return self.flow.definition

    @property
    def msgid(self) -> int:
        """Message id."""
        return self.flow.msgid

    @property
    def system(self) -> int:
        """Sender's system id."""
        return self.flow.system

    @property
    def component(self) -> int:
        """Sender's component id."""
        return self.flow.component

    @property
    def known(self) -> bool:
        """Whether the message id is in the dialect; the checksum is then right."""
        return self.definition is not None

    @property
    def version(self) -> int:
        """Version of MAVLink: 1 or 2."""
        return 2 if self.data[0] == MARKER_V2 else 1

    @property
    def signed(self) -> bool:
        """Whether the frame carries a signature, verified or not."""
        return self.data[0] == MARKER_V2 and self.data[2] == FLAG_SIGNED

    @property
    def payload(self) -> bytes:
        """Payload as sent: trailing zeros may be missing."""
        start = HEADER_V2 if self.data[0] == MARKER_V2 else HEADER_V1
        return self.data[start : start + self.data[1]]

    @property
    def target_system(self) -> int:
        """Target system id; 0 is every system, also for a message without target."""
        return self.payload_byte(self.definition.target_system_offset if self.definition else -1)

    @property
    def target_component(self) -> int:
        """Target component id; 0 is every component, also for a message without target."""
        return self.payload_byte(self.definition.target_component_offset if self.definition else -1)

    @property
    def instance(self) -> int:
        """Instance of the message, for example the second battery; 0 for a message without instances."""
        return self.definition.instance(self.payload) if self.definition else 0

    def payload_byte(self, offset: int) -> int:
        """Return the byte of the payload at an offset; 0 if it was left out, or for offset -1."""
        start = HEADER_V2 if self.data[0] == MARKER_V2 else HEADER_V1
        return self.data[start + offset] if 0 <= offset < self.data[1] else 0
