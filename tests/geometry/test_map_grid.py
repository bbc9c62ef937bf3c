"""UTM against PROJ, MGRS against published references."""

from __future__ import annotations

import random

import pytest

from fwav_companion.geometry.map_grid import convergence_deg, utm_from_degrees


def test_utm_anywhere_agrees_with_proj() -> None:
    warp = pytest.importorskip("rasterio.warp")
    rng = random.Random(3)
    for _ in range(60):
        lat, lon = rng.uniform(-79, 55), rng.uniform(-180, 180)
        found = utm_from_degrees(lat, lon)
        (x,), (y,) = warp.transform("EPSG:4326", f"EPSG:{(32600 if lat >= 0 else 32700) + found.zone}", [lon], [lat])
        assert (found.easting_m, found.northing_m) == pytest.approx((x, y), abs=1e-4)


@pytest.mark.parametrize(
    ("lat", "lon", "mgrs"),
    [
        (48.8584, 2.2945, "31U DQ 48252 11954"),  # Paris, Eiffel tower
        (-33.8568, 151.2153, "56H LH 34900 52288"),  # Sydney, opera
        (38.8977, -77.0365, "18S UJ 23394 07395"),  # Washington, White House
        (60.39, 5.32, "32V KN 97230 00510"),  # Bergen: the zone of Norway
        (78.2, 15.6, "33X WG 13696 80760"),  # Svalbard
    ],
)
def test_mgrs_of_known_places_is_their_reference(lat: float, lon: float, mgrs: str) -> None:
    assert utm_from_degrees(lat, lon).mgrs() == mgrs


def test_utm_near_the_pole_is_not_defined() -> None:
    assert utm_from_degrees(84.5, 0.0) is None


def test_convergence_east_of_the_meridian_in_the_north_is_clockwise() -> None:
    assert convergence_deg(48.0, 12.0, 9.0) == pytest.approx(2.23, abs=0.01)
