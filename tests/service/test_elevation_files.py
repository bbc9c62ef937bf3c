"""Elevation files, written by rasterio or by hand, against rasterio's own reading of them."""

from contextlib import suppress
from math import isnan
from zipfile import ZIP_BZIP2, ZIP_DEFLATED, ZIP_LZMA, ZipFile

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
            ("model.xyz", b"", ".hgt, .hgt.zip, .tif, .tiff, .dt0, .dt1 and .dt2"),
            ("model.dt2", b"", "accepted"),
            ("N47E008.hgt.zip", b"PK", "broken zip"),
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

    @pytest.mark.parametrize("void", [-32768, -9999, 9999, -600])
    def test_geotiff_with_untagged_voids_has_no_ground_there(self, tmp_path, void):
        data = self.heights.copy()
        data[3, 3] = void
        (read,) = read_elevation([self.write(tmp_path / "v.tif", data=data, nodata=None)])
        assert isnan(read.height_m(3, 3))
        assert read.height_m(3, 4) == data[3, 4]

    def test_projected_model_with_untagged_voids_blends_none_into_the_land(self, tmp_path):
        data = np.full((200, 200), 300.0, dtype=np.float32)
        data[100, 100] = -9999.0
        transform = from_origin(460000.0, 5250000.0, 1.0, 1.0)
        path = self.write(tmp_path / "u.tif", crs="EPSG:32632", transform=transform, data=data, nodata=None)
        (read,) = read_elevation([path])
        heights = [read.height_m(row, column) for row in range(read.rows) for column in range(read.columns)]
        known = [height for height in heights if not isnan(height)]
        assert min(known) == pytest.approx(300.0, abs=1e-3)

    def test_hgt_with_untagged_voids_has_no_ground_there(self, tmp_path):
        data = np.full((1201, 1201), 300, dtype=">i2")
        data[5, 6], data[5, 7] = -9999, 9999
        (tmp_path / "N47E008.hgt").write_bytes(data.tobytes())
        (read,) = read_elevation([tmp_path / "N47E008.hgt"])
        assert isnan(read.height_m(5, 6))
        assert isnan(read.height_m(5, 7))
        assert read.height_m(5, 8) == 300.0

    @pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("metre", 1.0), ("US survey foot", 1200 / 3937)])
    def test_geotiff_with_scale_offset_and_unit_is_read_in_metres(self, tmp_path, unit, metres):
        path = self.write(tmp_path / "f.tif", data=np.abs(self.heights))
        with rasterio.open(path, "r+") as out:
            out.scales, out.offsets, out.units = (0.5,), (100.0,), (unit,)
        (read,) = read_elevation([path])
        assert read.height_m(7, 11) == pytest.approx((abs(int(self.heights[7, 11])) * 0.5 + 100.0) * metres, abs=1e-3)

    def test_zipped_hgt_is_read_as_the_file_in_it(self, tmp_path):
        data = np.arange(1201 * 1201, dtype=np.int64) % 900
        with ZipFile(tmp_path / "N47E008.hgt.zip", "w") as archive:
            archive.writestr("N47E008.hgt", data.astype(">i2").tobytes())
        (read,) = read_elevation([tmp_path / "N47E008.hgt.zip"])
        assert (read.height_m(0, 5), read.height_m(1200, 1200)) == (5.0, float(data[-1]))

    @pytest.mark.parametrize("method", [ZIP_DEFLATED, ZIP_BZIP2, ZIP_LZMA])
    def test_zipped_hgt_with_any_one_byte_damaged_is_read_or_is_refused(self, tmp_path, method):
        path = tmp_path / "N47E008.hgt.zip"
        with ZipFile(path, "w", method) as archive:
            archive.writestr("N47E008.hgt", bytes(range(8)))
        content = path.read_bytes()
        for at in range(len(content)):
            path.write_bytes(content[:at] + bytes([content[at] ^ 0x55]) + content[at + 1 :])
            with suppress(InputFileError):
                read_elevation([path])

    def test_zipped_hgt_whose_name_is_not_the_utf_8_that_it_claims_is_refused(self, tmp_path):
        path = tmp_path / "N47E008.hgt.zip"
        with ZipFile(path, "w") as archive:
            archive.writestr("ä47E008.hgt", bytes(8))
        path.write_bytes(path.read_bytes().replace("ä".encode(), b"\xff\xff"))
        with pytest.raises(InputFileError, match="a broken zip file"):
            read_elevation([path])

    def test_dted_is_read_from_its_north_west(self, tmp_path):
        data = (np.arange(121)[:, None] * 2 + np.arange(121)[None, :] - 100).astype(np.int16)
        step = 1.0 / 120.0
        transform = from_origin(8.0 - step / 2, 48.0 + step / 2, step, step)
        profile = {"driver": "DTED", "height": 121, "width": 121, "count": 1, "dtype": "int16", "crs": "EPSG:4326"}
        with rasterio.open(tmp_path / "n47.dt0", "w", transform=transform, **profile) as out:
            out.write(data, 1)
        model = ElevationModel(read_elevation([tmp_path / "n47.dt0"]))
        assert model.height_m(48.0 - 60 * step, 8.0 + 30 * step) == pytest.approx(50.0, abs=0.01)
        assert model.height_m(48.0 - 10 * step, 8.0 + 20 * step) == pytest.approx(-60.0, abs=0.01)

    def test_of_several_files_the_finest_counts(self, tmp_path):
        coarse = self.write(tmp_path / "c.tif", data=np.full((40, 40), 100, dtype=np.int16))
        fine = self.write(
            tmp_path / "f.tif", data=np.full((100, 100), 200, dtype=np.int16),
            transform=from_origin(8.001, 46.999, STEP / 10, STEP / 10),
        )  # fmt: skip
        for order in ([coarse, fine], [fine, coarse]):
            model = ElevationModel(read_elevation(order))
            assert model.height_m(46.998, 8.002) == 200.0
            assert model.height_m(46.992, 8.008) == 100.0

    @pytest.mark.parametrize(
        ("crs", "datum"), [("EPSG:4326", ""), ("EPSG:4326+3855", "egm2008"), ("EPSG:4326+5773", "egm96")]
    )
    def test_datum_is_that_of_the_file_s_vertical_system(self, tmp_path, crs, datum):
        (read,) = read_elevation([self.write(tmp_path / "a.tif", crs=crs)])
        assert read.datum == datum

    def test_a_file_without_a_place_is_refused(self, tmp_path):
        with pytest.raises(InputFileError, match="coordinate system"):
            read_elevation([self.write(tmp_path / "a.tif", crs=None)])

    def test_a_missing_hgt_is_refused(self, tmp_path):
        with pytest.raises(InputFileError, match="No such file"):
            read_elevation([tmp_path / "N47E008.hgt"])
