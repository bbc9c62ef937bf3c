"""Files of four tools and our own give the pixel that the tool they come from gives; what is unclear is refused."""

import subprocess
import sys
from math import atan2, cos, hypot, pi, radians, sin

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.camera import BrownConrady, KannalaBrandt, parse_calibration
from fwav_companion.errors import InputFileError

NATIVE = """
model: kannala_brandt
image_size: [640, 480]
k_mm: [3.55, 0.03, 0.0, 0.0, 0.0]
pixels_per_mm: [188.0, 188.0]
principal_point: [320.0, 240.0]
max_angle_deg: 75.0           # optional
"""
KALIBR = """
cam0:
  T_cam_imu:
  - [0.0, 1.0, 0.0, 0.07]
  - [-1.0, 0.0, 0.0, -0.02]
  - [0.0, 0.0, 1.0, 0.004]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.013, 0.05, -0.045, 0.012]
  distortion_model: equidistant
  intrinsics: [461.629, 460.152, 362.68, 246.049]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: -8.121e-05
"""
ROS = """
image_width: 752
image_height: 480
camera_name: belly
camera_matrix:
  rows: 3
  cols: 3
  data: [461.629, 0.0, 362.68, 0.0, 460.152, 246.049, 0.0, 0.0, 1.0]
distortion_model: {model}
distortion_coefficients:
  rows: 1
  cols: {count}
  data: {data}
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [300.0, 0.0, 370.0, 0.0, 0.0, 300.0, 250.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
CAMODOCAL = """%YAML:1.0
---
model_type: KANNALA_BRANDT
camera_name: belly
image_width: 752
image_height: 480
projection_parameters:
   k2: -1.3e-02
   k3: 5e-02
   k4: -0.045
   k5: 0.012
   mu: 461.629
   mv: 460.152
   u0: 362.68
   v0: 246.049
"""
K = np.array([[461.629, 0.0, 362.68], [0.0, 460.152, 246.049], [0.0, 0.0, 1.0]])
D = (-0.013, 0.05, -0.045, 0.012)
RAY = (0.31, -0.22, 0.83)


def equidistant_pixel(point):
    """The projection of the three tools' papers: d = theta (1 + k1 theta^2 + ...), then the camera matrix."""
    theta, phi = atan2(hypot(point[0], point[1]), point[2]), atan2(point[1], point[0])
    d = theta * (1 + D[0] * theta**2 + D[1] * theta**4 + D[2] * theta**6 + D[3] * theta**8)
    return (K[0, 0] * d * cos(phi) + K[0, 2], K[1, 1] * d * sin(phi) + K[1, 2])


def ros(model: str, data: list) -> str:
    return ROS.format(model=model, data=data, count=len(data))


def test_our_own_file():
    calibration = parse_calibration(NATIVE, "camera.yaml")

    assert isinstance(calibration.lens, KannalaBrandt)
    assert calibration.image_size == (640, 480)
    theta = radians(21.6)
    u, v = calibration.lens.pixel_from_camera_point((sin(theta), 0.0, cos(theta)))
    assert (u, v) == pytest.approx((320.0 + 188.0 * (3.55 * theta + 0.03 * theta**3), 240.0), abs=1e-9)
    assert (calibration.time_offset_s, calibration.body_from_camera) == (None, None)


def test_the_configured_angle_ends_the_range():
    narrow = parse_calibration(NATIVE.replace("75.0", "20.0"), "camera.yaml").lens
    wide = parse_calibration(NATIVE, "camera.yaml").lens

    assert narrow.max_angle == pytest.approx(radians(20.0), abs=1e-12)
    assert wide.max_angle < radians(35.0), "the image ends earlier than the configuration"


@pytest.mark.parametrize(
    "text",
    [KALIBR, ros("equidistant", list(D)), ros("fisheye", list(D)), CAMODOCAL],
    ids=["Kalibr", "ROS", "ROS fisheye", "camodocal"],
)
def test_one_fisheye_in_the_words_of_three_tools(text):
    lens = parse_calibration(text, "camera.yaml").lens

    assert lens.image_size == (752, 480)
    assert lens.pixel_from_camera_point(RAY) == pytest.approx(equidistant_pixel(RAY), abs=1e-9)


@pytest.mark.parametrize("suffix", ["yml", "json"])
@pytest.mark.parametrize(
    ("model", "d"),
    [
        ("fisheye", D),
        ("plumb_bob", (-0.283, 0.0739, 0.00019, 1.76e-05)),
        ("plumb_bob", (-0.283, 0.07, 0.0, 0.0, 1e-10)),
    ],
)
def test_what_opencv_itself_writes(tmp_path, suffix, model, d):
    path = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("model", model)
    storage.write("image_width", 752)
    storage.write("image_height", 480)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", np.array([d]))
    storage.release()

    lens = parse_calibration(path.read_text(), path.name).lens

    point, nothing = np.array([[RAY]]), np.zeros(3)
    if model == "fisheye":
        theirs, _ = cv2.fisheye.projectPoints(point, nothing, nothing, K, np.array(d))
    else:
        theirs, _ = cv2.projectPoints(point, nothing, nothing, K, np.array(d))
    assert lens.pixel_from_camera_point(RAY) == pytest.approx(theirs.reshape(2), abs=1e-9)


def test_the_old_heading_of_opencv_is_understood():
    text = (
        "%YAML:1.0\n---\nmodel: fisheye\nimage_width: 752\nimage_height: 480\n"
        "K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [461.629, 0., 362.68, 0., 460.152, 246.049, 0., 0., 1.]\n"
        "D: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [-0.013, 0.05, -4.5e-2, 1.2e-02]\n"
    )
    lens = parse_calibration(text, "camera.yaml").lens
    assert lens.pixel_from_camera_point(RAY) == pytest.approx(equidistant_pixel(RAY), abs=1e-9)


def test_a_skew_is_kept():
    text = ros("equidistant", list(D)).replace("[461.629, 0.0,", "[461.629, -0.96635,")
    lens = parse_calibration(text, "camera.yaml").lens
    theirs, _ = cv2.fisheye.projectPoints(
        np.array([[RAY]]), np.zeros(3), np.zeros(3), K, np.array(D), alpha=-0.96635 / 461.629
    )
    assert lens.pixel_from_camera_point(RAY) == pytest.approx(theirs.reshape(2), abs=1e-9)


def test_a_camera_info_of_a_pinhole():
    rational = [8.1, 2.9, 1e-4, -2e-4, 0.1, 8.4, 5.1, 0.7]
    for model, d in (("plumb_bob", [-0.28, 0.07, 0.0002, 1.7e-05, 0.0]), ("rational_polynomial", rational)):
        lens = parse_calibration(ros(model, d), "camera.yaml").lens
        theirs, _ = cv2.projectPoints(np.array([[RAY]]), np.zeros(3), np.zeros(3), K, np.array(d))
        assert isinstance(lens, BrownConrady)
        assert lens.pixel_from_camera_point(RAY) == pytest.approx(theirs.reshape(2), abs=1e-9)


def test_kalibrs_time_shift_has_the_other_sign():
    """T_imu = t_cam + shift: a shift of -81 us says that stamps come 81 us late."""
    assert parse_calibration(KALIBR, "camchain.yaml").time_offset_s == 8.121e-05


def test_kalibrs_mount_counts_only_where_the_imu_has_the_bodys_axes():
    plain = parse_calibration(KALIBR, "camchain.yaml")
    marked = parse_calibration(KALIBR + "imu_axes: FRD\n", "camchain.yaml")
    reported = parse_calibration(KALIBR, "camchain.yaml", imu_is_frd=True)

    assert plain.body_from_camera is None
    assert "imu_axes: FRD" in plain.note
    # camera x = body y, camera y = -body x: a belly camera, image top to the nose
    expected = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    for found in (marked.body_from_camera, reported.body_from_camera):
        assert np.array(found) == pytest.approx(np.array(expected), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no keys"),
        ("[1, 2]", "no keys"),
        ("a: [", "camera.yaml"),
        ("hello: 1", "hello"),
        ("model: pinhole", "kannala_brandt"),
        (NATIVE.replace("[640, 480]", "[640]"), "image_size = [640]: accepted: a list of 2 finite numbers"),
        (NATIVE.replace("[640, 480]", "[640.5, 480]"), "whole pixels"),
        (NATIVE.replace("[3.55, 0.03, 0.0, 0.0, 0.0]", "[-3.55]"), "k_mm = [-3.55]: accepted: a positive first"),
        (NATIVE.replace("[3.55, 0.03, 0.0, 0.0, 0.0]", "[.nan]"), "k_mm"),
        (NATIVE.replace("[188.0, 188.0]", "[188.0, 0]"), "pixels_per_mm"),
        (NATIVE.replace("[320.0, 240.0]", "[320.0, 900.0]"), "principal point inside the image"),
        (NATIVE.replace("75.0", "275.0"), "max_angle_deg"),
        (NATIVE.replace("max_angle_deg", "max_angel_deg"), "max_angel_deg"),
        (
            NATIVE.replace("image_size: [640, 480]\n", ""),
            "camera.yaml: image_size: missing; accepted: a list of 2 finite numbers",
        ),
        (ros("equidistant", [0.1, 0.0, 0.0, 0.0, 0.1]), "distortion_coefficients"),
        (ros("thin_prism", [0.1, 0.0, 0.0, 0.0]), "thin_prism"),
        (ros("plumb_bob", [0.1, 0.0]), "4 or 5"),
        (ros("equidistant", list(D)) + "binning_x: 2\n", "binning_x"),
        (ros("equidistant", list(D)) + "roi: {x_offset: 10, width: 100}\n", "roi.x_offset"),
        (KALIBR.replace("camera_model: pinhole", "camera_model: fov"), "fov"),
        (KALIBR.replace("camera_model: pinhole", "camera_model: [460.0, 320.0]"), "camera_model"),
        (KALIBR.replace("intrinsics: [461.629, 460.152", "intrinsics: [-461.629, 460.152"), "intrinsics"),
        (KALIBR + KALIBR.replace("cam0", "cam1"), "one camera"),
        (KALIBR + "imu_axes: FLU\n", "FRD"),
        (KALIBR.replace("[0.0, 1.0, 0.0, 0.07]", "[0.0, 2.0, 0.0, 0.07]") + "imu_axes: FRD\n", "rotation"),
        (CAMODOCAL.replace("KANNALA_BRANDT", "SCARAMUZZA"), "SCARAMUZZA"),
        (CAMODOCAL.replace("mu: 461.629", "mu: wide"), "projection_parameters.mu = 'wide': accepted: a finite number"),
    ],
)
def test_a_wrong_file_is_refused_with_its_key_and_the_fix(text, says):
    with pytest.raises(InputFileError) as refusal:
        parse_calibration(text, "camera.yaml", imu_is_frd=False)

    assert str(refusal.value).startswith("camera.yaml")
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 400


def test_four_numbers_without_a_models_name_are_refused_with_the_fix():
    text = ros("equidistant", list(D)).replace("distortion_model: equidistant\n", "")
    with pytest.raises(InputFileError, match="a model: line of fisheye, plumb_bob or rational_polynomial"):
        parse_calibration(text, "camera.yaml")


def bomb(of: str, again: str) -> str:
    """Nine times nine ... of one value, by aliases."""
    lines = [f"a0: &a0 {of}"]
    lines += [f"a{i}: &a{i} {again.format(', '.join([f'*a{i - 1}'] * 9))}" for i in range(1, 12)]
    return "\n".join([*lines, "model: kannala_brandt", "image_size: *a11\n"])


@pytest.mark.parametrize("documents", [1, 2])
@pytest.mark.parametrize(("of", "again"), [("[1, 1, 1]", "[{}]"), ("{k: 1}", "{{<<: [{}]}}")], ids=["lists", "merges"])
def test_a_bomb_of_aliases_is_refused_quickly(of, again, documents):
    with pytest.raises(InputFileError, match="more than 32 aliases"):
        parse_calibration("---\n".join([bomb(of, again)] * documents), "camera.yaml")


@pytest.mark.parametrize(
    "text",
    [
        *(f"{NATIVE}x: !!{tag} {value}\n" for tag, value in (
            ("bool", "foo"), ("int", "''"), ("float", "'_'"), ("float", "1:" * 300 + "1"), ("timestamp", "foo"),
            ("binary", "é"), ("set", "[1]"),
        )),
        "{'lensmodel': {[1]: 2}}",
        "{'lensmodel': {1, [2]}}",
        f"{NATIVE}x: &a [*a]\n---\n{NATIVE}x: &a [*a]\n",
    ],
)  # fmt: skip
def test_values_that_contradict_their_tags_or_contain_themselves_are_one_line(text):
    with pytest.raises(InputFileError, match="accepted") as refusal:
        parse_calibration(text, "camera.yaml")
    assert len(str(refusal.value).splitlines()) == 1


@settings(derandomize=True, max_examples=150, deadline=None)
@given(
    st.sampled_from([NATIVE, KALIBR, CAMODOCAL, ros("equidistant", list(D)), ros("plumb_bob", [0.1, 0.0, 0.0, 0.0])]),
    st.integers(0, 900),
    st.sampled_from(
        [
            "",
            ":",
            "[",
            "]",
            "nan",
            "1e400",
            "-1",
            "99999999999999999999999",
            "*",
            "&a",
            "!!python/none",
            "\x00",
            "\n",
            "0",
        ]
    ),
    st.integers(0, 5),
)
def test_any_damage_gives_a_lens_or_a_refusal_and_never_a_crash(text, at, put, instead_of):
    at %= len(text)
    damaged = text[:at] + put + text[at + instead_of :]
    try:
        lens = parse_calibration(damaged, "camera.yaml").lens
    except InputFileError:
        return
    assert 0.0 < lens.max_angle <= pi


def test_yaml_is_loaded_only_for_a_file():
    """A relay without a camera imports the room without loading YAML."""
    script = "import sys, fwav_companion.camera as c; assert not {'yaml', 'numpy', 'cv2'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", script], check=True)
