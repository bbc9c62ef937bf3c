"""Decodes frames to messages and encodes messages to frames, byte for byte as pymavlink does."""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct
from typing import Any, Final

from fwav_companion.mavlink.wire.definitions import BY_NAME, Definition, definition_of
from fwav_companion.mavlink.wire.foreign_bytes import ForeignBytes
from fwav_companion.mavlink.wire.frames import RawFrame, checksum
from fwav_companion.mavlink.wire.payloads import PACK_ERRORS
from fwav_companion.types import Message

_header: Final = Struct("<BBBBBB").pack
"""Length, incompat flags, compat flags, seq, system, component; the message id follows."""
_u16: Final = Struct("<H").pack
TIMESYNC: Final = BY_NAME["TIMESYNC"].msgid


def decode(frame: RawFrame, link: str = "", *, signed: bool = False, foreign: ForeignBytes | None = None) -> Message:
    """Return the message in a frame of a known id (ValueError for an unknown one). ``signed``: its signature was
    verified. ``foreign``: counts of the frames before it.

    Text ends at its first NUL; bytes that are not UTF-8 become U+FFFD. Fields missing from a shorter payload are 0.
    """
    flow = frame.flow
    definition = flow.definition
    if definition is None:
        raise ValueError(f"message id {flow.msgid} is not in the dialect: it cannot be decoded")
    return Message(
        definition.name,
        flow.system,
        flow.component,
        link,
        fields=definition.unpack(frame.data),
        signed=signed,
        foreign_bytes=foreign.beside(flow.system) if foreign is not None and flow.msgid == TIMESYNC else 0,
    )


def pack(name: str, fields: Mapping[str, Any]) -> tuple[Definition, bytes]:
    """Return a definition and a MAVLink 2 payload: without trailing zeros, but never without its first byte.

    Raises EncodeError, with the given and the accepted values, if there is no such message or the fields do not fit it.
    """
    definition = definition_of(name)
    try:
        packed = definition.pack(fields)
    except PACK_ERRORS:
        raise definition.refusal(dict(fields)) from None
    return definition, packed.rstrip(b"\0") or packed[:1]


def frame(definition: Definition, payload: bytes, system: int, component: int, seq: int, flags: int = 0) -> bytes:
    """Return the MAVLink 2 frame with its checksum. ``flags``: FLAG_SIGNED if a signature will be appended."""
    covered = _header(len(payload), flags, 0, seq, system, component) + definition.id_bytes + payload
    return b"".join((b"\xfd", covered, _u16(checksum(covered + definition.crc_byte))))


class Encoder:
    """Encodes frames of one component of ours on one link, with its own sequence counter."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self.seq = 0

    def encode(self, name: str, fields: Mapping[str, Any]) -> bytes:
        """Return the next frame, unsigned. EncodeError leaves the sequence counter unchanged."""
        definition, payload = pack(name, fields)
        seq = self.seq
        self.seq = (seq + 1) & 0xFF
        return frame(definition, payload, system=self.system, component=self.component, seq=seq)
