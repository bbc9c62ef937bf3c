"""Frames as a recording keeps them: without signatures, which are made with a key and are nobody's business later.

MAVLink guide, message_signing: signatures and SETUP_SIGNING are to be stripped from logs. The frame that is left is a
whole unsigned one, with a checksum of its own, that every reader takes.
"""

from __future__ import annotations

from typing import Final

from fwav_companion.mavlink.wire.frames import (
    CHECKSUM_LENGTH,
    FLAG_SIGNED,
    MARKER_V2,
    SIGNATURE_LENGTH,
    RawFrame,
    checksum,
)


def unsigned(frame: RawFrame) -> bytes:
    """The same message without its signature; the very bytes where it carries none."""
    return without_signature(frame.data)


def without_signature(data: bytes) -> bytes:
    """A whole frame as if it had never been signed. Of unknown ids too: see :func:`_seed_byte`."""
    if data[0] != MARKER_V2 or data[2] != FLAG_SIGNED:
        return data
    body_end = len(data) - SIGNATURE_LENGTH - CHECKSUM_LENGTH
    told = int.from_bytes(data[body_end : body_end + CHECKSUM_LENGTH], "little")
    seed = _seed_byte(checksum(data[1:body_end]), told)
    plain = data[1:2] + b"\0" + data[3:body_end]
    return data[:1] + plain + checksum(plain + seed).to_bytes(CHECKSUM_LENGTH, "little")


def _seed_byte(before: int, told: int) -> bytes:
    """The message's checksum seed (crc_extra), worked out from a frame's own checksum: ids of no dialect have one too.

    The seed is the last byte that the checksum covers; one step takes the register ``before`` to what was told, and
    each of the 256 bytes takes it elsewhere.
    """
    return bytes((_BYTE_OF_STEP.get(told ^ (before >> 8), 0) ^ (before & 0xFF),))


def _step(byte: int) -> int:
    """What a byte, already joined with the register's low half, adds to the register (CRC-16/MCRF4XX)."""
    folded = byte ^ (byte << 4) & 0xFF
    return (folded << 8 ^ folded << 3 ^ folded >> 4) & 0xFFFF


_BYTE_OF_STEP: Final = {_step(byte): byte for byte in range(256)}
