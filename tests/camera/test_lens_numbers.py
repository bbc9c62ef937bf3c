"""Lenses of extreme numbers: a lens is refused, or its rays have length 1."""

from math import hypot

import numpy as np
import pytest

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.kannala_brandt import KannalaBrandt

SIZE = (640, 480)
MIDDLE = (320.0, 240.0)
DRAWS = 300


def drawn(rng, usual):
    """The usual number, or one of any size and sign that a float can have."""
    if rng.random() < 0.6:
        return usual
    return float(
        rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(*rng.choice([(-3.0, 3.0), (-12.0, 12.0), (-308.0, 308.0)]))
    )


def fisheye(rng):
    k = [drawn(rng, usual) for usual in (2.0, -0.05, 0.01, -0.005, 0.001)]
    return KannalaBrandt(k, (drawn(rng, 200.0), drawn(rng, 200.0)), (drawn(rng, 320.0), drawn(rng, 240.0)), SIZE)


def rectilinear(rng):
    terms = [drawn(rng, usual) for usual in (0.1, -0.2, 0.001, 0.002, 0.05)]
    return BrownConrady((drawn(rng, 460.0), drawn(rng, 460.0)), (drawn(rng, 320.0), drawn(rng, 240.0)), terms, SIZE)


@pytest.mark.parametrize("lens_of", [fisheye, rectilinear])
def test_lens_of_extreme_numbers_is_refused_or_has_unit_rays(lens_of):
    rng = np.random.default_rng(20261127)
    accepted = rays = 0
    for _ in range(DRAWS):
        try:
            lens = lens_of(rng)
        except ValueError:
            continue
        accepted += 1
        for pixel in ((0.0, 0.0), MIDDLE, (639.0, 479.0)):
            ray = lens.camera_ray_from_pixel(*pixel)
            if isinstance(ray, tuple):
                rays += 1
                assert hypot(*ray) == pytest.approx(1.0, abs=1e-9)
    assert 0 < accepted < DRAWS
    assert rays > 0


@pytest.mark.parametrize("k", [(3.55, 1e100), (2.0, 1.2e252), (1e-200,), (1e300,)])
def test_fisheye_of_numbers_that_no_lens_has_is_refused(k):
    with pytest.raises(ValueError, match="must be"):
        KannalaBrandt(k, (200.0, 200.0), MIDDLE, SIZE)
