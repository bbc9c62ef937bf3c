"""STATUSTEXT (253): one line for people, in as many chunks as it takes.

A receiver takes a chunk with a zero byte in it for the last one: every chunk but the last fills its 50 bytes, the last
does not. A character that would be cut in two goes to the next chunk, and spaces fill the gap.
"""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.types.messages import Destination, NoticeCode, Outgoing

CHUNK_BYTES = 50
MAX_BYTES = 4 * CHUNK_BYTES
"""Longer lines are cut: nobody reads more, and a radio carries it at the cost of telemetry."""
ALONE = 0
"""The id of a text that is whole in one message."""
ID_MODULUS = 0xFFFF


def statustexts(
    text: str,
    severity: int,
    *,
    code: NoticeCode,
    component: int,
    number: int = 1,
    to: Destination = Destination.GROUND,
    link: str = "",
) -> list[Outgoing]:
    """The messages of one text. ``number`` is the text's own, counted by the sender: chunks are joined by it."""
    encoded = _printable(text).encode(errors="replace")
    if len(encoded) <= CHUNK_BYTES:
        chunks, identity = [encoded.decode()], ALONE
    else:
        chunks, identity = list(_chunks(encoded[:MAX_BYTES])), 1 + number % ID_MODULUS
    return [
        Outgoing(
            name="STATUSTEXT",
            fields={"severity": severity, "text": chunk, "id": identity, "chunk_seq": sequence},
            to=to,
            component=component,
            link=link,
            notice=code,
        )
        for sequence, chunk in enumerate(chunks)
    ]


def _chunks(encoded: bytes) -> Iterator[str]:
    while len(encoded) >= CHUNK_BYTES:
        whole = encoded[:CHUNK_BYTES].decode(errors="ignore")
        size = len(whole.encode())
        yield whole + " " * (CHUNK_BYTES - size)
        encoded = encoded[size:]
    yield encoded.decode(errors="ignore")


def _printable(text: str) -> str:
    """A zero byte would end the text, a line break the line."""
    return "".join(character if character.isprintable() else " " for character in text)
