"""Elevation files, written by rasterio or by hand, against rasterio's own reading of them."""

from math import isnan

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from fwav_companion.errors import InputFileError
from fwav_companion.localization import ElevationModel
from fwav_companion.service.elevation_files import read_elevation

pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # rasterio's own use of affine

STEP = 1.0 / 3600.0


class TestFiles:
    heights = np.random.default_rng(5).integers(-50, 900, (40, 30)).astype(np.int16)

    def write(self, path, *, point=False, crs="EPSG:4326", transform=None, nodata=-32768, data=None):
        data = self.heights if data is None else data
        profile = {"driver": "GTiff", "height": data.shape[0], "width": data.shape[1], "count": 1, "dtype": data.dtype}
        transform = transform or from_origin(8.0, 47.0, STEP, STEP)
        with (
            rasterio.Env(GTIFF_POINT_GEO_IGNORE="TRUE" if point else "FALSE"),  # the tie point as written
            rasterio.open(path, "w", crs=crs, transform=transform, nodata=nodata, **profile) as out,
        ):
            out.write(data, 1)
            out.update_tags(AREA_OR_POINT="Point" if point else "Area")
        return path

    def test_area_and_point_differ_by_half_a_pixel(self, tmp_path):
        area, point = read_elevation([self.write(tmp_path / "a.tif"), self.write(tmp_path / "p.tif", point=True)])
        assert (area.north_deg, area.west_deg) == pytest.approx((47.0 - STEP / 2, 8.0 + STEP / 2), abs=1e-10)
        assert (point.north_deg, point.west_deg) == pytest.approx((47.0, 8.0), abs=1e-10)
        assert area.height_m(7, 11) == point.height_m(7, 11) == self.heights[7, 11]

    def test_samples_lie_where_rasterio_says(self, tmp_path):
        path = self.write(tmp_path / "a.tif")
        model = ElevationModel(read_elevation([path]))
        with rasterio.open(path) as source:
            for row, column in [(0, 0), (39, 29), (17, 4)]:
                lon, lat = source.xy(row, column)
                assert model.height_m(lat, lon) == pytest.approx(self.heights[row, column], abs=1e-4)

    def test_voids_of_a_geotiff(self, tmp_path):
        data = self.heights.copy()
        data[3, 3] = -32768
        (read,) = read_elevation([self.write(tmp_path / "v.tif", data=data)])
        assert isnan(read.height_m(3, 3))

    def test_a_model_in_metres_is_brought_to_degrees(self, tmp_path):
        """A drone's own model in UTM: a plane that rises to the east must still do so."""
        columns = np.tile(np.arange(200, dtype=np.float32), (200, 1))
        path = self.write(
            tmp_path / "utm.tif", crs="EPSG:32632", transform=from_origin(460000.0, 5250000.0, 1.0, 1.0), data=columns
        )
        from rasterio.warp import transform

        model = ElevationModel(read_elevation([path]))
        for east, south in [(30.5, 50.5), (100.5, 100.5), (170.5, 20.5)]:
            (lon,), (lat,) = transform("EPSG:32632", "EPSG:4326", [460000.0 + east], [5250000.0 - south])
            assert model.height_m(lat, lon) == pytest.approx(east - 0.5, abs=0.3)

    @pytest.mark.parametrize(("name", "south", "west"), [("N47E008.hgt", 47, 8), ("s55w069.SRTMGL1.hgt", -55, -69)])
    def test_an_hgt_begins_in_its_north_west_and_is_named_by_its_south_west(self, tmp_path, name, south, west):
        side = 1201
        rows, columns = np.mgrid[0:side, 0:side]
        data = (rows * 2 + columns).astype(">i2")
        data[5, 6] = -32768
        (tmp_path / name).write_bytes(data.tobytes())

        (read,) = read_elevation([tmp_path / name])

        model = ElevationModel([read])
        assert model.height_m(south + 1, west) == 0.0
        assert model.height_m(south, west) == pytest.approx(2400.0, abs=1e-6)
        assert model.height_m(south, west + 1) == pytest.approx(3600.0, abs=1e-6)
        assert model.height_m(south + 0.5, west + 0.25) == pytest.approx(1200.0 + 300.0, abs=1e-6)
        assert isnan(read.height_m(5, 6))
        with rasterio.open(tmp_path / name) as source:
            lon, lat = source.xy(700, 300)
            assert model.height_m(lat, lon) == pytest.approx(float(data[700, 300]), abs=1e-3)

    @pytest.mark.parametrize(
        ("name", "content", "says"),
        [
            ("N47E008.hgt", b"123", "square of 16-bit samples"),
            ("N47E008.hgt", b"", "square of 16-bit samples"),
            ("alps.hgt", b"\0" * 8, "N47E008.hgt"),
            ("model.tif", b"no tiff", "model.tif"),
            ("model.dt2", b"", ".hgt, .tif and .tiff"),
            (None, None, "missing.tif"),
        ],
    )
    def test_what_is_no_elevation_file_is_refused(self, tmp_path, name, content, says):
        path = tmp_path / (name or "missing.tif")
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputFileError, match=str(path.name)) as refusal:
            read_elevation([path])
        assert says in str(refusal.value)

    def test_a_file_without_a_place_is_refused(self, tmp_path):
        with pytest.raises(InputFileError, match="coordinate system"):
            read_elevation([self.write(tmp_path / "a.tif", crs=None)])

    def test_a_missing_hgt_is_refused(self, tmp_path):
        with pytest.raises(InputFileError, match="No such file"):
            read_elevation([tmp_path / "N47E008.hgt"])
