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

from fwav_companion.vision.detectors.markers import apriltags
from sitl_mock import scenario
from sitl_mock.render import Eye, camera_rays
from sitl_mock.simulate import Simulation
from sitl_mock.tags import tags
from sitl_mock.target_options import PadTagOptions, TargetOptions

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


PAD_LABELS = ("tag36h11:0", "tag36h11:1", "tag36h11:2")
DECK = TargetOptions(
    label="pad", north=0.05, up=0.5, heave_m=0.2, speed_m_s=0.1, course_deg=70.0, heading_deg=200.0, turn_deg_s=5.0,
    tags=(
        PadTagOptions(label="tag36h11:1", size_m=0.04, forward_m=-0.15, right_m=0.05, yaw_deg=180.0),
        PadTagOptions(label="tag36h11:0", size_m=0.8),
    ),
)  # fmt: skip
"""A deck that heaves, moves and turns; the small tag is in a white module of the large one, and upside down."""


def places_on_pad(pad: TargetOptions, tag: PadTagOptions, centre, flight_s: float) -> np.ndarray:
    """(4, 3) corners of a tag in NED by complex numbers, forward + i right; from the upper left one, clockwise."""
    print_corners = 0.5 * tag.size_m * np.array([1 - 1j, 1 + 1j, -1 + 1j, -1 - 1j])
    on_pad = complex(tag.forward_m, tag.right_m) + print_corners * np.exp(1j * np.radians(tag.yaw_deg))
    heading = np.radians(pad.heading_deg + pad.turn_deg_s * flight_s)
    moved = pad.speed_m_s * flight_s * np.exp(1j * np.radians(pad.course_deg))
    ground = complex(*centre) + complex(pad.north, pad.east) + moved + on_pad * np.exp(1j * heading)
    down = -pad.up - pad.heave_m * np.sin(2.0 * np.pi * flight_s / 5.0)
    return np.column_stack([ground.real, ground.imag, np.full(4, down)])


def frame_at(simulation: Simulation, flight_s: float) -> int:
    return round((flight_s - simulation.camera.row0_s(0)) * simulation.options.camera.fps)


def height_m(simulation: Simulation, frame: int) -> float:
    return -simulation.flight.at(simulation.camera.row0_s(frame)).position[2]


def test_corners_of_a_moving_pad_are_where_opencv_and_scipy_put_them():
    simulation = flown("pad", targets=(DECK,), **{"biases.readout_s": 0.0})
    eye = Eye(simulation)
    for frame in (3, 200, 500):
        t = simulation.camera.row0_s(frame)
        for tag in DECK.tags:
            view = next(each for each in eye.views(frame) if each.tag_id == int(tag.label[-1]))
            places = places_on_pad(DECK, tag, simulation.options.flight.centre, t)
            expected = [opencv_pixel(simulation, place, t) for place in places]
            assert np.array(view.corners) == pytest.approx(np.array(expected), abs=1e-6)


def shift_px(picture, view) -> np.ndarray:
    """(u, v) by which a drawn tag is off, pixels: least squares of its grey levels against the print that a homography
    lays on the true corners, by its gradients."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    flat = cv2.aruco.generateImageMarker(dictionary, view.tag_id, 320)
    flat_corners = np.float32([[-0.5, -0.5], [319.5, -0.5], [319.5, 319.5], [-0.5, 319.5]])
    corners = np.array(view.corners)
    start = np.floor(corners.min(axis=0)).astype(int) - 2
    width, height = np.ceil(corners.max(axis=0)).astype(int) + 3 - start
    fine_corners = np.float32((corners - start + 0.5) * 8 - 0.5)
    fine = cv2.warpPerspective(
        flat,
        cv2.getPerspectiveTransform(flat_corners, fine_corners),
        (int(width) * 8, int(height) * 8),
        borderValue=255,
    ).astype(np.float32)
    expected = cv2.GaussianBlur(cv2.resize(fine, (int(width), int(height)), interpolation=cv2.INTER_AREA), (3, 3), 0.6)
    down, right = np.gradient(expected)
    there = picture[start[1] : start[1] + height, start[0] : start[0] + width].astype(float)
    inner = (slice(1, -1), slice(1, -1))
    design = np.stack([each[inner].ravel() for each in (np.ones_like(expected), expected, right, down)], axis=1)
    (_, contrast, du, dv), *_ = np.linalg.lstsq(design, there[inner].ravel(), rcond=None)
    return -np.array([du, dv]) / contrast


def test_own_detector_reads_a_pads_tags_from_three_metres_to_the_ground():
    simulation = flown("pad", seconds=37.0, seed=1)
    eye, detector, off, seen, due = Eye(simulation), apriltags(apart=PAD_LABELS), [], [], []
    frames = [frame_at(simulation, flight_s) for flight_s in np.arange(21.5, 35.0, 0.9)]
    heights = [height_m(simulation, frame) for frame in frames]
    assert max(heights) > 2.8
    assert min(heights) < 0.31
    for frame in frames:
        views = {view.tag_id: view for view in eye.views(frame)}
        detections = detector.detect(eye.picture(frame))
        seen.append({each["label"] for each in detections})
        due.append({label for label in PAD_LABELS if views[int(label[-1])].usable})
        assert seen[-1] & due[-1], height_m(simulation, frame)
        pairs = [(each, views[each["id"]]) for each in detections if views[each["id"]].usable]
        off += [np.array(each["corners"]) - np.array(view.corners) for each, view in pairs]
    assert sum(len(tags_due & read) for tags_due, read in zip(due, seen, strict=True)) >= 0.9 * sum(map(len, due))
    assert seen[0] >= {"tag36h11:0", "tag36h11:1"}
    assert seen[-1] == {"tag36h11:2"}
    assert np.linalg.norm(off, axis=2).mean() < 1.0 / 3.0  # each corner
    assert np.linalg.norm(np.mean(off, axis=1), axis=1).max() < 1.0 / 3.0  # the tag as a whole


def test_own_detector_reads_a_pads_largest_tag_from_eight_metres():
    simulation = flown("pad", seconds=37.0, seed=1)
    eye, detector = Eye(simulation), apriltags(apart=PAD_LABELS)
    for frame in (frame_at(simulation, flight_s) for flight_s in (2.5, 4.0)):
        assert height_m(simulation, frame) > 7.9
        assert [each["label"] for each in detector.detect(eye.picture(frame))] == ["tag36h11:0"]


@pytest.mark.parametrize(("above_m", "tag_id"), [(4.0, 0), (1.5, 1)], ids=["large tag", "small tag in its blank"])
def test_pad_on_a_deck_is_drawn_where_it_is_through_the_rolling_shutter(above_m, tag_id):
    way = tuple((at_s, 0.0, 0.0, above_m, 30.0) for at_s in (0.0, 40.0))
    simulation = flown("pad", targets=(DECK,), **{"flight.waypoints": way, "biases.readout_s": 0.02})
    eye = Eye(simulation)
    for frame in range(2, 40, 9):
        picture, view = eye.picture(frame), next(view for view in eye.views(frame) if view.tag_id == tag_id)
        assert view.usable
        assert np.abs(shift_px(picture, view)).max() < 0.25
        assert tag_id in found(picture)


def test_pad_with_a_tag_of_another_family_is_refused():
    pad = TargetOptions(label="pad", tags=(PadTagOptions(label="aruco:3", size_m=0.2),))
    with pytest.raises(ValueError, match="aruco:3: only tags tag36h11:ID of a pad can be drawn"):
        Eye(flown("pad", targets=(pad,)))


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
