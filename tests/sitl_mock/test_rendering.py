"""Rendered frames against independent geometry: OpenCV's fisheye, scipy's rotations, OpenCV's own tag detector."""

import fcntl
import json
import os
import select
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl_mock import scenario
from sitl_mock.render import Eye, camera_rays
from sitl_mock.simulate import Simulation
from sitl_mock.tags import tags

SHARP = {"camera.exposure_s": 0.0, "seed": 4}


def flown(name: str = "demo", **differences) -> Simulation:
    return Simulation(scenario(name).but({"seconds": 30.0, **SHARP, **differences}))


@pytest.fixture(scope="module")
def eye() -> Eye:
    return Eye(flown())


def found(picture) -> dict[int, np.ndarray]:
    """Corners by id from OpenCV's detector: top left first, clockwise in the tag's own picture."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(dictionary)
    parameters = detector.getDetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector.setDetectorParameters(parameters)
    corners, ids, _ = detector.detectMarkers(picture)
    return {} if ids is None else {int(i): c[0] for i, c in zip(np.ravel(ids), corners, strict=True)}


def opencv_pixel(simulation: Simulation, place, flight_s: float) -> np.ndarray:
    """Pixel of a place in NED by OpenCV's fisheye model and scipy's rotations; the drawn mount error turns the
    camera.
    """
    o, state = simulation.options.camera, simulation.flight.at(flight_s)
    ned_from_body = Rotation.from_euler("ZYX", state.euler[::-1]).as_matrix()
    configured = Rotation.from_euler("ZYX", np.radians(o.mount_deg[::-1])).as_matrix() @ [
        [0, 0, 1],
        [1, 0, 0],
        [0, 1, 0],
    ]
    body_from_camera = Rotation.from_rotvec(np.radians(simulation.biases.mount_deg)).as_matrix() @ configured
    lever = np.add(o.position_m, simulation.biases.lever_arm_m)
    in_camera = body_from_camera.T @ (ned_from_body.T @ (np.array(place) - state.position) - lever)
    k1, *k = o.k_mm
    matrix = np.array([[o.pixels_per_mm[0] * k1, 0, o.principal_point[0]],
                       [0, o.pixels_per_mm[1] * k1, o.principal_point[1]], [0, 0, 1.0]])  # fmt: skip
    no_turn = np.zeros((3, 1))
    pixels, _ = cv2.fisheye.projectPoints(in_camera.reshape(1, 1, 3), no_turn, no_turn, matrix, np.array(k) / k1)
    return pixels.reshape(2)


def test_a_tags_corners_are_where_opencv_and_scipy_put_them():
    simulation = flown(**{"camera.readout_s": 0.0})
    eye = Eye(simulation)
    compared = 0
    for frame in range(0, 340, 20):
        for tag, view in zip(tags(simulation.options, simulation.scene), eye.views(frame), strict=True):
            for corner, pixel in zip(tag.corners, view.corners, strict=True):
                if simulation.camera.lens.sees(*pixel):
                    expected = opencv_pixel(simulation, corner, simulation.camera.row0_s(frame))
                    assert pixel == pytest.approx(expected, abs=1e-6)
                    compared += 1
    assert compared > 25


def test_the_grids_rays_are_opencvs():
    o = flown().options.camera
    rays = camera_rays(o)
    k1, *k = o.k_mm
    matrix = np.diag([o.pixels_per_mm[0] * k1, o.pixels_per_mm[1] * k1, 1.0])
    matrix[:2, 2] = o.principal_point
    u, v = np.meshgrid(np.arange(-8, 648, 8) + 3.5, np.arange(-8, 488, 8) + 3.5)
    there = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
    flat = cv2.fisheye.undistortPoints(there, matrix, np.array(k) / k1).reshape(*u.shape, 2)
    expected = np.concatenate([flat, np.ones((*u.shape, 1))], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert rays == pytest.approx(expected, abs=1e-7)


def test_a_detector_finds_the_corners_within_a_pixel_of_the_truth_through_the_rolling_shutter(eye):
    errors = []
    for frame in range(10, 340, 9):
        seen = found(eye.picture(frame))
        views = [view for view in eye.views(frame) if view.usable and view.tag_id in seen]
        errors += [np.abs(seen[view.tag_id] - np.array(view.corners)).max() for view in views]
    assert len(errors) > 15
    assert np.percentile(errors, 90) < 1.0
    # With any other reading of the rows' times the corners would be pixels away.
    assert abs(eye._simulation.biases.readout_s) * 600 > 10


@pytest.mark.slow
def test_blur_hides_tags_from_the_detector_as_the_truth_says():
    eye = Eye(flown("demo_blur", **{"camera.exposure_s": 0.008}))
    usable = unusable = usable_found = unusable_found = 0
    for frame in range(0, 320, 4):
        seen = None
        for view in eye.views(frame):
            inside = all(eye._camera.lens.sees(*corner) for corner in view.corners)
            if not inside:
                continue
            seen = found(eye.picture(frame)) if seen is None else seen
            if view.usable:
                usable, usable_found = usable + 1, usable_found + (view.tag_id in seen)
            elif view.blur_px > 2.0 * view.module_px:
                unusable, unusable_found = unusable + 1, unusable_found + (view.tag_id in seen)
    assert usable >= 5
    assert usable_found >= 0.8 * usable
    assert unusable >= 5
    assert unusable_found <= 0.2 * unusable


def test_a_frame_is_the_same_picture_whenever_it_is_rendered(eye):
    before = eye.picture(33)
    eye.picture(2)
    assert (eye.picture(33) == before).all()
    assert (Eye(flown(seed=5)).picture(33) != before).mean() > 0.9


def watched_process(folder: Path, lead_s: float) -> tuple[list[dict], list[dict]]:
    """(frames taken from the pipe, lines of the truth file) of a flight that begins so long after the start."""
    pipe, truth = folder / "frames.pipe", folder / "frames.jsonl"
    pipe.unlink(missing_ok=True)
    os.mkfifo(pipe)
    taken: list[dict] = []
    reading = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.fcntl(reading, fcntl.F_SETPIPE_SZ, 1 << 20)  # three frames may wait for a reader that waits for the processor
    os.set_blocking(reading, True)
    over = threading.Event()

    def read() -> None:
        while not select.select([reading], [], [], 0.1)[0] and not over.is_set():
            pass
        with os.fdopen(reading, "rb") as file:
            while line := file.readline():
                taken.append(json.loads(line))
                assert len(file.read(taken[-1]["bytes"])) == 640 * 480

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    command = [sys.executable, "-m", "sitl_mock.eye", "--pipe", str(pipe), "--truth", str(truth)]
    command += ["--start-ns", str(time.monotonic_ns() + round(lead_s * 1e9)), "--scenario", "demo", "--seconds", "2.5"]
    done = subprocess.run(command, timeout=120, check=True)
    assert done.returncode == 0
    over.set()
    reader.join(60.0)
    assert not reader.is_alive()
    return taken, [json.loads(line) for line in truth.read_text().splitlines()]


@pytest.mark.slow
def test_the_process_sends_frames_through_its_pipe_until_the_flight_ends(tmp_path: Path):
    for lead_s in (0.5, 5.0, 25.0):  # a process that waits for the processor may start when the flight is over
        taken, truths = watched_process(tmp_path, lead_s)
        if taken:
            break
    assert taken
    assert [line["frame"] for line in truths] == list(range(len(truths)))
    assert [each["frame"] for each in taken] == [line["frame"] for line in truths if line["delivered"]]
    assert all(each["size"] == [640, 480] and each["time_monotonic"] > 0.0 for each in taken)
