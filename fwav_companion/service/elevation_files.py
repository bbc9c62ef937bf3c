"""Elevation files on disk: SRTM .hgt, which needs no library, and GeoTIFF through rasterio. SHELL.

Files disagree about where a sample lies: in a PixelIsArea file the tie point is the corner of the first pixel, in a
PixelIsPoint file its centre, half a pixel (15 m at one second of arc) away. GDAL, told to honour the difference, gives
the corner for both; samples are then the centres of its pixels.
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
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import opened

HGT_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3}).*\.hgt", re.IGNORECASE)
HGT_VOID = -32768
MOST_SAMPLES = 40_000_000
"""Of a GeoTIFF: 160 MB in memory. A tile of one second of arc has 13 million."""
GEOTIFF_SUFFIXES = (".tif", ".tiff")


def read_elevation(paths: Sequence[Path]) -> tuple[ElevationTile, ...]:
    """One tile a file, in the order given. InputFileError names the file and what is accepted."""
    return tuple(_read(path) for path in paths)


def _read(path: Path) -> ElevationTile:
    suffix = path.suffix.lower()
    try:
        opened(path).close()  # libraries would wait for a pipe
        if suffix == ".hgt":
            return _read_hgt(path)
        if suffix in GEOTIFF_SUFFIXES:
            return _read_geotiff(path)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror or error}; a readable elevation file is accepted") from error
    raise InputFileError(f"{path}: {suffix or 'no suffix'} stands there; .hgt, .tif and .tiff are accepted")


def _read_hgt(path: Path) -> ElevationTile:
    """Big-endian 16-bit rows from the north, both edges included; the name is the south-west sample. Stays on disk."""
    named = HGT_NAME.fullmatch(path.name)
    if named is None:
        raise InputFileError(f"{path}: the name does not tell its corner; one like N47E008.hgt is accepted")
    with opened(path) as file:
        size = file.seek(0, 2)
        side = isqrt(size // 2)
        if side < 2 or side * side * 2 != size:
            raise InputFileError(f"{path}: {size} bytes stand there; a square of 16-bit samples is accepted")
        content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    south = int(named[2]) * (1.0 if named[1].upper() == "N" else -1.0)
    west = int(named[4]) * (1.0 if named[3].upper() == "E" else -1.0)
    step = 1.0 / (side - 1)
    return ElevationTile(south + 1.0, west, step, step, side, side, _hgt_heights(content, side), path.name)


def _hgt_heights(content: mmap.mmap, side: int) -> Callable[[int, int], float]:
    sample = struct.Struct(">h")

    def height_m(row: int, column: int) -> float:
        (found,) = sample.unpack_from(content, 2 * (row * side + column))
        return nan if found == HGT_VOID else float(found)

    return height_m


def _read_geotiff(path: Path) -> ElevationTile:
    try:
        import rasterio
        from rasterio.errors import RasterioError
        from rasterio.vrt import WarpedVRT
    except ImportError as error:
        raise InputFileError(
            f"{path}: reading it needs rasterio, which is not installed; pip install 'fwav-companion[terrain]', or .hgt"
        ) from error
    try:
        with rasterio.Env(GTIFF_POINT_GEO_IGNORE="FALSE"), rasterio.open(path) as source:
            if source.crs is None:
                raise InputFileError(f"{path}: no coordinate system stands there; a georeferenced GeoTIFF is accepted")
            if source.crs.is_geographic and source.transform.is_rectilinear and source.transform.e < 0.0:
                return _tile(path, source)
            with WarpedVRT(source, crs="EPSG:4326", resampling=rasterio.enums.Resampling.bilinear) as warped:
                return _tile(path, warped)
    except RasterioError as error:
        raise InputFileError(f"{path}: {' '.join(str(error).split())}; a GeoTIFF of heights is accepted") from error


def _tile(path: Path, source: Any) -> ElevationTile:
    rows, columns, transform = source.height, source.width, source.transform
    if rows < 2 or columns < 2 or rows * columns > MOST_SAMPLES:
        raise InputFileError(
            f"{path}: {columns} x {rows} samples stand there; 2 x 2 to {MOST_SAMPLES} in all are accepted, a part of it"
        )
    band = source.read(1, masked=True, out_dtype="float32").filled(nan)
    heights: array[float] = array("f", band.tobytes())

    def height_m(row: int, column: int) -> float:
        return float(heights[row * columns + column])

    return ElevationTile(
        transform.f + 0.5 * transform.e,
        transform.c + 0.5 * transform.a,
        -transform.e,
        transform.a,
        rows,
        columns,
        height_m,
        path.name,
    )
