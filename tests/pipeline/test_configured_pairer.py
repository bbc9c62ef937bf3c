"""Which mount and delay count: the configuration's, and a calibration file's where the configuration has none."""

import numpy as np
from flying import CAMERA, LINK

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.pipeline.pipeline_factory import make_pairer

BY_FILE = body_from_camera_from_euler(0.1, -1.4, 0.2)
DESCRIBED = (
    '[camera]\ncalibration = "camera.yaml"\ntime_offset_s = 0.035\n[camera.mount]\npitch_deg = -89.0\nyaw_deg = 2.0\n'
)


def pairer(text, **by_file):
    lens = parse_calibration(CAMERA, "camera.yaml").lens
    calibration = type(parse_calibration(CAMERA, "camera.yaml"))(lens, **by_file)
    return make_pairer(parse(LINK + text, "flight.toml"), calibration)


def test_lines_that_were_pasted_count_more_than_the_calibration_file():
    pasted = pairer(DESCRIBED, time_offset_s=0.01, body_from_camera=BY_FILE)
    assert pasted.time_offset_s == 0.035
    assert np.allclose(pasted.body_from_camera, body_from_camera_from_euler(0.0, np.radians(-89.0), np.radians(2.0)))


def test_a_calibration_file_counts_where_nothing_was_written():
    left = pairer('[camera]\ncalibration = "camera.yaml"\n', time_offset_s=0.01, body_from_camera=BY_FILE)
    assert left.time_offset_s == 0.01
    assert left.body_from_camera == BY_FILE
