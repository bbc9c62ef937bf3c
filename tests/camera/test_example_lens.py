"""The handbook's example of a lens: the contract of every lens, its own formula, and its camera file."""

import importlib.util
from math import pi, radians, sin
from pathlib import Path

import pytest
import test_lens_contract as contract
from camera_lenses import ray_at

from fwav_companion.camera import parse_calibration
from fwav_companion.camera.calibration import LENS_READERS
from fwav_companion.errors import InputFileError
from fwav_companion.types import NoRay

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "equisolid_lens.py"
FILE = "model: equisolid\nimage_size: [640, 480]\nfocal_px: 300.0\nprincipal_point: [319.5, 239.5]\n"
WIDE = FILE.replace("focal_px: 300.0", "focal_px: 120.0")
"""180 degrees lie inside its image."""


@pytest.fixture
def example(monkeypatch):
    """The example's module, registered by the line that it shows."""
    spec = importlib.util.spec_from_file_location("equisolid_lens", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setitem(LENS_READERS, "equisolid", module.read_equisolid)
    return module


@pytest.mark.parametrize("text", [FILE, WIDE], ids=["narrow", "wide"])
def test_it_keeps_the_contract_of_every_lens(example, text):
    lens = parse_calibration(text, "camera.yaml").lens
    contract.test_a_ray_comes_back_from_its_pixel(lens)
    contract.test_a_pixel_of_the_image_comes_back_from_its_ray_or_is_refused(lens)
    contract.test_a_pixel_does_not_depend_on_how_far_the_point_is(lens)
    contract.test_what_lies_beyond_the_valid_range_is_refused(lens)
    contract.test_derivatives_of_the_ray_agree_with_differences(lens)
    contract.test_straight_behind_is_nowhere_in_the_image(lens)
    contract.test_many_at_once_are_each_as_one(lens)
    for bad in (float("nan"), float("inf"), 1e300):
        contract.test_what_is_no_pixel_has_no_ray(lens, bad)
    assert isinstance(lens.pixel_from_camera_point((0.0, 0.0, 0.0)), NoRay)


def test_its_radius_is_that_of_the_model(example):
    lens = parse_calibration(FILE, "camera.yaml").lens
    for degrees in (1.0, 20.0, 60.0):
        u, v = lens.pixel_from_camera_point(ray_at(radians(degrees), pi / 2.0))
        assert (u, v) == pytest.approx((319.5, 239.5 + 600.0 * sin(radians(degrees) / 2.0)))


def test_a_wrong_camera_file_is_one_line(example):
    with pytest.raises(InputFileError, match=r"camera\.yaml: focal_px = 0: accepted: a positive number"):
        parse_calibration(FILE.replace("300.0", "0"), "camera.yaml")
    with pytest.raises(InputFileError, match="accepted: kannala_brandt or equisolid"):
        parse_calibration(FILE.replace("equisolid", "thin"), "camera.yaml")
