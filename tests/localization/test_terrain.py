"""Elevation models: lattice and seams against rasterio, the ray search against tiny steps, the ground's honesty."""

from math import cos, degrees, inf, isnan, nan, radians, sin

import msgspec
import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from rasterio.transform import from_origin
from true_flights import PRIORS, STEPS, Scene

from fwav_companion.errors import InputFileError
from fwav_companion.files.terrain import read_elevation
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.localization import Datum, ElevationModel, ElevationTile, Localizer, TerrainGround
from fwav_companion.localization.ray_search import first_hit
from fwav_companion.nouns import Bias, NoFix, Reason

pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # rasterio's own use of affine

STEP = 1.0 / 3600.0
LAT, LON = 47.5, 8.5
PLANE = TangentPlane(Geodetic.from_degrees(LAT, LON, 500.0))


def tile(height, rows=121, columns=121, north=LAT + 60 * STEP, west=LON - 60 * STEP, step=STEP) -> ElevationTile:
    """Of a function of (row, column)."""
    return ElevationTile(north, west, step, step, rows, columns, lambda i, j: float(height(i, j)), "made up")


def from_array(heights: np.ndarray, north: float, west: float, step: float = STEP) -> ElevationTile:
    return ElevationTile(north, west, step, step, *heights.shape, lambda i, j: float(heights[i, j]), "array")


def direction(elevation_deg: float, azimuth_deg: float) -> tuple[float, float, float]:
    e, a = radians(elevation_deg), radians(azimuth_deg)
    return (cos(e) * cos(a), cos(e) * sin(a), sin(e))


class TestLattice:
    heights = np.random.default_rng(1).uniform(300.0, 900.0, (9, 12))
    model = ElevationModel([from_array(heights, 47.0, 8.0, 0.01)])

    def test_samples_come_back(self):
        for i in range(9):
            for j in range(12):
                assert self.model.height_m(47.0 - 0.01 * i, 8.0 + 0.01 * j) == pytest.approx(
                    self.heights[i, j], abs=1e-6
                )

    def test_between_samples_it_is_bilinear(self):
        from scipy.interpolate import RegularGridInterpolator

        exact = RegularGridInterpolator((np.arange(9), np.arange(12)), self.heights)
        for row, column in np.random.default_rng(2).uniform((0, 0), (8, 11), (50, 2)):
            found = self.model.height_m(47.0 - 0.01 * row, 8.0 + 0.01 * column)
            assert found == pytest.approx(exact((row, column)).item(), abs=1e-6)

    @pytest.mark.parametrize(("lat", "lon"), [(47.001, 8.0), (46.91, 8.0), (47.0, 7.99), (47.0, 8.12), (-47.0, 8.0)])
    def test_outside_there_is_nothing(self, lat, lon):
        assert isnan(self.model.height_m(lat, lon))

    def test_a_void_takes_its_cells_with_it(self):
        heights = self.heights.copy()
        heights[4, 4] = nan
        model = ElevationModel([from_array(heights, 47.0, 8.0, 0.01)])
        assert isnan(model.height_m(46.9601, 8.0399))
        assert model.height_m(46.985, 8.035) == pytest.approx(self.model.height_m(46.985, 8.035))


class TestSeams:
    whole = np.random.default_rng(3).uniform(100.0, 200.0, (21, 21))

    def check(self, tiles):
        one, many = ElevationModel([from_array(self.whole, 47.0, 8.0, 0.01)]), ElevationModel(tiles)
        for row, column in np.random.default_rng(4).uniform(0.0, 20.0, (300, 2)):
            place = (47.0 - 0.01 * row, 8.0 + 0.01 * column)
            assert many.height_m(*place) == pytest.approx(one.height_m(*place), abs=1e-5)

    def test_tiles_that_share_their_edges_as_srtm_does(self):
        self.check([
            from_array(self.whole[:11, :11], 47.0, 8.0, 0.01),
            from_array(self.whole[:11, 10:], 47.0, 8.1, 0.01),
            from_array(self.whole[10:, :11], 46.9, 8.0, 0.01),
            from_array(self.whole[10:, 10:], 46.9, 8.1, 0.01),
        ])  # fmt: skip

    def test_tiles_that_share_nothing_as_copernicus_has_them(self):
        self.check([
            from_array(self.whole[:11, :11], 47.0, 8.0, 0.01),
            from_array(self.whole[:11, 11:], 47.0, 8.11, 0.01),
            from_array(self.whole[11:, :11], 46.89, 8.0, 0.01),
            from_array(self.whole[11:, 11:], 46.89, 8.11, 0.01),
        ])  # fmt: skip

    def test_across_the_antimeridian(self):
        left = from_array(self.whole[:, :11], 10.0, 179.9, 0.01)
        right = from_array(self.whole[:, 10:], 10.0, -180.0, 0.01)
        model = ElevationModel([left, right])
        assert model.height_m(9.95, 179.985) == pytest.approx(np.mean(self.whole[5, 8:10]), abs=1e-5)
        assert model.height_m(9.95, -179.985) == pytest.approx(np.mean(self.whole[5, 11:13]), abs=1e-5)
        assert model.height_m(9.95, 179.999999999) == pytest.approx(self.whole[5, 10], abs=1e-3)


class TestFiles:
    heights = np.random.default_rng(5).integers(-50, 900, (40, 30)).astype(np.int16)

    def write(self, path, *, point=False, crs="EPSG:4326", transform=None, nodata=-32768, data=None):
        data = self.heights if data is None else data
        profile = {"driver": "GTiff", "height": data.shape[0], "width": data.shape[1], "count": 1, "dtype": data.dtype}
        transform = transform or from_origin(8.0, 47.0, STEP, STEP)
        with (
            rasterio.Env(GTIFF_POINT_GEO_IGNORE="TRUE" if point else "FALSE"),  # the tie point as it is told
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
        """A drone's own model in UTM: a plane that rises to the east must do so still."""
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


class TestRaySearch:
    def brute_force(self, model, start, ray, reach_m, step_m=0.25) -> float:
        """Small steps: the first one that is under ground."""
        for s in np.arange(0.0, reach_m, step_m):
            place = PLANE.geodetic_from_ned(tuple(np.add(start, np.multiply(ray, s))))
            ground = model.height_m(place.lat_deg, place.lon_deg)
            if isnan(ground):
                return inf
            if place.alt_amsl_m <= ground:
                return s
        return inf

    @settings(derandomize=True, max_examples=25, deadline=None)
    @given(
        seed=st.integers(0, 10),
        elevation=st.floats(3.0, 89.9),
        azimuth=st.floats(0.0, 360.0),
        height=st.floats(60.0, 150.0),
    )
    def test_it_finds_what_small_steps_find(self, seed, elevation, azimuth, height):
        bumps = np.random.default_rng(seed).uniform(480.0, 540.0, (121, 121))
        model = ElevationModel([from_array(bumps, LAT + 60 * STEP, LON - 60 * STEP)])
        start, ray = (10.0, 20.0, -height), direction(elevation, azimuth)

        expected = self.brute_force(model, start, ray, 1200.0, 0.5)
        hit = first_hit(model, PLANE, start, ray, 0.0)

        if expected == inf:
            assert hit is None or hit.distance_m > 1199.0
        else:
            assert hit.distance_m <= expected + 1e-3, "never beyond"
            end = PLANE.geodetic_from_ned(tuple(np.add(start, np.multiply(ray, hit.distance_m))))
            assert end.alt_amsl_m == pytest.approx(model.height_m(end.lat_deg, end.lon_deg), abs=0.01)
            # Earlier it may be, where small steps jump a crest that the ray grazes: then smaller ones meet it there.
            just_before = tuple(np.add(start, np.multiply(ray, hit.distance_m - 0.05)))
            assert self.brute_force(model, just_before, ray, 0.1, 0.001) < inf

    def test_a_ridge_one_sample_wide_is_not_stepped_over(self):
        """A wall 80 m high on level ground, 300 m north; a flat ray from 50 m up."""
        wall_row = 60 - round(300.0 / 30.87)
        model = ElevationModel([tile(lambda i, _: 580.0 if i == wall_row else 500.0)])
        hit = first_hit(model, PLANE, (0.0, 0.0, -50.0), direction(3.0, 0.0), 0.0)
        assert 250.0 < hit.distance_m < 320.0

    @pytest.mark.parametrize("azimuth", [0.0, 90.0, 180.0, 270.0, 45.0])
    def test_along_the_lattice_itself(self, azimuth):
        model = ElevationModel([tile(lambda *_: 500.0)])
        hit = first_hit(model, PLANE, (0.0, 0.0, -40.0), direction(30.0, azimuth), 0.0)
        assert hit.distance_m == pytest.approx(80.0, abs=1e-3)

    def test_straight_down(self):
        model = ElevationModel([tile(lambda *_: 500.0)])
        assert first_hit(model, PLANE, (0.0, 0.0, -40.0), (0.0, 0.0, 1.0), 0.0).distance_m == pytest.approx(40.0)

    def test_it_ends_at_the_edge_at_a_void_and_in_the_sky(self):
        level = tile(lambda *_: 500.0)
        holed = tile(lambda i, _: nan if i == 57 else 500.0)
        assert first_hit(ElevationModel([level]), PLANE, (0.0, 0.0, -40.0), direction(0.5, 0.0), 0.0) is None
        assert first_hit(ElevationModel([holed]), PLANE, (0.0, 0.0, -40.0), direction(20.0, 0.0), 0.0) is None
        assert first_hit(ElevationModel([level]), PLANE, (0.0, 0.0, -40.0), direction(-10.0, 0.0), 0.0) is None


class TestGround:
    level = ElevationModel([tile(lambda *_: 500.0)])
    slope = ElevationModel([tile(lambda i, j: 500.0 + 0.2 * 30.87 * (60 - i) - 0.1 * 20.86 * (j - 60))])
    """Rises by 0.2 to the north, falls by 0.1 to the east."""

    def ground(self, model, datum=Datum.EGM96, undulation=None) -> TerrainGround:
        ground = TerrainGround(model, datum)
        self.told = ground.placed(PLANE, PLANE.origin, undulation)
        return ground

    def locate(self, ground, sighting):
        return Localizer(ground, PRIORS, min_height_m=0.5).locate(sighting)

    def test_on_level_ground_it_agrees_with_home(self):
        scene = Scene(vehicle=(0.0, 0.0))
        fix = self.locate(self.ground(self.level), scene.sighting())
        assert fix.ground == "terrain"
        assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-3)
        jacobian = np.array(fix.bias_jacobian)
        north, east = scene.target
        assert jacobian[Bias.TERRAIN] == pytest.approx((-north / 40.0, -east / 40.0, -1.0), abs=1e-3)
        assert fix.level_sigma_m == 0.0
        assert fix.budget.terrain == pytest.approx(4.0 * np.hypot(north, east) / 40.0, rel=1e-3)

    def test_on_a_slope_every_column_agrees_with_differences(self):
        """The ground moves as the model says; the target is where an unbiased ray meets it."""
        ground = self.ground(self.slope)
        scene = Scene(vehicle=(0.0, 0.0), target=(12.0, 25.0))
        fix = self.locate(ground, scene.sighting())
        rays = np.array(scene.sighting().ned_from_camera) @ scene.sighting().ray.direction
        # by hand: z = -(0.2 n - 0.1 e) along (0, 0, -40) + s ray
        s = 40.0 / (rays[2] + 0.2 * rays[0] - 0.1 * rays[1])
        assert fix.position_ned == pytest.approx((s * rays[0], s * rays[1], -40.0 + s * rays[2]), abs=0.05)
        for bias in Bias:
            if bias is Bias.TERRAIN:
                continue
            step = STEPS[bias] * np.eye(12)[bias] * 100.0
            ahead, behind = (self.locate(ground, scene.sighting(sign * step)).position_ned for sign in (1.0, -1.0))
            found = np.subtract(ahead, behind) / (2.0 * STEPS[bias] * 100.0)
            assert fix.bias_jacobian[bias] == pytest.approx(found, rel=2e-3, abs=2e-2), bias.name
        up, down = (self.locate(self.raised(self.slope, h), scene.sighting()).position_ned for h in (0.5, -0.5))
        assert fix.bias_jacobian[Bias.TERRAIN] == pytest.approx(np.subtract(up, down), rel=1e-3, abs=1e-3)

    def raised(self, model, by_m) -> TerrainGround:
        ground = self.ground(model)
        ground._raised_m += by_m
        return ground

    def test_it_is_shifted_to_the_take_off_height_and_says_so(self):
        lower = ElevationModel([tile(lambda *_: 488.0)])
        ground = self.ground(lower)
        assert ground.shift_m == pytest.approx(12.0)
        assert "+12.0 m" in self.told
        assert "egm96" in self.told
        scene = Scene(vehicle=(0.0, 0.0))
        fix = self.locate(ground, scene.sighting())
        assert fix.position_ned == pytest.approx(scene.truth(), abs=1e-3), "the height too"

    def test_a_service_that_starts_in_flight_shifts_by_the_ground_at_home_not_below_the_vehicle(self):
        """The world's origin is where the vehicle was first heard: on a slope the ground there is another height."""
        home = Geodetic.from_degrees(LAT - 30.0 * STEP, LON, 500.0 - 0.2 * 30.87 * 30.0)
        ground = TerrainGround(self.slope, Datum.EGM96)
        ground.placed(TangentPlane(Geodetic.from_degrees(LAT, LON, home.alt_amsl_m)), home, None)
        assert ground.shift_m == pytest.approx(0.0, abs=1e-6)

    def test_a_model_of_another_datum_is_not_bent_to_fit(self):
        ground = self.ground(ElevationModel([tile(lambda *_: 547.0)]))  # ellipsoid heights taken for EGM96
        assert "+47.0 m" in self.told
        answer = self.locate(ground, Scene(vehicle=(0.0, 0.0)).sighting())
        assert answer == NoFix(Reason.TERRAIN_UNFIT)

    def test_ellipsoid_heights_need_the_undulation_and_take_it_with_the_right_sign(self):
        """H = h - N: 547 m over the ellipsoid, 47 m of undulation, are 500 m over the sea."""
        model, scene = ElevationModel([tile(lambda *_: 547.0)]), Scene(vehicle=(0.0, 0.0))
        without = self.ground(model, Datum.ELLIPSOID)
        assert self.locate(without, scene.sighting()) == NoFix(Reason.NO_HEIGHT)
        ground = self.ground(model, Datum.ELLIPSOID, 47.0)
        assert ground.shift_m == pytest.approx(0.0, abs=1e-6)
        assert self.locate(ground, scene.sighting()).position_ned == pytest.approx(scene.truth(), abs=1e-3)

    def test_a_take_off_outside_the_model_leaves_it_as_it_is(self):
        far = TerrainGround(self.level, Datum.EGM96)
        away = TangentPlane(Geodetic.from_degrees(10.0, 10.0, 100.0))
        told = far.placed(away, away.origin, None)
        assert "outside" in told
        assert far.shift_m == 0.0

    def test_refusals(self):
        ground, scene = self.ground(self.level), Scene(vehicle=(0.0, 0.0))
        assert self.locate(TerrainGround(self.level, Datum.EGM96), scene.sighting()) == NoFix(Reason.NO_POSITION)
        away = Scene(vehicle=(5000.0, 0.0)).sighting()
        assert self.locate(ground, away) == NoFix(Reason.BEYOND_TERRAIN)
        under = msgspec.structs.replace(scene.sighting(), camera_ned=(0.0, 0.0, 3.0))
        assert self.locate(ground, under) == NoFix(Reason.TOO_LOW)
        nowhere = Scene(relative=True).sighting()
        assert self.locate(ground, nowhere) == NoFix(Reason.NO_HEIGHT)

    def test_behind_a_crest_no_ellipse_tells_the_truth(self):
        """The ray grazes a wall's top: a little lower it ends there, a little higher far behind."""
        wall_row = 60 - 4
        walled = self.ground(ElevationModel([tile(lambda i, _: 522.0 if i == wall_row else 500.0)]))
        target = (290.0, 0.0)
        sighting = Scene(
            roll_deg=0.0, pitch_deg=60.0, yaw_deg=0.0, vehicle=(0.0, 0.0), target=target, pixel_sigma=(1.0, 1.0)
        ).sighting()
        quiet = msgspec.structs.replace(PRIORS, bias_sigmas=tuple(0.1 * s for s in PRIORS.bias_sigmas))
        over_level = Localizer(self.ground(self.level), quiet, min_height_m=0.5).locate(sighting)
        over_wall = Localizer(walled, quiet, min_height_m=0.5).locate(sighting)
        assert not isinstance(over_level, NoFix)
        assert over_wall == NoFix(Reason.TOO_SHALLOW)

    def test_terrain_report_is_a_ground_where_there_are_no_files(self):
        scene = Scene(vehicle=(0.0, 0.0))
        for sighting in (scene.sighting(), Scene(relative=True).sighting()):
            reported = msgspec.structs.replace(
                sighting, state=msgspec.structs.replace(sighting.state, terrain_height_m=40.0)
            )
            fix = self.locate(TerrainGround(None, Datum.EGM96), reported)
            assert fix.ground == "terrain"
            assert fix.position_ned == pytest.approx((12.0, 25.0, 0.0), abs=1e-9)
            assert fix.budget.terrain > 1.0
            assert self.locate(TerrainGround(None, Datum.EGM96), sighting) == NoFix(Reason.NO_HEIGHT)

    def test_degrees_of_the_plane_are_those_of_the_model(self):
        assert degrees(PLANE.origin.lat) == pytest.approx(LAT)
