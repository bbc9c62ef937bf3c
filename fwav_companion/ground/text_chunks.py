"""Joins the chunks of STATUSTEXT (MAVLink common.xml, 253) to whole texts. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

MAX_OPEN = 32
"""Most texts that wait for chunks."""
MAX_CHUNKS = 8
"""Most chunks of one text, 400 characters; this project's texts have at most four."""
CHUNK_CHARACTERS = 50
WAIT_S = 2.0
"""Time after which a text is shown without its missing chunks."""


class TextChunks:
    """Chunks that wait for the others of their text."""

    def __init__(self) -> None:
        self._open: dict[tuple[int, int, int], tuple[float, int, dict[int, str]]] = {}

    def add(self, sender: tuple[int, int], fields: Any, now: float) -> str | None:
        """The whole text if this chunk completes it; otherwise None. A chunk with fewer than 50 bytes is the last."""
        if fields.id == 0:
            return str(fields.text)
        if fields.chunk_seq >= MAX_CHUNKS:
            return None
        key = (*sender, fields.id)
        if key not in self._open and len(self._open) >= MAX_OPEN:
            del self._open[next(iter(self._open))]
        _, _, chunks = self._open.setdefault(key, (now, fields.severity, {}))
        chunks[fields.chunk_seq] = fields.text
        last = max(chunks)
        ends = len(chunks[last].encode()) < CHUNK_CHARACTERS or last == MAX_CHUNKS - 1
        if not ends or len(chunks) <= last:
            return None
        del self._open[key]
        return "".join(chunks[at] for at in range(last + 1))

    def overdue(self, now: float) -> Iterator[tuple[int, int, str]]:
        """System, severity and text of each text whose missing chunks did not arrive; "..." replaces those chunks."""
        for key in [key for key, (since, _, _) in self._open.items() if now > since + WAIT_S]:
            _, severity, chunks = self._open.pop(key)
            whole = "".join(chunks.get(at, "...") for at in range(max(chunks) + 1))
            yield key[0], severity, whole
