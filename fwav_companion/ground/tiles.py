"""SHELL: map tiles of an MBTiles file (MBTiles 1.3): one SQLite file, opened read-only."""

from __future__ import annotations

import sqlite3
import threading
from math import isfinite
from pathlib import Path
from urllib.parse import quote

import msgspec

from fwav_companion.errors import InputFileError

MIME = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}
"""Types by the first bytes of a tile; vector tiles are not shown."""
ACCEPTED = "accepted: an MBTiles file with PNG, JPEG or WebP tiles"
MAX_TILE_BYTES = 4_000_000
LARGEST_VALUE = MAX_TILE_BYTES + 10_000
"""Most bytes of a row or value that SQLite makes: a view in a file of some kilobytes may state gigabytes."""
DESCRIBED = ("format", "attribution", "bounds")
"""Rows of the metadata that are read: no others, of which a file may have any number."""
MAX_ZOOM = 24
MOST_STEPS = 100_000_000
"""Most instructions of SQLite in one query: some seconds of work. A file may define tables that never end."""
STEPS = 100_000
"""Instructions between two looks at their number."""


class TilesInfo(msgspec.Struct, frozen=True, kw_only=True):
    """Description of the file for the page."""

    min_zoom: int
    max_zoom: int
    attribution: str
    bounds: tuple[float, ...] = ()
    """West, south, east, north, degrees; empty: not stated."""


class TileFile:
    """One open file."""

    def __init__(self, path: str) -> None:
        """InputFileError where it is not an MBTiles file with raster tiles."""
        uri = f"file:{quote(str(Path(path).absolute()))}?mode=ro&immutable=1"
        try:
            self._database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        except sqlite3.Error as error:
            raise InputFileError(f"{path}: {error}; {ACCEPTED}") from None
        self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_VALUE)
        self._database.set_progress_handler(self._exceeds, STEPS)
        self._steps = 0
        self._closing = False
        self._query = threading.Lock()
        """Held while the file is asked."""
        try:
            self.info = _info(self._database)
        except (sqlite3.Error, LookupError, ValueError, TypeError, OverflowError) as error:
            self.close()
            raise InputFileError(f"{path}: {error}; {ACCEPTED}") from None

    def tile(self, zoom: int, column: int, row: int) -> tuple[str, bytes] | None:
        """Type and bytes of a tile in XYZ numbering; None where the file has none. MBTiles counts rows from south.

        It may take seconds, and may be called from any thread.
        """
        if not (0 <= zoom <= MAX_ZOOM and 0 <= column < 1 << zoom and 0 <= row < 1 << zoom):
            return None
        with self._query:
            self._steps = 0
            try:
                found = self._database.execute(
                    "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                    (zoom, column, (1 << zoom) - 1 - row),
                ).fetchone()
            except sqlite3.Error:  # a damaged page, a query without an end, or a closed file
                return None
        if found is None or not isinstance(found[0], bytes) or len(found[0]) > MAX_TILE_BYTES:
            return None
        kind = next((mime for start, mime in MIME.items() if found[0].startswith(start)), None)
        return None if kind is None else (kind, found[0])

    def _exceeds(self) -> bool:
        """Count the instructions of a query; true ends it."""
        self._steps += STEPS
        return self._closing or self._steps > MOST_STEPS

    def close(self) -> None:
        """Release the file. A query in another thread ends first, within milliseconds."""
        self._closing = True
        with self._query:
            self._database.close()


def _info(database: sqlite3.Connection) -> TilesInfo:
    """The file's description of its tiles. LookupError if it has no tiles with pictures."""
    metadata: dict[str, object] = {}
    for name in DESCRIBED:
        found = database.execute("SELECT value FROM metadata WHERE name = ?", (name,)).fetchone()
        metadata |= {} if found is None else {name: found[0]}
    low, high = database.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
    if low is None or metadata.get("format") == "pbf":
        raise LookupError("no raster tiles")
    return TilesInfo(
        min_zoom=int(low),
        max_zoom=int(high),
        attribution=_plain(str(metadata.get("attribution", ""))),
        bounds=_bounds(str(metadata.get("bounds", ""))),
    )


def _plain(text: str) -> str:
    """Text without markup, which attributions of map providers have."""
    shown, inside = [], False
    for character in text[:500]:
        inside = character == "<" or (inside and character != ">")
        if not inside and character != ">":
            shown.append(character)
    return "".join(shown)


def _bounds(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(each) for each in text.split(","))
    except ValueError:
        return ()
    return values if len(values) == 4 and all(map(isfinite, values)) else ()
