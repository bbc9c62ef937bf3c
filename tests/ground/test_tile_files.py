"""MBTiles files of strangers that hold no tiles, no numbers, or a table without an end."""

from __future__ import annotations

import sqlite3
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest

pytest.importorskip("aiohttp")

from peak_memory import peak_growth_kb
from tile_files import tile_file

from fwav_companion.errors import InputFileError
from fwav_companion.ground import tiles as tile_limits
from fwav_companion.ground.tiles import TileFile


def test_a_file_without_tiles_is_one_line(tmp_path):
    (tmp_path / "b.mbtiles").write_text("no database")
    for name in ("b.mbtiles", "absent.mbtiles"):
        with pytest.raises(InputFileError, match="accepted"):
            TileFile(str(tmp_path / name))


@pytest.mark.parametrize("zoom", ["abc", b"\x00", float("inf")])
def test_tiles_of_a_zoom_that_is_no_number_are_one_line(tmp_path, zoom):
    path = tile_file(tmp_path / "c.mbtiles", format="png")
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE tiles SET zoom_level = ?", (zoom,))
        database.commit()
    with pytest.raises(InputFileError, match="accepted"):
        TileFile(path)


def test_tiles_whose_table_never_ends_are_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(tile_limits, "MOST_STEPS", 1_000_000)
    path = tile_file(tmp_path / "d.mbtiles", format="png", bounds="nan,0,1,1")
    assert TileFile(path).info.bounds == ()
    with closing(sqlite3.connect(path)) as database:
        database.execute("DROP TABLE tiles")
        database.execute(
            "CREATE VIEW tiles AS WITH RECURSIVE c(zoom_level, tile_column, tile_row, tile_data) AS"
            " (SELECT 1, 1, 1, x'ff' UNION ALL SELECT zoom_level + 1, 1, 1, x'ff' FROM c) SELECT * FROM c"
        )
        database.commit()
    with pytest.raises(InputFileError, match="interrupted"):
        TileFile(path)


def replace_table(path, table, view):
    """Puts a view in the place of a table of the file."""
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"DROP TABLE {table}")
        database.execute(f"CREATE VIEW {table} AS {view}")
        database.commit()


def opened_kb(path, asked):
    """Memory that opening the file, limited to a million steps, and asking it take; a refusal is an answer, too."""
    return peak_growth_kb(
        "from contextlib import suppress\nfrom fwav_companion.errors import InputFileError\n"
        "from fwav_companion.ground import tiles\ntiles.MOST_STEPS = 1_000_000",
        f"with suppress(InputFileError):\n    assert not tiles.TileFile({str(path)!r}).{asked}",
    )


@pytest.mark.parametrize(("value", "rows"), [("zeroblob(300000000)", 8), ("randomblob(100000)", 2000)])
def test_metadata_of_gigabytes_in_a_small_file_are_not_made(tmp_path, value, rows):
    """Eight kilobytes took 2.6 GB and five seconds, or all memory and a traceback."""
    path = tile_file(tmp_path / "f.mbtiles", format="png")
    numbers = f"WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c WHERE n < {rows})"
    replace_table(path, "metadata", f"{numbers} SELECT 'n' || n AS name, {value} AS value FROM c")
    assert opened_kb(path, "info.attribution") < 50_000


def test_tile_of_a_gigabyte_in_a_small_file_is_none(tmp_path):
    path = tile_file(tmp_path / "g.mbtiles", format="png")
    place = "0 AS zoom_level, 0 AS tile_column, 0 AS tile_row"
    replace_table(path, "tiles", f"SELECT {place}, CASE 1 WHEN 1 THEN zeroblob(900000000) END AS tile_data")
    assert opened_kb(path, "tile(0, 0, 0)") < 50_000


def test_closing_ends_a_query_that_goes_on(tmp_path):
    path = tile_file(tmp_path / "e.mbtiles", format="png")
    with closing(sqlite3.connect(path)) as database:
        database.execute("DROP TABLE tiles")
        database.execute(
            "CREATE VIEW tiles AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c WHERE n < 100000)"
            " SELECT 1 AS zoom_level, n AS tile_column, 1 AS tile_row, x'ff' AS tile_data FROM c"
        )
        database.commit()
    tiles, counted, going = TileFile(path), [], threading.Event()
    exceeds = tiles._exceeds

    def count() -> bool:
        counted.append(1)
        going.set()
        while not tiles._closing:
            time.sleep(0.001)
        return exceeds()

    tiles._database.set_progress_handler(count, tile_limits.STEPS)
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(tiles.tile, 1, 0, 0)
        assert going.wait(20.0)
        tiles.close()
        assert asked.result(20.0) is None
    assert len(counted) == 1, "the query went on"
    assert tiles.tile(1, 0, 0) is None
