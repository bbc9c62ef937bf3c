"""Calibration files as people have them: read with their tool's own formulas, or refused with what to type."""

import json
from math import atan2, hypot

import numpy as np
import pytest
import yaml

from fwav_companion.camera import file_and_camera, parse_calibration
from fwav_companion.config import parse
from fwav_companion.errors import InputFileError

RAYS = [(0.31, -0.22, 0.83), (-0.4, 0.1, 0.9), (0.02, 0.35, 1.0)]
FX, FY, CX, CY = 461.6, 460.2, 362.7, 246.0
SIZE = [752, 480]
FISHEYE = [-0.013, 0.05, -0.045, 0.012]
PINHOLE = [-0.283, 0.074, 0.0002, -0.00002]


def fisheye_pixel(point, d, matrix=(FX, FY, CX, CY)):
    """d = theta (1 + k1 theta^2 + ... + k4 theta^8), as the documentation of OpenCV's fisheye writes it."""
    fx, fy, cx, cy = matrix
    x, y, z = point
    theta, phi = atan2(hypot(x, y), z), atan2(y, x)
    radius = theta * (1 + sum(k * theta ** (2 * i + 2) for i, k in enumerate(d)))
    return fx * radius * np.cos(phi) + cx, fy * radius * np.sin(phi) + cy


def pinhole_pixel(point, d, matrix=(FX, FY, CX, CY)):
    """x'' of OpenCV's documentation, with as many of k1, k2, p1, p2, k3, k4, k5, k6 as there are."""
    fx, fy, cx, cy = matrix
    k1, k2, p1, p2, k3, k4, k5, k6 = [*d, *[0.0] * (8 - len(d))]
    x, y = point[0] / point[2], point[1] / point[2]
    r2 = x * x + y * y
    factor = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return (
        fx * (x * factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx,
        fy * (y * factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy,
    )


def ros(model, d, matrix=(FX, FY, CX, CY), size=SIZE):
    fx, fy, cx, cy = matrix
    return yaml.safe_dump(
        {
            "image_width": size[0],
            "image_height": size[1],
            "camera_name": "belly",
            "camera_matrix": {"rows": 3, "cols": 3, "data": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]},
            "distortion_model": model,
            "distortion_coefficients": {"rows": 1, "cols": len(d), "data": list(d)},
        }
    )


def opencv(d, **extra):
    matrix = f"!!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [{FX}, 0., {CX}, 0., {FY}, {CY}, 0., 0., 1.]"
    terms = f"!!opencv-matrix\n   rows: {len(d)}\n   cols: 1\n   dt: d\n   data: {list(d)}"
    others = "".join(f"{key}: {value}\n" for key, value in extra.items())
    return (
        f"%YAML:1.0\n---\nimage_width: {SIZE[0]}\nimage_height: {SIZE[1]}\n{others}camera_matrix: {matrix}\n"
        f"distortion_coefficients: {terms}\n"
    )


def kalibr(**cameras):
    return yaml.safe_dump(
        {
            name: {
                "camera_model": "pinhole",
                "distortion_model": "equidistant",
                "distortion_coeffs": FISHEYE,
                "intrinsics": [FX, FY, cx, CY],
                "resolution": SIZE,
            }
            for name, cx in cameras.items()
        }
    )


def mrcal(model, numbers):
    """The layout of mrcal's writer: comments, then a Python mapping with bytes that YAML cannot hold."""
    return (
        f"# generated with mrcal-calibrate-cameras ...\n{{\n    'lensmodel':  '{model}',\n\n    # fx,fy,cx,cy,"
        f"distortion0,distortion1,....\n    'intrinsics': [ {', '.join(map(str, numbers))},],\n\n"
        "    # extrinsics are rt_fromref\n    'extrinsics': [ 0, 0, 0, 0, 0, 0,],\n\n"
        f"    'imagersize': [ {SIZE[0]}, {SIZE[1]},],\n\n    'icam_intrinsics': 0,\n\n"
        "    'optimization_inputs': b'P}PK{,]:#x0a(',\n}\n"
    )


def gyroflow(**other):
    return json.dumps(
        {
            "name": "Action camera 4:3",
            "camera_brand": "A",
            "lens_model": "wide",
            "calib_dimension": {"w": SIZE[0], "h": SIZE[1]},
            "orig_dimension": {"w": 4 * SIZE[0], "h": 4 * SIZE[1]},
            "fps": 30.0,
            "fisheye_params": {
                "RMS_error": 0.4,
                "camera_matrix": [[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]],
                "distortion_coeffs": FISHEYE,
            },
            **other,
        }
    )


RATIONAL = [0.9, 0.3, 0.0001, -0.0002, 0.01, 1.2, 0.5, 0.05]
CAMODOCAL = f"""%YAML:1.0
---
model_type: PINHOLE
camera_name: belly
image_width: {SIZE[0]}
image_height: {SIZE[1]}
distortion_parameters:
   k1: {PINHOLE[0]}
   k2: {PINHOLE[1]}
   p1: {PINHOLE[2]}
   p2: {PINHOLE[3]:.6f}
projection_parameters:
   fx: {FX}
   fy: {FY}
   cx: {CX}
   cy: {CY}
"""

READ = {
    "fisheye with a trailing zero": (ros("equidistant", [*FISHEYE, 0.0]), fisheye_pixel, FISHEYE),
    "pinhole with trailing zeros": (ros("plumb_bob", [*PINHOLE, 0.0, 0.0, 0.0, 0.0]), pinhole_pixel, PINHOLE),
    "rational of fourteen": (ros("rational_polynomial", [*RATIONAL, *[0.0] * 6]), pinhole_pixel, RATIONAL),
    "begins with ---": ("---\n" + ros("equidistant", FISHEYE), fisheye_pixel, FISHEYE),
    "ends with ---": (ros("equidistant", FISHEYE) + "---\n", fisheye_pixel, FISHEYE),
    "the same message twice": (
        "header: {seq: 1}\n" + ros("equidistant", FISHEYE) + "---\nheader: {seq: 2}\n" + ros("equidistant", FISHEYE),
        fisheye_pixel,
        FISHEYE,
    ),
    "OpenCV, camera_model": (opencv(FISHEYE, camera_model="fisheye"), fisheye_pixel, FISHEYE),
    "OpenCV, distortion_model": (opencv(PINHOLE, distortion_model="plumb_bob"), pinhole_pixel, PINHOLE),
    "OpenCV's sample, fisheye_model 1": (opencv(FISHEYE, fisheye_model=1), fisheye_pixel, FISHEYE),
    "OpenCV's sample, fisheye_model 0": (opencv([*PINHOLE, 0.0], fisheye_model=0), pinhole_pixel, PINHOLE),
    "camodocal pinhole": (CAMODOCAL, pinhole_pixel, PINHOLE),
    "mrcal pinhole": (mrcal("LENSMODEL_PINHOLE", [FX, FY, CX, CY]), pinhole_pixel, []),
    "mrcal OPENCV4": (mrcal("LENSMODEL_OPENCV4", [FX, FY, CX, CY, *PINHOLE]), pinhole_pixel, PINHOLE),
    "mrcal OPENCV5": (mrcal("LENSMODEL_OPENCV5", [FX, FY, CX, CY, *PINHOLE, 0.001]), pinhole_pixel, [*PINHOLE, 0.001]),
    "mrcal OPENCV8": (mrcal("LENSMODEL_OPENCV8", [FX, FY, CX, CY, *RATIONAL]), pinhole_pixel, RATIONAL),
    "gyroflow": (gyroflow(), fisheye_pixel, FISHEYE),
    "gyroflow, model named": (gyroflow(distortion_model="opencv_fisheye"), fisheye_pixel, FISHEYE),
}


@pytest.mark.parametrize("name", READ)
def test_file_gives_the_pixels_of_its_tools_formulas(name):
    text, project, d = READ[name]
    lens = parse_calibration(text, "camera.yaml").lens
    for ray in RAYS:
        assert lens.pixel_from_camera_point(ray) == pytest.approx(project(ray, d), abs=1e-9)


T265 = ros("plumb_bob", [-0.0046, 0.0391, -0.0367, 0.0061, 0.0], (286.1, 286.2, 419.6, 397.5), [848, 800])
CAHVOR = mrcal("LENSMODEL_CAHVOR", [FX] * 9)
WITHOUT_INPUTS = "".join(line for line in CAHVOR.splitlines(keepends=True) if "optimization_inputs" not in line)
CAMODOCAL_COMMAND = (
    "intrinsic_calib -i PICTURES -p PREFIX -w COLUMNS -h ROWS -s SQUARE_MM --camera-model kannala-brandt"
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (T265, "of at most 0.02; four numbers of a fisheye? then write distortion_model: equidistant"),
        (ros("plumb_bob", [-0.3, 0.1, 0.0, 0.03, -0.01]), "tangential terms (the third and fourth) of at most 0.02"),
        (ros("plumb_bob", [-0.6, 0.0, 0.0, 0.0, 0.0]), "radial function rises to the corners of the image"),
        (ros("equidistant", [-0.9, 0.0, 0.0, 0.0], (230.0, 230.0, CX, CY)), "it turns back"),
        (ros("plumb_bob", [0.0] * 5, (60.0, 60.0, CX, CY)), "its field of view would be 162 deg"),
        (ros("plumb_bob", [0.0] * 5, (2.1e5, 2.1e5, CX, CY)), "its field of view would be 0.205 deg"),
        (ros("equidistant", FISHEYE, (0.46, 0.46, CX, CY)), "its field of view would be"),
        (ros("equidistant", FISHEYE) + "---\n" + ros("equidistant", FISHEYE, (400.0, 400.0, CX, CY)), "2 documents"),
        (kalibr(cam0=CX, cam1=360.0), '[camera] calibration = "camera.yaml#cam0", of cam0, cam1'),
        (CAMODOCAL.replace("PINHOLE", "SCARAMUZZA"), CAMODOCAL_COMMAND),
        (CAHVOR, "convert: mrcal-convert-lensmodel LENSMODEL_OPENCV8 in.cameramodel > out.cameramodel"),
        (WITHOUT_INPUTS, "mrcal-convert-lensmodel --sampled --radius 0 LENSMODEL_OPENCV8 in.cameramodel > "),
        (mrcal("LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30", [FX] * 9), "mrcal-convert-lensmodel LENSMODEL_OPENCV8"),
        (mrcal("LENSMODEL_OPENCV8", [FX, FY, CX, CY]), "intrinsics"),
        (mrcal("LENSMODEL_OPENCV8", [FX] * 12)[:-40], "not a whole .cameramodel of mrcal"),
        (gyroflow(distortion_model="poly5"), "distortion_model = 'poly5': accepted: opencv_fisheye"),
        (gyroflow(input_horizontal_stretch=1.33), "input_horizontal_stretch = 1.33"),
    ],
)
def test_what_no_lens_has_is_refused_with_the_reason(text, says):
    with pytest.raises(InputFileError) as refusal:
        parse_calibration(text, "camera.yaml")
    message = str(refusal.value)
    assert message.startswith("camera.yaml")
    assert says in message
    assert "\n" not in message


def test_the_line_that_a_refusal_offers_reads_the_file():
    """An Intel T265's numbers under the wrong name: with the offered line it is the fisheye that it is."""
    lens = parse_calibration(T265.replace("plumb_bob", "equidistant"), "camera.yaml").lens
    for ray in RAYS:
        expected = fisheye_pixel(ray, [-0.0046, 0.0391, -0.0367, 0.0061], (286.1, 286.2, 419.6, 397.5))
        assert lens.pixel_from_camera_point(ray) == pytest.approx(expected, abs=1e-9)


def test_a_camera_of_a_chain_is_named_in_the_configuration(tmp_path):
    from fwav_companion.service.configured_files import load_calibration

    (tmp_path / "camchain.yaml").write_text(kalibr(cam0=CX, cam1=360.0))
    for camera, cx in (("cam0", CX), ("cam1", 360.0)):
        config = parse(f'[camera]\ncalibration = "camchain.yaml#{camera}"\n', str(tmp_path / "c.toml"))
        assert config.calibration_path == tmp_path / "camchain.yaml"
        lens = load_calibration(config).lens
        assert lens.pixel_from_camera_point((0.0, 0.0, 1.0)) == pytest.approx((cx, CY))
    config = parse('[camera]\ncalibration = "camchain.yaml#cam7"\n', str(tmp_path / "c.toml"))
    with pytest.raises(InputFileError, match="cam7: missing; accepted: one of the file's cameras: cam0, cam1"):
        load_calibration(config)


def test_a_camera_of_a_file_of_one_is_refused():
    with pytest.raises(InputFileError, match="it has one camera; accepted: the file's name without #cam1"):
        parse_calibration(ros("equidistant", FISHEYE), "camera.yaml", camera="cam1")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("camchain.yaml#cam1", ("camchain.yaml", "cam1")),
        ("a#b.yaml", ("a#b.yaml", "")),
        ("a#cam1.yaml", ("a#cam1.yaml", "")),
        ("camera.yaml", ("camera.yaml", "")),
        ("#cam1", ("#cam1", "")),
    ],
)
def test_file_and_camera(text, expected):
    assert file_and_camera(text) == expected
