"""SHELL: reads elevation files: SRTM .hgt, which needs no library, and GeoTIFF through rasterio.

Files differ in the position of a sample: in a PixelIsArea file the tie point is the corner of the first pixel, in a
PixelIsPoint file its centre, half a pixel (15 m at one second of arc) away. With GTIFF_POINT_GEO_IGNORE=FALSE, GDAL
gives the corner for both; samples are then the centres of its pixels.
"""

from __future__ import annotations

import mmap
import re
import struct
from array import array
from collections.abc import Callable, Sequence
from math import isqrt, nan
from pathlib import Path
from typing import Any

from fwav_companion.errors import InputFileError
from fwav_companion.libraries import require
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import opened

HGT_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3}).*\.hgt", re.IGNORECASE)
HGT_VOID = -32768
MOST_SAMPLES = 40_000_000
"""Most samples of a GeoTIFF: 160 MB in memory. A tile of one arc second has 13 million."""
GEOTIFF_SUFFIXES = (".tif", ".tiff")


def read_elevation(paths: Sequence[Path]) -> tuple[ElevationTile, ...]:
    """One tile per file, in the given order. InputFileError names the file and what is accepted."""
    return tuple(_read(path) for path in paths)


def _read(path: Path) -> ElevationTile:
    suffix = path.suffix.lower()
    try:
        opened(path).close()  # rejects a pipe, for which libraries would wait
        if suffix == ".hgt":
            return _read_hgt(path)
        if suffix in GEOTIFF_SUFFIXES:
            return _read_geotiff(path)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror or error}; accepted: a readable elevation file") from error
    raise InputFileError(f"{path}: its suffix is {suffix or 'missing'}; accepted: .hgt, .tif and .tiff")


def _read_hgt(path: Path) -> ElevationTile:
    """A tile of big-endian 16-bit rows from the north, edges included; its name is the south-west sample.

    The file is mapped and not loaded.
    """
    named = HGT_NAME.fullmatch(path.name)
    if named is None:
        raise InputFileError(f"{path}: its name is not that of a corner; accepted: one like N47E008.hgt")
    with opened(path) as file:
        size = file.seek(0, 2)
        side = isqrt(size // 2)
        if side < 2 or side * side * 2 != size:
            raise InputFileError(f"{path}: it has {size} bytes; accepted: a square of 16-bit samples")
        content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    south = int(named[2]) * (1.0 if named[1].upper() == "N" else -1.0)
    west = int(named[4]) * (1.0 if named[3].upper() == "E" else -1.0)
    step = 1.0 / (side - 1)
    return ElevationTile(
        north_deg=south + 1.0,
        west_deg=west,
        lat_step_deg=step,
        lon_step_deg=step,
        rows=side,
        columns=side,
        height_m=_hgt_heights(content, side),
        name=path.name,
    )


def _hgt_heights(content: mmap.mmap, side: int) -> Callable[[int, int], float]:
    sample = struct.Struct(">h")

    def height_m(row: int, column: int) -> float:
        (found,) = sample.unpack_from(content, 2 * (row * side + column))
        return nan if found == HGT_VOID else float(found)

    return height_m


def _read_geotiff(path: Path) -> ElevationTile:
    require(f"{path}: a GeoTIFF (.hgt needs no library)", "rasterio")
    import rasterio
    from rasterio.errors import RasterioError
    from rasterio.vrt import WarpedVRT

    try:
        with rasterio.Env(GTIFF_POINT_GEO_IGNORE="FALSE"), rasterio.open(path) as source:
            if source.crs is None:
                raise InputFileError(f"{path}: it has no coordinate system; accepted: a georeferenced GeoTIFF")
            if source.crs.is_geographic and source.transform.is_rectilinear and source.transform.e < 0.0:
                return _tile(path, source)
            with WarpedVRT(source, crs="EPSG:4326", resampling=rasterio.enums.Resampling.bilinear) as warped:
                return _tile(path, warped)
    except RasterioError as error:
        raise InputFileError(f"{path}: {' '.join(str(error).split())}; accepted: a GeoTIFF of heights") from error


def _tile(path: Path, source: Any) -> ElevationTile:
    rows, columns, transform = source.height, source.width, source.transform
    if rows < 2 or columns < 2 or rows * columns > MOST_SAMPLES:
        raise InputFileError(
            f"{path}: it has {columns} x {rows} samples; accepted: 2 x 2 to {MOST_SAMPLES} in all, so a part of it"
        )
    band = source.read(1, masked=True, out_dtype="float32").filled(nan)
    heights: array[float] = array("f", band.tobytes())

    def height_m(row: int, column: int) -> float:
        return float(heights[row * columns + column])

    return ElevationTile(
        north_deg=transform.f + 0.5 * transform.e,
        west_deg=transform.c + 0.5 * transform.a,
        lat_step_deg=-transform.e,
        lon_step_deg=transform.a,
        rows=rows,
        columns=columns,
        height_m=height_m,
        name=path.name,
    )
