"""Small MBTiles files."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

PNG = b"\x89PNG\r\n\x1a\nrest"


def tile_file(path: Path, **metadata: str) -> str:
    """The path of a file with one tile of zoom 2."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE metadata (name text, value text)")
        database.execute(
            "CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob)"
        )
        database.executemany("INSERT INTO metadata VALUES (?, ?)", metadata.items())
        database.execute("INSERT INTO tiles VALUES (2, 1, 3, ?)", (PNG,))
        database.commit()
    return str(path)
