"""Where a PX4 log (``.ulg``) is damaged, and the log without that. Pure.

pyulog does not tell the place of damage, and takes ten seconds to get over a mebibyte of zeros.

A file is a head of 16 bytes and messages: their size (two bytes), their kind (a letter), and so many bytes
(docs.px4.io, ULog file format). A message is one where the next one, or the end of the file, follows it; behind
damage, where three do: one letter in twenty is a kind.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from typing import Final

from fwav_companion.recording.tlog import SkippedBytes

FILE_HEAD_BYTES: Final = 16
HEAD: Final = struct.Struct("<Hc")
KIND: Final = re.compile(rb"[BFIMPQARDLCSO]")
FOLLOWERS_BEHIND_DAMAGE: Final = 3
FLAGS_AT: Final = FILE_HEAD_BYTES + HEAD.size
"""The first message's content: flags."""
FLAGS_SIZE: Final = 40
APPENDED_SIZE: Final = 24
"""The last of them: where in the file up to three appended parts begin."""


def damaged_stretches(data: bytes) -> Iterator[SkippedBytes]:
    """In file order."""
    at = told = FILE_HEAD_BYTES
    while at + HEAD.size <= len(data):
        end = _end_of_message(data, at, followers=1 if told == at else FOLLOWERS_BEHIND_DAMAGE)
        if end is None:
            kind = KIND.search(data, at + HEAD.size)
            if kind is None:
                break
            at = kind.start() - HEAD.size + 1
            continue
        if told < at:
            yield SkippedBytes(told, at - told)
        at = told = end
    if told < len(data):
        yield SkippedBytes(told, len(data) - told)


def without(data: bytes, skipped: Sequence[SkippedBytes]) -> bytes:
    """The messages alone. What was appended (a crash's last words) then follows without a gap: its offsets are zero."""
    kept, at = bytearray(), 0
    for stretch in skipped:
        kept += data[at : stretch.offset]
        at = stretch.offset + stretch.length
    kept += data[at:]
    flags_end = FLAGS_AT + FLAGS_SIZE
    if kept[FLAGS_AT - 1 : FLAGS_AT] == b"B" and len(kept) >= flags_end:
        kept[flags_end - APPENDED_SIZE : flags_end] = bytes(APPENDED_SIZE)
    return bytes(kept)


def _end_of_message(data: bytes, at: int, followers: int) -> int | None:
    """Where the message that stands here ends; None where none stands, with so many behind it."""
    if at + HEAD.size > len(data):
        return at if followers == 0 else None
    size, kind = HEAD.unpack_from(data, at)
    end: int = at + HEAD.size + size
    if not KIND.match(kind) or (followers and end > len(data)):
        return None
    if followers and end < len(data) and _end_of_message(data, end, followers - 1) is None:
        return None
    return end
