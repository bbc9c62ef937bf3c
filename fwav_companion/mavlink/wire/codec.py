"""Frames to messages and back, byte for byte what pymavlink writes."""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct
from typing import Any, Final

from fwav_companion.mavlink.wire.definitions import Definition, definition_of
from fwav_companion.mavlink.wire.frames import RawFrame, checksum
from fwav_companion.mavlink.wire.payloads import PACK_ERRORS
from fwav_companion.types import Message

_header: Final = Struct("<BBBBBB").pack
"""Length, incompat flags, compat flags, seq, system, component; the message id follows."""
_u16: Final = Struct("<H").pack


def decode(frame: RawFrame, link: str = "", *, signed: bool = False) -> Message:
    """The message in a frame of a known id (ValueError for an unknown one). ``signed``: its signature was verified.

    Text ends at its first NUL; what is not UTF-8 becomes U+FFFD. What a shorter payload leaves out is 0.
    """
    flow = frame.flow
    definition = flow.definition
    if definition is None:
        raise ValueError(f"message id {flow.msgid} is not in the dialect: it cannot be decoded")
    return Message(definition.name, flow.system, flow.component, link, definition.unpack(frame.data), signed)


def pack(name: str, fields: Mapping[str, Any]) -> tuple[Definition, bytes]:
    """A payload as MAVLink 2 sends it: without trailing zeros, but never without its first byte.

    EncodeError, with what was given and what is accepted, if there is no such message or the fields do not fit it.
    """
    definition = definition_of(name)
    try:
        packed = definition.pack(fields)
    except PACK_ERRORS:
        raise definition.refusal(dict(fields)) from None
    return definition, packed.rstrip(b"\0") or packed[:1]


def frame(definition: Definition, payload: bytes, system: int, component: int, seq: int, flags: int = 0) -> bytes:
    """The MAVLink 2 frame up to its checksum. ``flags``: FLAG_SIGNED where a signature will be appended."""
    covered = _header(len(payload), flags, 0, seq, system, component) + definition.id_bytes + payload
    return b"".join((b"\xfd", covered, _u16(checksum(covered + definition.crc_byte))))


class Encoder:
    """Frames of one component of ours on one link, with its own sequence counter."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self.seq = 0

    def encode(self, name: str, fields: Mapping[str, Any]) -> bytes:
        """The next frame, unsigned. EncodeError leaves the sequence counter as it was."""
        definition, payload = pack(name, fields)
        seq = self.seq
        self.seq = (seq + 1) & 0xFF
        return frame(definition, payload, self.system, self.component, seq)
