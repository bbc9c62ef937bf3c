"""Where a ray first meets an elevation model, against tiny steps."""

from math import inf, isnan, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_terrain import LAT, LON, PLANE, STEP, direction, from_array, tile

from fwav_companion.localization import ElevationModel
from fwav_companion.localization.ray_search import _first_descent, _unwrapped, first_hit


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
        holed = tile(lambda i, _: nan if 55 <= i <= 58 else 500.0)
        assert first_hit(ElevationModel([level]), PLANE, (0.0, 0.0, -40.0), direction(0.5, 0.0), 0.0) is None
        assert first_hit(ElevationModel([holed]), PLANE, (0.0, 0.0, -40.0), direction(20.0, 0.0), 0.0) is None
        assert first_hit(ElevationModel([level]), PLANE, (0.0, 0.0, -40.0), direction(-10.0, 0.0), 0.0) is None


@pytest.mark.parametrize("seed", range(200))
def test_the_first_descent_is_the_first_root_in_the_interval(seed):
    """Against numpy's roots, for heights that begin above the surface."""
    rng = np.random.default_rng(seed)
    p, q, r = rng.uniform(0.1, 5.0), *rng.normal(0.0, 5.0, 2)
    at, end = sorted(rng.uniform(0.0, 1.0, 2))
    below = p + q * at + r * at * at <= 0.0
    roots = [root.real for root in np.roots([r, q, p]) if abs(root.imag) < 1e-9 and at <= root.real <= end]
    expected = at if below else min(roots, default=None)
    found = _first_descent(p, q, r=r, at=at, end=end)
    assert (found is None) is (expected is None)
    if expected is not None:
        assert found == pytest.approx(expected)


@pytest.mark.parametrize(("q", "expected"), [(-2.0, 0.5), (-0.5, None), (2.0, None), (0.0, None)])
def test_over_a_level_cell_the_descent_is_linear(q, expected):
    assert _first_descent(1.0, q, r=0.0, at=0.0, end=1.0) == expected


def test_where_the_ray_only_touches_there_is_one_root():
    assert _first_descent(1.0, -4.0, r=4.0, at=0.0, end=1.0) == pytest.approx(0.5)
    assert _first_descent(1.0, -4.0, r=4.0, at=0.6, end=1.0) is None


@pytest.mark.parametrize(
    ("lon", "near", "expected"),
    [(10.0, 20.0, 10.0), (-179.9, 179.9, 180.1), (179.9, -179.9, -180.1), (350.0, 1.0, -10.0), (181.0, 1.0, -179.0)],
)
def test_a_longitude_is_unwrapped_to_within_half_a_turn(lon, near, expected):
    assert _unwrapped(lon, near) == pytest.approx(expected)


def test_ray_over_the_edge_between_two_coarse_tiles_is_followed():
    """Steps of 900 m: the margin of a tile is a millimetre, thousands of the least steps."""
    step = 1.0 / 120.0
    tiles = [
        tile(lambda *_: 500.0, rows=3, columns=3, north=LAT + north * step, west=LON, step=step) for north in (0, 2)
    ]
    from_south = (-30.0, 400.0, -40.0)
    hit = first_hit(ElevationModel(tiles), PLANE, from_south, direction(30.0, 0.0), 0.0)
    assert hit is not None
    assert hit.distance_m == pytest.approx(80.0, abs=0.01)
