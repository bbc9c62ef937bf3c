"""WGS84 and the tangent plane against pymap3d: everywhere, the antimeridian and high latitudes included."""

from math import cos, degrees, hypot, radians, sin

import pymap3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.geometry.earth import Geodetic, TangentPlane, ecef_from_geodetic, geodetic_from_ecef

PLACES = [
    (47.3977, 8.5456, 488.0),
    (0.0, 0.0, 0.0),
    (-54.5, -68.5, 600.0),
    (10.0, 179.9999, 20.0),
    (10.0, -180.0, 20.0),
    (84.9, 30.0, 3000.0),
    (-89.0, 100.0, 2800.0),
]
places = pytest.mark.parametrize("place", PLACES)


@places
def test_earth_centred_coordinates(place):
    lat, lon, height = place
    assert ecef_from_geodetic(radians(lat), radians(lon), height) == pytest.approx(
        pymap3d.geodetic2ecef(*place), abs=1e-6
    )
    found = geodetic_from_ecef(*ecef_from_geodetic(radians(lat), radians(lon), height))
    assert (degrees(found[0]), found[2]) == pytest.approx((lat, height), abs=1e-8)


@pytest.mark.parametrize("height_m", [-400.0, 9000.0, 1e5])
def test_a_latitude_comes_back_to_rounding_error(height_m):
    """One iteration of Bowring's formula leaves 1e-13 rad at 9 km of height."""
    for k in range(-89, 90):
        lat = radians(k + 0.3)
        assert geodetic_from_ecef(*ecef_from_geodetic(lat, 1.0, height_m))[0] == pytest.approx(lat, rel=0, abs=1e-15)


@places
@pytest.mark.parametrize(("north", "east"), [(0.0, 0.0), (100.0, -30.0), (-5000.0, 7000.0), (9000.0, 4000.0)])
@pytest.mark.parametrize("up", [0.0, 120.0, -15.0])
def test_local_coordinates_both_ways(place, north, east, up):
    """North and east as geodetic-to-NED has them at the origin's height, whatever the point's own; below 1 mm."""
    lat, lon, height = place
    plane = TangentPlane(Geodetic.from_degrees(lat, lon, height))

    found = plane.geodetic_from_ned((north, east, -up))

    n, e, _ = pymap3d.geodetic2ned(found.lat_deg, found.lon_deg, height, lat, lon, height)
    assert (n, e) == pytest.approx((north, east), abs=1e-3)
    assert found.alt_amsl_m == pytest.approx(height + up, abs=1e-9)
    assert plane.ned_from_geodetic(found) == pytest.approx((north, east, -up), abs=1e-4)
    assert -180.0 <= found.lon_deg < 180.0


@settings(derandomize=True, max_examples=200, deadline=None)
@given(
    st.floats(-85.0, 85.0),
    st.floats(-180.0, 180.0),
    st.floats(-400.0, 9000.0),
    st.floats(-1e4, 1e4),
    st.floats(-1e4, 1e4),
)
def test_round_trip_anywhere(lat, lon, height, north, east):
    if hypot(north, east) > 1e4:
        return
    plane = TangentPlane(Geodetic.from_degrees(lat, lon, height))
    ned = (north, east, -3.0)
    assert plane.ned_from_geodetic(plane.geodetic_from_ned(ned)) == pytest.approx(ned, abs=1e-3)


@places
@pytest.mark.parametrize("azimuth_deg", [20.0, 160.0, 245.0])
@pytest.mark.parametrize(
    ("distance_m", "steps"), [(1e4, 2), (1e5, 3), (3e5, 4)], ids=["2 steps: 10 km", "3: 100 km", "4: 300 km"]
)
def test_every_step_of_the_inverse_counts(place, azimuth_deg, distance_m, steps):
    """A step reduces the error by the factor (distance / earth radius)^2. With one step less the error is 80 um at
    10 km, 10 um at 100 km and 3 um at 300 km."""
    lat, lon, height = place
    plane = TangentPlane(Geodetic.from_degrees(lat, lon, height))
    ned = (distance_m * cos(radians(azimuth_deg)), distance_m * sin(radians(azimuth_deg)), 0.0)
    found = plane.geodetic_from_ned(ned)
    n, e, _ = pymap3d.geodetic2ned(found.lat_deg, found.lon_deg, height, lat, lon, height)
    assert (n, e) == pytest.approx(ned[:2], abs=1e-6), f"{steps} steps are not enough"


def test_a_step_across_the_antimeridian_is_a_small_one():
    plane = TangentPlane(Geodetic.from_degrees(10.0, 179.9999, 0.0))
    _, east, _ = plane.ned_from_geodetic(Geodetic.from_degrees(10.0, -179.9999, 0.0))
    assert east == pytest.approx(0.0002 * 111_320.0 * cos(radians(10.0)), rel=1e-2)


def test_a_points_own_altitude_moves_it_neither_north_nor_east():
    plane = TangentPlane(Geodetic.from_degrees(47.0, 8.0, 500.0))
    low, high = (plane.ned_from_geodetic(Geodetic.from_degrees(47.05, 8.05, alt)) for alt in (0.0, 4000.0))
    assert low[:2] == high[:2]
    assert (low[2], high[2]) == (500.0, -3500.0)
