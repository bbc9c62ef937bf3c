"""Omni, double sphere, extended unified and OCamCalib files: read with their tools' own formulas, written naively."""

import json
from math import hypot, sqrt

import pytest
import yaml

from fwav_companion.camera import parse_calibration
from fwav_companion.errors import InputFileError

RAYS = [(0.31, -0.22, 0.83), (-0.4, 0.1, 0.9), (0.02, 0.35, 1.0), (0.0, 0.0, 2.0), (0.8, 0.5, 0.2)]
FU, FV, PU, PV = 235.6, 234.2, 362.7, 246.0
SIZE = [752, 480]
RADTAN = [-0.335, 0.132, 0.00056, -0.00058]


def omni_pixel(point, own, d):
    """Unit sphere, shift by xi, perspective division, radtan, intrinsics."""
    (xi,) = own
    n = hypot(*point)
    x, y = point[0] / n / (point[2] / n + xi), point[1] / n / (point[2] / n + xi)
    k1, k2, p1, p2 = d
    r2 = x * x + y * y
    factor = 1 + k1 * r2 + k2 * r2 * r2
    return (
        FU * (x * factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + PU,
        FV * (y * factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + PV,
    )


def ds_pixel(point, own, _d):
    xi, alpha = own
    x, y, z = point
    d1 = sqrt(x * x + y * y + z * z)
    d2 = sqrt(x * x + y * y + (xi * d1 + z) ** 2)
    below = alpha * d2 + (1 - alpha) * (xi * d1 + z)
    return FU * x / below + PU, FV * y / below + PV


def eucm_pixel(point, own, _d):
    alpha, beta = own
    x, y, z = point
    below = alpha * sqrt(beta * (x * x + y * y) + z * z) + (1 - alpha) * z
    return FU * x / below + PU, FV * y / below + PV


def kalibr(model, own, d):
    camera = {
        "camera_model": model,
        "distortion_coeffs": list(d),
        "distortion_model": "radtan" if d else "none",
        "intrinsics": [*own, FU, FV, PU, PV],
        "resolution": SIZE,
        "rostopic": "/cam0/image_raw",
    }
    return yaml.safe_dump({"cam0": camera})


def basalt(*cameras, **other):
    plane = {"fx": FU, "fy": FV, "cx": PU, "cy": PV}
    named = [{"camera_type": model, "intrinsics": {**plane, **own}} for model, own in cameras]
    return json.dumps({"value0": {"T_imu_cam": [{}], "intrinsics": named, "resolution": [SIZE] * len(named), **other}})


MEI = f"""%YAML:1.0
---
model_type: MEI
camera_name: belly
image_width: {SIZE[0]}
image_height: {SIZE[1]}
mirror_parameters:
   xi: 0.8
distortion_parameters:
   k1: {RADTAN[0]}
   k2: {RADTAN[1]}
   p1: {RADTAN[2]:.6f}
   p2: {RADTAN[3]:.6f}
projection_parameters:
   gamma1: {FU}
   gamma2: {FV}
   u0: {PU}
   v0: {PV}
"""
READ = {
    "Kalibr omni": (kalibr("omni", [0.8], RADTAN), omni_pixel, [0.8], RADTAN),
    "Kalibr ds": (kalibr("ds", [-0.21, 0.56], []), ds_pixel, [-0.21, 0.56], []),
    "Kalibr eucm": (kalibr("eucm", [0.63, 1.04], []), eucm_pixel, [0.63, 1.04], []),
    "camodocal MEI": (MEI, omni_pixel, [0.8], RADTAN),
    "Basalt ds": (basalt(("ds", {"xi": -0.21, "alpha": 0.56})), ds_pixel, [-0.21, 0.56], []),
    "Basalt eucm": (basalt(("eucm", {"alpha": 0.63, "beta": 1.04})), eucm_pixel, [0.63, 1.04], []),
    "Basalt ucm": (basalt(("ucm", {"alpha": 0.63})), eucm_pixel, [0.63, 1.0], []),
    "Basalt pinhole": (basalt(("pinhole", {})), eucm_pixel, [0.0, 1.0], []),
}


@pytest.mark.parametrize("name", READ)
def test_file_gives_the_pixels_of_its_tools_formulas(name):
    text, project, own, d = READ[name]
    lens = parse_calibration(text, "camera.yaml").lens
    assert lens.image_size == tuple(SIZE)
    for ray in RAYS[:-1] if "pinhole" in name else RAYS:
        assert lens.pixel_from_camera_point(ray) == pytest.approx(project(ray, own, d), abs=1e-9)


def test_kalibrs_delay_and_a_chain_of_two_are_read_with_a_sphere_model():
    two = yaml.safe_load(kalibr("ds", [-0.21, 0.56], []))
    two["cam0"]["timeshift_cam_imu"] = 0.02
    text = yaml.safe_dump(two | {"cam1": {**two["cam0"], "camera_model": "omni", "intrinsics": [0.8, FU, FV, PU, PV]}})
    assert parse_calibration(text, "camera.yaml", camera="cam0").time_offset_s == -0.02
    lens = parse_calibration(text, "camera.yaml", camera="cam1").lens
    assert lens.pixel_from_camera_point(RAYS[0]) == pytest.approx(omni_pixel(RAYS[0], [0.8], [0.0] * 4), abs=1e-9)


def test_a_camera_of_basalts_file_is_named():
    text = basalt(("ds", {"xi": -0.21, "alpha": 0.56}), ("kb4", {"k1": 0.01, "k2": 0.0, "k3": 0.0, "k4": 0.0}))
    fisheye = parse_calibration(text, "c.json", camera="cam1").lens
    theta = 0.4
    assert fisheye.pixel_from_camera_point((0.42279321873816, 0.0, 1.0))[0] == pytest.approx(
        PU + FU * (theta + 0.01 * theta**3), abs=1e-6
    )
    with pytest.raises(InputFileError, match=r'"c.json#cam0", of cam0, cam1'):
        parse_calibration(text, "c.json")


POLYNOMIAL = [-2.065170e02, 0.0, 2.207161e-03, -4.879622e-06, 1.865656e-08]
CENTRE, AFFINE = (241.8, 394.55), (1.00033, 0.0219, 0.0257)
"""Row and column; c, d, e, of which d and e are a hundred times those of a camera, to be seen."""


def ocam(polynomial=POLYNOMIAL, tables=5):
    """The layout of the toolbox's exportData2TXT."""
    lines = [
        "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB).",
        " ".join(map(str, [len(polynomial), *polynomial])),
        "#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB).",
        "3 294.182260 152.289570 -12.191217",
        '#center: "row" and "column", starting from 0 (C convention)',
        "{} {}".format(*CENTRE),
        '#affine parameters "c", "d", "e"',
        "{} {} {}".format(*AFFINE),
        '#image size: "height" and "width"',
        "480 752",
    ]
    return "\n\n".join(lines[: 2 * tables]) + "\n"


@pytest.mark.parametrize("pixel", [(394.55, 241.8), (500.0, 100.0), (120.0, 430.0), (700.0, 240.0)])
def test_ocamcalibs_pixel_gives_the_ray_of_its_cam2world(pixel):
    """The inverse of the affine map by Cramer's rule; x runs down the rows, and the camera looks along -z."""
    lens = parse_calibration(ocam(), "calib_results.txt").lens
    c, d, e = AFFINE
    row, column = pixel[1] - CENTRE[0], pixel[0] - CENTRE[1]
    x, y = (row - d * column) / (c - d * e), (-e * row + c * column) / (c - d * e)
    rho = hypot(x, y)
    z = sum(a * rho**n for n, a in enumerate(POLYNOMIAL))
    length = sqrt(x * x + y * y + z * z)
    assert lens.camera_ray_from_pixel(*pixel) == pytest.approx((y / length, x / length, -z / length), abs=1e-9)
    assert lens.pixel_from_camera_point(lens.camera_ray_from_pixel(*pixel)) == pytest.approx(pixel, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (kalibr("omni", [-0.4], RADTAN), "xi of at least 0"),
        (kalibr("ds", [1.4, 0.5], []), "xi in (-1, 1) and alpha in [0, 1]"),
        (kalibr("eucm", [0.5, -1.0], []), "alpha in [0, 1] and a positive beta"),
        (
            kalibr("ds", [-0.2, 0.56], RADTAN),
            "distortion_model = 'radtan': accepted: radtan or none of omni",
        ),
        (kalibr("ds", [0.56], []), "intrinsics"),
        (kalibr("fov", [0.5], []), "accepted: pinhole with distortion_model equidistant or radtan, omni, ds or eucm"),
        (basalt(("fov", {"w": 0.9})), "camera_type = 'fov': accepted: ds, eucm, ucm, kb4 or pinhole"),
        (basalt(("ds", {"xi": 0.1})), "intrinsics.alpha: missing"),
        (ocam([-1e300, *POLYNOMIAL[1:]]), "every number of a lens must be finite, and at most"),
        (kalibr("eucm", [0.5, 1e12], []), "every number of a lens must be finite, and at most"),
        (ocam(tables=3), "not a whole calib_results.txt of OCamCalib"),
        (ocam([206.5, *POLYNOMIAL[1:]]), "a negative first one"),
        (ocam([-206.5, 0.0, -0.02, 0.0, 0.0]), "it turns back"),
    ],
)
def test_numbers_that_no_lens_has_are_refused_with_the_reason(text, says):
    with pytest.raises(InputFileError) as refusal:
        parse_calibration(text, "camera.yaml")
    message = str(refusal.value)
    assert message.startswith("camera.yaml")
    assert says in message
    assert "\n" not in message
