"""Elevation models between their samples and across their seams, against scipy's interpolation and one whole tile."""

from math import isnan, nan

import numpy as np
import pytest
from made_up_terrain import from_array

from fwav_companion.localization import ElevationModel


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

    def test_one_tile_may_cross_the_antimeridian(self):
        model = ElevationModel([from_array(self.whole, 10.0, 179.9, 0.01)])
        assert model.height_m(9.95, 179.985) == pytest.approx(np.mean(self.whole[5, 8:10]), abs=1e-5)
        assert model.height_m(9.95, -179.985) == pytest.approx(np.mean(self.whole[5, 11:13]), abs=1e-5)
        assert model.height_m(9.95, 180.015) == pytest.approx(np.mean(self.whole[5, 11:13]), abs=1e-5)
