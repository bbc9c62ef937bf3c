"""The one decoder of recorded lines: whole lines as Structs; other lines are passed over and counted. PURE."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final, Generic, TypeVar, get_args

import msgspec

from fwav_companion.recording.line_types import Line

L = TypeVar("L")
DAMAGE: Final = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
"""What decoding raises for bytes that are not a line of a wanted type: msgspec checks neither text nor depth."""


class _TypeOfLine(msgspec.Struct):
    """The type of any line, also of one that a later version wrote."""

    type: str


class LineDecoder(Generic[L]):
    """Decodes the lines of one file."""

    def __init__(self, lines: Any) -> None:
        """``lines``: union of the types of the lines, tagged Structs."""
        self._decoder: msgspec.json.Decoder[L] = msgspec.json.Decoder(lines)
        self._known = {kind.__struct_config__.tag for kind in get_args(lines)}
        self.damaged = 0
        """Lines that are not whole: a power cut leaves the last one in pieces."""
        self.unknown = 0
        """Whole lines of a type that this version does not know."""

    def decode(self, encoded: bytes) -> L | None:
        """The line; None where it is passed over. Blank lines are not counted."""
        if not encoded.strip():
            return None
        try:
            return self._decoder.decode(encoded)
        except DAMAGE:
            if self._is_unknown(encoded):
                self.unknown += 1
            else:
                self.damaged += 1
            return None

    def _is_unknown(self, encoded: bytes) -> bool:
        try:
            return msgspec.json.decode(encoded, type=_TypeOfLine).type not in self._known
        except DAMAGE:
            return False


def targets_decoder() -> LineDecoder[Line]:
    """A decoder of one targets file."""
    return LineDecoder(Line)


class LinesRead(msgspec.Struct, frozen=True):
    """A targets file that was read as a whole."""

    lines: list[Line]
    damaged: int
    """Number of lines that are not whole."""
    unknown: int
    """Number of lines of unknown types."""


def read_lines(content: Iterable[bytes]) -> LinesRead:
    """The lines of a targets file."""
    decoder = targets_decoder()
    lines = [line for line in map(decoder.decode, content) if line is not None]
    return LinesRead(lines, decoder.damaged, decoder.unknown)
