"""Detections against the projection of OpenCV and scipy, and against the configured counts."""

import json
from collections import Counter

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl_mock import FrameTruth, TargetOptions, scenario, simulate
from sitl_mock.camera import CLUTTER, datagram

F = 188.0 * 3.55
MATRIX = np.array([[F, 0.0, 320.0], [0.0, F, 240.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([0.03 / 3.55, 0.0, 0.0, 0.0])
BELLY = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""body_from_camera that looks straight down, image top toward the nose."""


def frames(name, **differences):
    flight = simulate(scenario(name).but(differences))
    truths, seen = {}, []
    for now, what in flight:
        if isinstance(what, FrameTruth):
            truths[what.frame] = what
        elif isinstance(what, dict):
            seen.append((now, what, truths[what["frame"]]))
    return flight, seen


def opencv_pixel(flight, t, point, body_from_camera=BELLY, lever=(0.0, 0.0, 0.0)):
    state = flight.flight.at(t)
    body = Rotation.from_euler("ZYX", state.euler[::-1]).inv().apply(np.array(point) - state.position)
    camera = body_from_camera.T @ (body - np.array(lever))
    pixel, _ = cv2.fisheye.projectPoints(camera[None, None], np.zeros(3), np.zeros(3), MATRIX, DISTORTION)
    return pixel[0, 0]


def test_the_paper_s_pixel():
    flight = simulate(scenario("paper_static"))
    pixel, _ = flight.camera.true_pixel(flight.scene[0], 3.0)
    assert pixel == pytest.approx((136.374666982652, 412.828664814575), abs=1e-9)


def test_every_detection_is_where_opencv_projects_the_target_at_its_row():
    differences = {"seconds": 6.0, "camera.readout_s": 0.03, "camera.position_m": (0.1, -0.05, 0.2)}
    flight, seen = frames("perfect", **differences, **{"biases.mount_deg": (0.5, 1.0, 2.0)})
    mount = Rotation.from_rotvec(np.radians([0.5, 1.0, 2.0])).as_matrix() @ BELLY
    checked = 0
    for _, frame, _ in seen:
        for one in frame["detections"]:
            t = frame["time_monotonic"] - 1000.0 + 0.03 * one["v"] / 480.0
            expected = opencv_pixel(flight, t, flight.scene[0].at(t), mount, (0.1, -0.05, 0.2))
            np.testing.assert_allclose((one["u"], one["v"]), expected, atol=2e-3)
            checked += 1
    assert checked > 100


@pytest.mark.parametrize("readout_s", [0.03, -0.03])
def test_row_times_solve_their_own_equation(readout_s):
    flight = simulate(scenario("perfect").but({"camera.readout_s": readout_s}))
    for row0_s in (0.5, 1.03, 2.2):
        (_, v), t = flight.camera.true_pixel(flight.scene[0], row0_s)
        share = v / 480.0
        expected = readout_s * share if readout_s > 0 else -readout_s * (1.0 - share)
        assert t - row0_s == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("rule", "early_s"), [("row0_mid", 0.0), ("row0_start", 0.004), ("row0_end", -0.004)])
@pytest.mark.parametrize("clock", ["time_monotonic", "time_unix", "time_boot"])
def test_stamps_follow_the_rule_the_clock_and_the_offset(rule, early_s, clock):
    changes = {"camera.stamp": rule, "camera.stamp_clock": clock, "camera.exposure_s": 0.008, "seconds": 1.0}
    flight, seen = frames("perfect", **changes, **{"camera.time_offset_s": 0.02, "biases.time_offset_s": 0.015})
    for _, frame, truth in seen:
        stamped_s = frame[clock]
        if clock == "time_boot":
            stamped_s = flight.clock.host_ns(round(stamped_s * 1e9)) * 1e-9
        elif clock == "time_unix":
            stamped_s -= flight.unix_minus_host_s
        mid_s = stamped_s - 0.035 + early_s
        assert mid_s == pytest.approx(1000.0 + truth.row0_flight_s, abs=2e-6)
        assert sum(key in frame for key in ("time_monotonic", "time_unix", "time_boot")) == 1


def test_noise_misses_clutter_and_outliers_are_as_many_as_asked():
    changes = {"camera.missed": 0.2, "camera.clutter": 0.3, "camera.outliers": 0.1, "seconds": 60.0}
    flight, seen = frames("unbiased", **changes, **{"flight.wander_m": 0.1, "flight.wander_deg": 0.5})
    sources = Counter(source for _, _, truth in seen for source in truth.sources)
    visible = sum(len(truth.visible) for _, _, truth in seen)
    assert visible > 1700
    assert sources[0] == pytest.approx(0.8 * 0.9 * visible, rel=0.06)
    assert sources[CLUTTER] == pytest.approx(0.3 * len(seen) + 0.08 * visible, rel=0.15)
    errors = []
    for _, frame, truth in seen:
        assert len(truth.sources) == len(frame["detections"])
        for source, one in zip(truth.sources, frame["detections"], strict=True):
            if source == 0:
                pixel, _ = flight.camera.true_pixel(flight.scene[0], truth.row0_flight_s)
                errors.append((one["u"] - pixel[0], one["v"] - pixel[1]))
    assert np.std(errors, axis=0) == pytest.approx([4.0, 4.0], rel=0.07)
    assert np.mean(errors, axis=0) == pytest.approx([0.0, 0.0], abs=0.4)


def test_nothing_outside_of_the_image_is_detected():
    _, seen = frames("racetrack", seconds=30.0)
    assert any(not truth.visible for _, _, truth in seen)
    for _, frame, _ in seen:
        for one in frame["detections"]:
            assert -0.5 <= one["u"] < 639.5
            assert -0.5 <= one["v"] < 479.5


def test_blur_hides_the_fast_moments():
    _, sharp = frames("unbiased", seconds=10.0)
    _, blurred = frames("blur", seconds=10.0, draw_biases=False)
    counts = [sum(len(frame["detections"]) for _, frame, _ in seen) for seen in (sharp, blurred)]
    assert 0.1 * counts[0] < counts[1] < 0.8 * counts[0]


def test_frames_arrive_after_their_last_row_and_late_ones_later():
    _, seen = frames("late_frames", seconds=5.0, **{"camera.readout_s": 0.03})
    assert [now for now, _, _ in seen] == sorted(now for now, _, _ in seen)
    assert [frame["frame"] for _, frame, _ in seen] != sorted(frame["frame"] for _, frame, _ in seen)
    for now, frame, truth in seen:
        age = now * 1e-9 - 1000.0 - truth.row0_flight_s
        late = 0.3 if frame["frame"] % 10 == 9 else 0.0
        assert 0.06 + late <= age + 1e-9 < 0.1 + late


def test_a_camera_dies():
    _, seen = frames("camera_dies", seconds=4.0, **{"camera.stops_at_s": 2.0})
    assert 55 <= len(seen) <= 57


def test_the_wall_clock_steps_under_the_stamps():
    flight, seen = frames("stepped_wall_clock", seconds=4.0, **{"camera.wall_steps": ((2.0, -50.0),)})
    offsets = {round(f["time_unix"] - flight.unix_minus_host_s - 1000.0 - truth.row0_flight_s) for _, f, truth in seen}
    assert offsets == {0, -50}


def test_a_walker_walks_out_and_back():
    walker = TargetOptions(label="person", speed_m_s=2.0, course_deg=90.0, leg_m=10.0)
    flight = simulate(scenario("hover").but({"targets": (walker,)}))
    target, (north, east, _) = flight.scene[0], flight.scene[0].at(0.0)
    assert target.at(3.0) == pytest.approx((north, east + 6.0, 0.0))
    assert target.at(8.0) == pytest.approx((north, east + 4.0, 0.0))
    assert target.velocity_at(8.0) == pytest.approx((0.0, -2.0))
    assert target.at(11.0) == pytest.approx((north, east + 2.0, 0.0))


def test_a_frame_travels_as_the_contract_s_json():
    _, seen = frames("three_targets", seconds=1.0)
    frame = json.loads(datagram(seen[-1][1]))
    assert frame["size"] == [640, 480]
    assert {"u", "v", "label", "score", "sigma"} <= set(frame["detections"][0])
