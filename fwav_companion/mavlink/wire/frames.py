"""A frame as it came over a link: its header read, its payload untouched."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import msgspec
from fastcrc import crc16

from fwav_companion.mavlink.wire.definitions import Definition

MARKER_V2: Final = 0xFD
FLAG_SIGNED: Final = 0x01
"""The one incompatibility flag that exists: 13 bytes of signature follow the checksum."""
SIGNATURE_LENGTH: Final = 13
HEADER_V1: Final = 6
HEADER_V2: Final = 10
CHECKSUM_LENGTH: Final = 2

checksum: Final[Callable[[bytes], int]] = crc16.mcrf4xx
"""CRC-16/MCRF4XX, which MAVLink's documentation calls X.25."""


class Flow:
    """What all frames of one message of one sender share. Whoever handles frames may hang on it what they know."""

    __slots__ = ("component", "crc_byte", "definition", "msgid", "stream", "system", "version")

    def __init__(self, system: int, component: int, msgid: int, definition: Definition | None) -> None:
        self.system = system
        """The sender's system id."""
        self.component = component
        """The sender's component id."""
        self.msgid = msgid
        self.definition = definition
        """None for an unknown message id: its checksum has not been checked."""
        self.crc_byte = definition.crc_byte if definition else b""
        self.stream: Any = None
        self.version = -1
        """For the owner of :attr:`stream`: of what it was worked out from."""


class RawFrame(msgspec.Struct, frozen=True, gc=False):
    """One frame as it came, header read, payload untouched."""

    data: bytes
    """All its bytes, from the start byte to the end of the signature."""
    flow: Flow
    seq: int

    @property
    def definition(self) -> Definition | None:
        """None for an unknown message id: its checksum has not been checked."""
        return self.flow.definition

    @property
    def msgid(self) -> int:
        """The message's id."""
        return self.flow.msgid

    @property
    def system(self) -> int:
        """The sender's system id."""
        return self.flow.system

    @property
    def component(self) -> int:
        """The sender's component id."""
        return self.flow.component

    @property
    def known(self) -> bool:
        """The message id is in the dialect, and the checksum is right."""
        return self.definition is not None

    @property
    def version(self) -> int:
        """Of MAVLink: 1 or 2."""
        return 2 if self.data[0] == MARKER_V2 else 1

    @property
    def signed(self) -> bool:
        """It carries a signature, verified or not."""
        return self.data[0] == MARKER_V2 and self.data[2] == FLAG_SIGNED

    @property
    def payload(self) -> bytes:
        """As sent: trailing zeros may be missing."""
        start = HEADER_V2 if self.data[0] == MARKER_V2 else HEADER_V1
        return self.data[start : start + self.data[1]]

    @property
    def target_system(self) -> int:
        """The system it is meant for; 0 is everybody, also where it names none."""
        return self.payload_byte(self.definition.target_system_offset if self.definition else -1)

    @property
    def target_component(self) -> int:
        """The component it is meant for; 0 is every one, also where it names none."""
        return self.payload_byte(self.definition.target_component_offset if self.definition else -1)

    @property
    def instance(self) -> int:
        """Which of several streams of this message it belongs to, as of the second battery; 0 where it has but one."""
        return self.definition.instance(self.payload) if self.definition else 0

    def payload_byte(self, offset: int) -> int:
        """The byte of the payload at an offset; 0 where it was left out, or for offset -1."""
        start = HEADER_V2 if self.data[0] == MARKER_V2 else HEADER_V1
        return self.data[start + offset] if 0 <= offset < self.data[1] else 0
