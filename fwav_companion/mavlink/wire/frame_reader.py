"""Reads the frame that begins at a start byte, by its header and, for a known message id, its checksum."""

from __future__ import annotations

import re
from enum import Enum
from typing import Final

from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.flow_table import FlowTable
from fwav_companion.mavlink.wire.frames import (
    CHECKSUM_LENGTH,
    FLAG_SIGNED,
    HEADER_V1,
    HEADER_V2,
    MARKER_V1,
    MARKER_V2,
    SIGNATURE_LENGTH,
    RawFrame,
    checksum,
)

SHORTEST_V1: Final = HEADER_V1 + CHECKSUM_LENGTH
SHORTEST_V2: Final = HEADER_V2 + CHECKSUM_LENGTH
MARKERS: Final = bytes((MARKER_V2, MARKER_V1))
next_marker: Final = re.compile(b"[" + MARKERS + b"]").search


class NoFrameHere(Enum):
    """Reason why no frame begins at a byte."""

    NOTHING = "no frame"
    UNDECIDED = "more bytes are needed to decide"
    BAD_CHECKSUM = "its checksum is wrong"
    NOT_UNDERSTOOD = "it asks for what we do not know"


def read_frame(buffer: bytes, position: int, flows: FlowTable) -> RawFrame | NoFrameHere:
    """Return the frame that begins at the position. The checksum of an unknown message id cannot be checked."""
    left = len(buffer) - position
    marker = buffer[position]
    if marker not in MARKERS:
        return NoFrameHere.NOTHING
    if left < (SHORTEST_V2 if marker == MARKER_V2 else SHORTEST_V1):
        return NoFrameHere.UNDECIDED
    if marker == MARKER_V2:
        if buffer[position + 2] > FLAG_SIGNED:
            return NoFrameHere.NOT_UNDERSTOOD
        body_end = position + HEADER_V2 + buffer[position + 1]
        end = body_end + CHECKSUM_LENGTH + SIGNATURE_LENGTH * buffer[position + 2]
        identity = buffer[position + 5 : position + HEADER_V2]
        seq = buffer[position + 4]
    else:
        body_end = position + HEADER_V1 + buffer[position + 1]
        end = body_end + CHECKSUM_LENGTH
        identity = buffer[position + 3 : position + HEADER_V1] + b"\0\0"
        seq = buffer[position + 2]
    if end > len(buffer):
        return NoFrameHere.UNDECIDED
    flow = flows.find(identity)
    if flow.definition is not None:
        if marker == MARKER_V1 and buffer[position + 1] != flow.definition.base_length:
            return NoFrameHere.BAD_CHECKSUM
        received = int.from_bytes(buffer[body_end : body_end + CHECKSUM_LENGTH], "little")
        if checksum(buffer[position + 1 : body_end] + flow.crc_byte) != received:
            return NoFrameHere.BAD_CHECKSUM
    return RawFrame(buffer[position:end], flow, seq)


def may_be_known(buffer: bytes, position: int) -> bool:
    """Return whether the bytes here begin a frame of a known message id, as far as they have arrived."""
    if buffer[position] == MARKER_V2:
        msgid = buffer[position + 7 : position + HEADER_V2]
        return len(msgid) < 3 or int.from_bytes(msgid, "little") in DEFINITIONS
    return len(buffer) - position < HEADER_V1 or buffer[position + 5] in DEFINITIONS
