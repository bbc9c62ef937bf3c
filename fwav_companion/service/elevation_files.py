"""SHELL: reads elevation files: SRTM .hgt (also zipped), which needs no library, GeoTIFF and DTED through rasterio.

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
from zipfile import ZipFile

from fwav_companion.errors import InputFileError
from fwav_companion.libraries import require
from fwav_companion.localization import ElevationTile
from fwav_companion.on_disk import open_regular
from fwav_companion.zip_damage import ZIP_DAMAGE

HGT_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3}).*\.hgt", re.IGNORECASE)
LOWEST_M, HIGHEST_M = -500.0, 9000.0
"""Heights beyond these are voids that a file does not tag (-32768, -9999): the lowest land is at -430 m."""
FEET = {"ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "us survey foot": 1200.0 / 3937.0, "us-ft": 1200.0 / 3937.0}
"""Metres in a file's unit of height, by the unit's name in lower case."""
DATUMS = {"EGM2008": "egm2008", "EGM96": "egm96", "EGM 1996": "egm96"}
"""Datum by a name in the description of a file's vertical coordinate system."""
MOST_UNZIPPED = 100_000_000
"""Most bytes of a zipped .hgt; a tile of one arc second has 26 million."""
MOST_SAMPLES = 40_000_000
"""Most samples of a GeoTIFF: 160 MB in memory. A tile of one arc second has 13 million."""
RASTER_DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".dt0": "DTED", ".dt1": "DTED", ".dt2": "DTED"}
"""GDAL's driver by the suffix. Left to choose by the content, GDAL takes drivers that fetch from the network, or read
any other file that the content names (VRT, WMS)."""
ACCEPTED = ".hgt, .hgt.zip, .tif, .tiff, .dt0, .dt1 and .dt2"


def read_elevation(paths: Sequence[Path]) -> tuple[ElevationTile, ...]:
    """One tile per file, the finest first. InputFileError names the file and what is accepted."""
    return tuple(sorted((_read(path) for path in paths), key=lambda tile: tile.lat_step_deg))


def _read(path: Path) -> ElevationTile:
    suffix = path.suffix.lower()
    try:
        open_regular(path).close()  # rejects a pipe, for which libraries would wait
        if suffix == ".hgt":
            return _read_hgt(path)
        if path.name.lower().endswith(".hgt.zip"):
            return _read_zipped_hgt(path)
        if suffix in RASTER_DRIVERS:
            return _read_geotiff(path)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror or error}; accepted: a readable elevation file") from error
    raise InputFileError(f"{path}: its suffix is {suffix or 'missing'}; accepted: {ACCEPTED}")


def _read_hgt(path: Path) -> ElevationTile:
    """The tile of a file, which is mapped and not loaded."""
    _require_corner_name(path, path.name)
    with open_regular(path) as file:
        if file.seek(0, 2) == 0:
            raise InputFileError(f"{path}: it has 0 bytes; accepted: a square of 16-bit samples")
        return _hgt_tile(path, path.name, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


def _read_zipped_hgt(path: Path) -> ElevationTile:
    """The tile of the one .hgt in a zip file."""
    try:
        with open_regular(path) as file, ZipFile(file) as archive:
            members = [each for each in archive.infolist() if each.filename.lower().endswith(".hgt")]
            if len(members) != 1 or members[0].file_size > MOST_UNZIPPED:
                raise InputFileError(f"{path}: it has {len(members)} .hgt files; accepted: one, of at most 100 MB")
            name = Path(members[0].filename).name
            _require_corner_name(path, name)
            return _hgt_tile(path, name, archive.read(members[0]))
    except ZIP_DAMAGE:
        raise InputFileError(f"{path}: a broken zip file; accepted: {ACCEPTED}") from None


def _require_corner_name(path: Path, name: str) -> None:
    if HGT_NAME.fullmatch(name) is None:
        raise InputFileError(f"{path}: its name is not that of a corner; accepted: one like N47E008.hgt")


def _hgt_tile(path: Path, name: str, content: mmap.mmap | bytes) -> ElevationTile:
    """A tile of big-endian 16-bit rows from the north, edges included; its name is the south-west sample."""
    size = len(content)
    side = isqrt(size // 2)
    if side < 2 or side * side * 2 != size:
        raise InputFileError(f"{path}: it has {size} bytes; accepted: a square of 16-bit samples")
    corner = HGT_NAME.fullmatch(name)
    assert corner is not None  # noqa: S101  # by _require_corner_name
    south = int(corner[2]) * (1.0 if corner[1].upper() == "N" else -1.0)
    west = int(corner[4]) * (1.0 if corner[3].upper() == "E" else -1.0)
    step = 1.0 / (side - 1)
    return ElevationTile(
        north_deg=south + 1.0,
        west_deg=west,
        lat_step_deg=step,
        lon_step_deg=step,
        rows=side,
        columns=side,
        height_m=_hgt_heights(content, side),
        name=name,
    )


def _hgt_heights(content: mmap.mmap | bytes, side: int) -> Callable[[int, int], float]:
    sample = struct.Struct(">h")

    def height_m(row: int, column: int) -> float:
        (found,) = sample.unpack_from(content, 2 * (row * side + column))
        return float(found) if LOWEST_M <= found <= HIGHEST_M else nan

    return height_m


def _read_geotiff(path: Path) -> ElevationTile:
    require(f"{path}: a GeoTIFF or DTED (.hgt needs no library)", "rasterio")
    import rasterio
    from rasterio.errors import RasterioError
    from rasterio.vrt import WarpedVRT

    try:
        with (
            rasterio.Env(GTIFF_POINT_GEO_IGNORE="FALSE"),
            rasterio.open(path, driver=RASTER_DRIVERS[path.suffix.lower()]) as source,
        ):
            _require_samples(path, source)
            if source.crs is None:
                raise InputFileError(f"{path}: it has no coordinate system; accepted: a georeferenced GeoTIFF")
            if source.dtypes[0].startswith("complex"):
                raise InputFileError(f"{path}: its samples are complex numbers; accepted: a GeoTIFF of heights")
            if source.crs.is_geographic and source.transform.is_rectilinear and source.transform.e < 0.0:
                return _tile(path, source)
            options = {"resampling": rasterio.enums.Resampling.bilinear, "src_nodata": _void_of(source)}
            with WarpedVRT(source, crs="EPSG:4326", **options) as warped:
                return _tile(path, warped)
    except RasterioError as error:
        raise InputFileError(f"{path}: {' '.join(str(error).split())}; accepted: a GeoTIFF of heights") from error
    except InputFileError:
        raise
    except Exception as error:  # noqa: BLE001  # GDAL's, and rasterio's for types of samples that numpy lacks
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputFileError(f"{path}: not supported ({reason[:160]}); accepted: a GeoTIFF of heights") from None


def _require_samples(path: Path, source: Any) -> None:
    """Refuse a size before samples are read: a file of some kilobytes may state any."""
    rows, columns = source.height, source.width
    if rows < 2 or columns < 2 or rows * columns > MOST_SAMPLES:
        raise InputFileError(
            f"{path}: it has {columns} x {rows} samples; accepted: 2 x 2 to {MOST_SAMPLES} in all, so a part of it"
        )


def _void_of(source: Any) -> float | None:
    """The value of voids: as tagged, else the lowest one if no land lies there. Resampling would blend it with land."""
    if source.nodata is not None:
        return float(source.nodata)
    lowest = float(source.read(1).min())
    metres = (lowest * source.scales[0] + source.offsets[0]) * _metres_per_unit(source)
    return None if metres >= LOWEST_M else lowest


def _metres_per_unit(source: Any) -> float:
    return FEET.get((source.units[0] or "").lower(), 1.0)


def _tile(path: Path, source: Any) -> ElevationTile:
    _require_samples(path, source)
    rows, columns, transform = source.height, source.width, source.transform
    band = source.read(1, masked=True, out_dtype="float32").filled(nan)
    band = (band * source.scales[0] + source.offsets[0]) * _metres_per_unit(source)
    band[~((band >= LOWEST_M) & (band <= HIGHEST_M))] = nan
    heights: array[float] = array("f", band.astype("float32").tobytes())

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
        datum=_datum(source),
    )


def _datum(source: Any) -> str:
    """The datum by the description of the file's coordinate system; "" where that has no vertical part."""
    described = source.crs.to_wkt()
    return next((datum for name, datum in DATUMS.items() if name in described), "")
