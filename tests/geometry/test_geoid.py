"""The undulation against NGA's published values of EGM96."""

from __future__ import annotations

import hashlib
import struct
from importlib.resources import files

import numpy as np
import pytest

from fwav_companion.geoid import GRID, egm96
from fwav_companion.geometry.geoid_file import GtxGeoid

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


def gtx(heights: np.ndarray, south: float, west: float, step: float) -> bytes:
    return struct.pack(">ddddii", south, west, step, step, *heights.shape) + heights.astype(">f4").tobytes()


def test_geoid_of_a_file_is_bilinear_between_its_samples_and_round_the_globe() -> None:
    lats, lons = np.mgrid[-90:91:10, -180:180:10]
    geoid = GtxGeoid(gtx(0.1 * lats + 0.05 * lons, -90.0, -180.0, 10.0))
    assert geoid.undulation_m(47.3, 11.2) == pytest.approx(0.1 * 47.3 + 0.05 * 11.2, abs=1e-4)
    assert geoid.undulation_m(0.0, 179.0) == pytest.approx(0.05 * (170.0 * 0.1 - 180.0 * 0.9), abs=1e-4)
    part = GtxGeoid(gtx(np.array([[1.0, 2.0], [3.0, 999.0]]), 47.0, 11.0, 1.0))
    assert part.undulation_m(46.9, 11.5) is None
    assert part.undulation_m(47.5, 11.5) is None  # a sample that is no height


@pytest.mark.parametrize("content", [b"", b"x" * 40, gtx(np.zeros((3, 3)), 0.0, 0.0, 1.0)[:-1]])
def test_file_that_is_no_geoid_is_named(content: bytes) -> None:
    with pytest.raises(ValueError, match="accepted"):
        GtxGeoid(content)
