"""Where MAVLink frames end, by their headers alone: so that two clients of one link are never mixed inside a frame."""

from __future__ import annotations

V1_MAGIC, V2_MAGIC = 0xFE, 0xFD
V1_AROUND, V2_AROUND = 8, 12
"""Bytes of a frame beside its payload: header and checksum."""
SIGNATURE_BYTES = 13
SIGNED_FLAG = 0x01
"""Bit of a v2 frame's third byte."""


class FrameCutter:
    """Lets whole frames of one client pass, and keeps the begun one: at most a frame, 280 bytes.

    It checks nothing: bytes that are no frame pass as they came, in their order, and none is lost or added.
    """

    __slots__ = ("_begun",)

    def __init__(self) -> None:
        self._begun = b""

    def cut(self, data: bytes) -> bytes:
        """All bytes up to the end of the last whole frame; b"" while none ends."""
        if self._begun:
            data = self._begun + data
        at, end = 0, len(data)
        while at < end:
            step = _length_at(data, at)
            if at + step > end:
                break
            at += step
        self._begun = data[at:]
        return data[:at] if self._begun else data


def _length_at(data: bytes, at: int) -> int:
    """Bytes of the frame that begins here; 1 where none does; more than there are where its header is cut."""
    magic = data[at]
    if magic not in (V1_MAGIC, V2_MAGIC):
        return 1
    if len(data) - at < 3:
        return 3
    payload = data[at + 1]
    if magic == V1_MAGIC:
        return payload + V1_AROUND
    return payload + V2_AROUND + (SIGNATURE_BYTES if data[at + 2] & SIGNED_FLAG else 0)
