"""Removes signatures from frames for a recording, because they are made with a secret key.

MAVLink guide, message_signing: signatures and SETUP_SIGNING must be stripped from logs. The remaining frame is a whole
unsigned one with its own checksum, which every reader accepts.
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
    """Return the same message without its signature; the same bytes if it carries none."""
    return without_signature(frame.data)


def without_signature(data: bytes) -> bytes:
    """Return a whole frame as an unsigned one. It works for unknown ids too: see :func:`_seed_byte`."""
    if data[0] != MARKER_V2 or data[2] != FLAG_SIGNED:
        return data
    body_end = len(data) - SIGNATURE_LENGTH - CHECKSUM_LENGTH
    final = int.from_bytes(data[body_end : body_end + CHECKSUM_LENGTH], "little")
    seed = _seed_byte(checksum(data[1:body_end]), final)
    plain = data[1:2] + b"\0" + data[3:body_end]
    return data[:1] + plain + checksum(plain + seed).to_bytes(CHECKSUM_LENGTH, "little")


def _seed_byte(before: int, final: int) -> bytes:
    """Return the checksum seed (crc_extra) of a message, derived from a frame's own checksum: this works for unknown
    ids too.

    The seed is the last byte that the checksum covers. One step takes the register ``before`` to the frame's ``final``
    checksum, and each of the 256 bytes leads to a different value.
    """
    return bytes((_BYTE_OF_STEP.get(final ^ (before >> 8), 0) ^ (before & 0xFF),))


def _step(byte: int) -> int:
    """Return what a byte, already combined with the register's low half, adds to the register (CRC-16/MCRF4XX)."""
    folded = byte ^ (byte << 4) & 0xFF
    return (folded << 8 ^ folded << 3 ^ folded >> 4) & 0xFFFF


_BYTE_OF_STEP: Final = {_step(byte): byte for byte in range(256)}
