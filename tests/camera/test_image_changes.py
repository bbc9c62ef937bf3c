"""A resized or cropped image shows the same world: truth is where each sample of the new image lay in the old one."""

import numpy as np
import pytest
from camera_lenses import LENSES

from fwav_companion.camera import cropped, resized
from fwav_companion.types import NoRay

CHANGEABLE = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())


@CHANGEABLE
def test_half_the_pixels_see_the_same(lens):
    """New pixel i covers old pixels 2i and 2i + 1: its centre lies between their centres."""
    width, height = lens.image_size
    half = resized(lens, (width // 2, height // 2))

    for i, j in np.random.default_rng(1).integers(0, 240, (40, 2)).tolist():
        old, new = lens.camera_ray_from_pixel(2 * i + 0.5, 2 * j + 0.5), half.camera_ray_from_pixel(i, j)
        assert isinstance(old, NoRay) == isinstance(new, NoRay)
        if not isinstance(old, NoRay):
            assert new == pytest.approx(old, abs=1e-9)
    assert half.max_angle == pytest.approx(lens.max_angle, abs=1e-6)


@CHANGEABLE
def test_a_part_of_the_image_sees_the_same(lens):
    part = cropped(lens, (100, 50), (400, 300))

    for i, j in ((0, 0), (399, 299), (200.25, 150.5), (320.0 - 100.0, 240.0 - 50.0)):
        old, new = lens.camera_ray_from_pixel(i + 100.0, j + 50.0), part.camera_ray_from_pixel(i, j)
        if isinstance(old, NoRay):
            assert isinstance(new, NoRay)
        else:
            assert new == pytest.approx(old, abs=1e-9)
    assert part.image_size == (400, 300)
    assert part.max_angle <= lens.max_angle


@pytest.mark.parametrize(("left_top", "size"), [((-1, 0), (10, 10)), ((635, 0), (10, 10)), ((0, 475), (10, 10))])
def test_what_is_no_part_of_the_image_is_refused(left_top, size):
    with pytest.raises(ValueError, match="no part"):
        cropped(LENSES["paper"], left_top, size)
