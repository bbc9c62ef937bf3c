"""The written file holds the fitted lens: read back by the project's own reader, and by plain YAML."""

import numpy as np
import pytest
import yaml
from drawn_boards import PAPER, WIDE, views

from fwav_companion.camera import parse_calibration
from fwav_companion.tools.calibrate.calibration_summary import camera_file
from fwav_companion.tools.calibrate.lens_comparison import lens_difference
from fwav_companion.tools.calibrate.lens_fit.lens_fit import fit_lens
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView, project


@pytest.fixture(scope="module", params=[(PAPER, 0.42, 0.35), (WIDE, 1.45, 0.7)], ids=["the paper's", "200 degrees"])
def fitted(request):
    lens, reach, share = request.param
    seen = [BoardView(*view) for view in views(lens, np.random.default_rng(1), 16, reach=reach, share=share)]
    return fit_lens(seen, lens.size)


def test_it_comes_back_to_a_millionth_of_a_pixel(fitted):
    lens = parse_calibration(camera_file(fitted, ["a line", ""]), "camera.yaml").lens
    assert lens.image_size == fitted.image_size
    for angle in np.linspace(0.0, 0.999 * np.radians(fitted.valid_deg), 7):
        for phi in (0.0, 1.0, 4.0):
            ray = (np.sin(angle) * np.cos(phi), np.sin(angle) * np.sin(phi), np.cos(angle))
            pixel, _, _ = project(fitted.lens, np.array([ray]))
            assert lens.pixel_from_camera_point(ray) == pytest.approx(tuple(pixel[0]), abs=1e-6)


def test_it_ends_where_the_fit_does(fitted):
    lens = parse_calibration(camera_file(fitted, []), "camera.yaml").lens
    assert np.degrees(lens.max_angle) == pytest.approx(fitted.valid_deg, abs=0.011)
    assert fitted.valid_deg <= np.degrees(fitted.accuracy.supported)


def test_any_reader_of_yaml_gets_numbers(fitted):
    read = yaml.safe_load(camera_file(fitted, ["told: [nothing"]))
    assert list(read) == ["model", "image_size", "k_mm", "pixels_per_mm", "principal_point", "max_angle_deg"]
    assert len(read["k_mm"]) == 5
    assert all(
        isinstance(number, float) for key in ("k_mm", "pixels_per_mm", "principal_point") for number in read[key]
    )


def test_lenses_are_compared_by_their_rays():
    """A principal point that is 3 px off turns all rays by about 3 / 667 rad, which a turn of the camera takes back."""
    text = "model: kannala_brandt\nimage_size: [640, 480]\nk_mm: [1.0]\npixels_per_mm: [667.0, 667.0]\n"
    one, off = (parse_calibration(f"{text}principal_point: [{u}, 240.0]\n", "it").lens for u in (320.0, 323.0))
    assert lens_difference(one, one).rms == 0.0
    between = lens_difference(one, off)
    assert between.rms == pytest.approx(3.0 / 667.0, rel=0.05)
    assert between.largest >= between.rms
    assert between.rms_without_rotation < 0.1 * between.rms
