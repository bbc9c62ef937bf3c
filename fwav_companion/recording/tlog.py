"""The .tlog format of Mission Planner and MAVProxy: eight bytes of Unix microseconds, big-endian, before each frame."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content

_STAMP = struct.Struct(">Q")
_MAGICS = (0xFD, 0xFE)
_V1_OVERHEAD, _V2_OVERHEAD, _SIGNATURE = 8, 12, 13
LATEST_US = 4_102_444_800_000_000
"""Latest plausible time, 2100-01-01: a later one is damage. Early times are accepted, because a board without a clock
starts in 1970."""


class TlogRecord(msgspec.Struct, frozen=True, gc=False):
    """One recorded frame."""

    unix_us: int
    frame: bytes

    @property
    def bytes_in_file(self) -> int:
        """Length of the record in the file, timestamp included."""
        return _STAMP.size + len(self.frame)


class SkippedBytes(msgspec.Struct, frozen=True):
    """A damaged stretch of a file."""

    offset: int
    length: int


def tlog_record(unix_us: int, frame: bytes) -> bytes:
    """The bytes of one record."""
    return _STAMP.pack(unix_us) + frame


def read_tlog(data: bytes) -> Iterator[TlogRecord | SkippedBytes]:
    """Records in file order, and the damaged stretches between them."""
    at, skipped_from = 0, 0
    while at + 8 < len(data):
        length = _record_length(data, at)
        if length is None:
            at += 1
            continue
        if skipped_from < at:
            yield SkippedBytes(skipped_from, at - skipped_from)
        yield TlogRecord(_STAMP.unpack_from(data, at)[0], data[at + 8 : at + length])
        at += length
        skipped_from = at
    if skipped_from < len(data):
        yield SkippedBytes(skipped_from, len(data) - skipped_from)


def _record_length(data: bytes, at: int) -> int | None:
    """Length of the record at ``at``, timestamp included; None if no record begins there."""
    magic = data[at + 8]
    if magic not in _MAGICS or _STAMP.unpack_from(data, at)[0] > LATEST_US:
        return None
    if at + 11 > len(data):
        return None
    length = 8 + data[at + 9] + (_V1_OVERHEAD if magic == 0xFE else _V2_OVERHEAD)
    if magic == 0xFD and data[at + 10] & 1:
        length += _SIGNATURE
    end = at + length
    if end > len(data):
        return None
    # A frame's first bytes can occur inside another's payload: another record, or the end of the file, must follow.
    if end + 8 < len(data) and data[end + 8] not in _MAGICS:
        return None
    return length


def load_tlog(path: Path) -> bytes:
    """Content of a telemetry file, possibly empty. InputFileError if it cannot be read or does not contain a record."""
    try:
        data = content(path)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a .tlog recording") from None
    if data and not any(isinstance(record, TlogRecord) for record in _first_records(data)):
        raise InputFileError(
            f"{path}: no MAVLink record in its {len(data)} bytes, and it does not begin as a log does; accepted: a "
            ".tlog, .bin or .ulg recording"
        )
    return data


def _first_records(data: bytes) -> Iterator[TlogRecord | SkippedBytes]:
    for count, record in enumerate(read_tlog(data)):
        yield record
        if count == 1:  # at most one damaged stretch precedes the first record
            return
