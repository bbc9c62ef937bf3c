"""The format of ArduPilot's own log (DataFlash, ``.bin``), which describes itself by FMT records. PURE.

The format has no checksums. A record is accepted if another record, or the end of the file, follows it: after a power
cut, a card may contain half a record followed by old data.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from struct import Struct
from typing import Final, TypeAlias

import msgspec

from fwav_companion.recording.tlog import SkippedBytes

HEAD: Final = b"\xa3\x95"
HEAD_BYTES: Final = 3
"""Length of a record's head: the two bytes above and the kind."""
_FMT: Final = 128
_FMT_BODY: Final = Struct("<BB4s16s64s")
_NUMBERS: Final = {
    "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "g": "e",
    "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip
_OTHERS: Final = {"a": 64, "n": 4, "N": 16, "Z": 64}
"""Texts and arrays, with their length in bytes. All format characters: ArduPilot AP_Logger/LogStructure.h."""
_SCALES: Final = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}

Values: TypeAlias = dict[str, float]
"""Values by column, in the units of ArduPilot's documentation."""


class Wanted(msgspec.Struct, frozen=True):
    """The columns of one message that are read."""

    needed: frozenset[str]
    """If the log's description lacks one of these, the message is treated as missing."""
    also: frozenset[str] = frozenset()
    """Optional columns."""


class _Format(msgspec.Struct, frozen=True):
    """One kind of record. Records of a kind without a struct are skipped."""

    name: str
    length: int
    """Length of a record, bytes, the three of the head included."""
    struct: Struct | None = None
    """Unpacks the wanted columns; the others are padding."""
    columns: tuple[tuple[str, float], ...] = ()
    """Name and scale of each wanted column."""

    def values(self, data: bytes, at: int) -> Values:
        if self.struct is None:
            return {}
        raw = self.struct.unpack_from(data, at + HEAD_BYTES)
        return {column: value * scale for (column, scale), value in zip(self.columns, raw, strict=True)}


def is_dataflash(data: bytes) -> bool:
    """Whether the data begins as an ArduPilot log does, with a description."""
    return data.startswith(HEAD + bytes((_FMT,)))


def read_records(data: bytes, wanted: Mapping[str, Wanted]) -> Iterator[tuple[str, Values] | SkippedBytes]:
    """The wanted records in file order, and the damaged stretches between them."""
    formats = {_FMT: _Format("FMT", HEAD_BYTES + _FMT_BODY.size)}
    at = reported = 0
    while 0 <= at < len(data):
        found = _format_at(data, at, formats)
        if found is None:
            at = data.find(HEAD, at + 1)
            continue
        if reported < at:
            yield SkippedBytes(reported, at - reported)
        if data[at + 2] == _FMT:
            _learn(data, at, formats, wanted)
        elif found.struct is not None:
            yield found.name, found.values(data, at)
        at = reported = at + found.length
    if reported < len(data):
        yield SkippedBytes(reported, len(data) - reported)


def _format_at(data: bytes, at: int, formats: Mapping[int, _Format]) -> _Format | None:
    """Kind of the complete record that begins here and is followed by another; None if there is none."""
    if not data.startswith(HEAD, at) or at + 2 >= len(data):
        return None
    found = formats.get(data[at + 2])
    if found is None or at + found.length > len(data):
        return None
    end = at + found.length
    return found if HEAD.startswith(data[end : end + 2]) else None


def _learn(data: bytes, at: int, formats: dict[int, _Format], wanted: Mapping[str, Wanted]) -> None:
    """Add a described kind. Of unknown kinds, as future firmware may add, the length suffices to skip the records."""
    kind, length, name, characters, columns = _FMT_BODY.unpack_from(data, at + HEAD_BYTES)
    if kind == _FMT or length < HEAD_BYTES:
        return
    text = _text(name)
    picked = _picked(_text(characters), _text(columns).split(","), length, wanted.get(text))
    known = formats.get(kind)
    if picked is None and known is not None and known.struct is not None:
        return  # a damaged description does not undo a good one
    struct, chosen = picked or (None, ())
    formats[kind] = _Format(text, length, struct, chosen)


def _picked(
    characters: str, names: list[str], length: int, wanted: Wanted | None
) -> tuple[Struct, tuple[tuple[str, float], ...]] | None:
    """Struct, names and scales of the wanted columns; None if they cannot be unpacked."""
    if wanted is None or not wanted.needed.issubset(names):
        return None
    codes, chosen = ["<"], []
    for character, name in zip(characters, names, strict=False):
        code = _NUMBERS.get(character)
        if code is not None and name in wanted.needed | wanted.also:
            codes.append(code)
            chosen.append((name, _SCALES.get(character, 1)))
        elif code is not None or character in _OTHERS:
            codes.append(f"{_OTHERS.get(character) or Struct('<' + str(code)).size}x")
        else:
            return None
    struct = Struct("".join(codes))
    if struct.size + HEAD_BYTES != length or not wanted.needed.issubset(name for name, _ in chosen):
        return None
    return struct, tuple(chosen)


def _text(field: bytes) -> str:
    return field.split(b"\0")[0].decode("ascii", "replace")
