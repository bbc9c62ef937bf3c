"""The undulation against NGA's published values of EGM96."""

from __future__ import annotations

import hashlib
from importlib.resources import files

import pytest

from fwav_companion.geoid import GRID, egm96

NGA = [  # NGA, EGM96 test values: latitude, longitude, undulation
    (38.628155, 269.779155, -31.628),
    (-14.621217, 305.021114, -2.969),
    (46.874319, 102.448729, -43.575),
    (-23.617446, 133.874712, 15.871),
    (38.625473, 359.9995, 50.066),
    (-0.466744, 0.0023, 17.329),
]


@pytest.mark.parametrize(("lat", "lon", "undulation_m"), NGA)
def test_undulation_at_nga_places_is_the_published_value(lat: float, lon: float, undulation_m: float) -> None:
    assert egm96().undulation_m(lat, lon) == pytest.approx(undulation_m, abs=0.012)  # bicubic on 15 minutes: 0.011 m
    assert egm96().undulation_m(lat, lon - 360.0) == pytest.approx(undulation_m, abs=0.012)


def test_undulation_at_poles_and_across_greenwich_is_continuous() -> None:
    geoid = egm96()
    for lat in (90.0, -90.0):
        values = [geoid.undulation_m(lat, lon) for lon in (0.0, 77.0, -180.0)]
        assert values == pytest.approx([values[0]] * 3, abs=0.02)
    assert geoid.undulation_m(47.0, -1e-7) == pytest.approx(geoid.undulation_m(47.0, 1e-7), abs=1e-4)
    assert geoid.undulation_m(47.0, 180.0) == pytest.approx(geoid.undulation_m(47.0, -180.0), abs=1e-9)


def test_grid_is_the_one_that_the_licence_names() -> None:
    package = files("fwav_companion.geoid")
    digest = hashlib.sha256(package.joinpath(GRID).read_bytes()).hexdigest()
    assert digest in package.joinpath("EGM96.LICENSE").read_text()
