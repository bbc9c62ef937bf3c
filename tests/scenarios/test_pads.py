"""Landing pads in whole flights: one track, whose landing point and height are compared with the truth."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest
from flying import LINK, fly

from fwav_companion.recording.summary_types import SummaryLine
from sitl_mock import scenario

CAMERA = '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\ntime_offset_s = 0.04\n'
LANDING = '[publish]\nlanding_target = true\nlanding_label = "pad"\n'
THREE = """[[pad]]
label = "pad"
tags = [
    { label = "tag36h11:0", size_m = 0.4, at_m = [-0.33, 0.0] },
    { label = "tag36h11:1", size_m = 0.12, at_m = [0.13, 0.04], yaw_deg = 90.0 },
    { label = "tag36h11:2", size_m = 0.04 },
]
"""
BESIDE = """[[pad]]
label = "pad"
landing_offset_m = [0.0, 2.0]
tags = [{ label = "tag36h11:0", size_m = 0.2 }]
"""
ALONE = '[[target]]\nlabel = "pad"\nsize_m = 0.4\n'
SEEDS = (1, 2, 3)


def camera_file(camera):
    """The camera file of the mock's lens."""
    keys = ("image_size", "k_mm", "pixels_per_mm", "principal_point")
    return "model: kannala_brandt\n" + "".join(f"{key}: {list(getattr(camera, key))}\n" for key in keys)


def flown(name, pad, seed=1, publish=LANDING, settings=(), **changes):
    options = scenario(name).but({"seed": seed, **changes})
    text = LINK + CAMERA + publish + pad
    settings = ("tracking.self_calibration=false", *settings)
    return fly(options, settings, text=text, camera=camera_file(options.camera))


def errors(flight, below_m):
    """Horizontal and vertical errors of what the autopilot understood, from this height of the vehicle on, metres."""
    pad = flight.mock.scene[0].at(0.0)
    return np.array(
        [
            (hypot(each["north"] - pad[0], each["east"] - pad[1]), each["down"] - pad[2])
            for each in flight.accepted_landings
            if -flight.mock.flight.at(each["flight_s"]).position[2] <= below_m
        ]
    )


def test_pad_of_three_sizes_is_one_track_from_eight_metres_to_the_ground():
    flight = flown("pad", THREE)
    lines = flight.companion.targets()
    assert {line.label for line in lines} == {"pad"}
    assert {line.track for line in lines if line.state != "dropped"} == {1}
    assert all(line.state != "dropped" for line in lines)


def test_landing_target_flows_in_the_frames_that_show_the_pad_down_to_a_third_of_a_metre():
    flight = flown("pad", THREE)
    fixes = [line for line in flight.companion.targets("pad") if line.fix and line.state == "confirmed"]
    assert len(flight.accepted_landings) >= 0.95 * len(fixes)
    lowest = min(-flight.mock.flight.at(each["flight_s"]).position[2] for each in flight.accepted_landings)
    assert lowest < 0.33


@pytest.mark.parametrize("seed", SEEDS)
def test_landing_point_of_a_pad_is_found_to_centimetres_near_the_ground(seed):
    """A degree of the mount, one sigma of its draw, is 1 cm at half a metre."""
    horizontal, vertical = errors(flown("pad", THREE, seed), below_m=0.5).T
    assert len(horizontal) > 100
    assert np.median(horizontal) < 0.03
    assert np.quantile(np.abs(vertical), 0.9) < 0.02


@pytest.mark.parametrize("seed", SEEDS)
def test_barometer_that_is_two_metres_off_is_corrected_by_the_tags_size(seed):
    right, wrong = (errors(flown("pad", THREE, seed, **{"biases.height_m": b}), below_m=3.0).T for b in (0.0, 2.0))
    assert np.quantile(np.abs(wrong[1]), 0.9) < 0.04
    assert np.median(wrong[0]) < np.median(right[0]) + 0.01


def test_barometer_that_is_two_metres_off_is_believed_without_a_size():
    """What is lost without the sizes: the single tag of a descent, by the barometer alone."""
    plain = '[[target]]\nlabel = "pad"\n'
    flight = fly(
        scenario("descent").but({"biases.height_m": 2.0}),
        ("tracking.self_calibration=false",),
        text=LINK + CAMERA + LANDING + plain,
    )
    _, vertical = errors(flight, below_m=3.0).T
    assert np.median(np.abs(vertical)) > 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_landing_point_two_metres_beside_a_tag_is_found_within_its_claim(seed):
    flight = flown("beside_tag", BESIDE, seed)
    fixed = [line for line in flight.companion.targets("pad") if line.fix and line.state == "confirmed"]
    squares = [flight.relative_error(line)[1] / 2.0 for line in fixed]
    assert len(squares) > 100
    assert np.mean(squares) < 3.0
    horizontal, _ = errors(flight, below_m=4.0).T
    assert np.median(horizontal) < 0.12


def test_tags_of_a_pad_are_no_refusals():
    """Each frame has a fix of the pad; that the other tags have none of their own is no refusal."""
    summary = flown("pad", THREE).companion.lines[-1]
    assert isinstance(summary, SummaryLine)
    assert "part_of_pad" not in summary.dropped_detections
    assert summary.fixes < summary.detections


def test_landing_without_position_and_rangefinder_is_by_the_tags_size_alone():
    """The track, still relative to the vehicle, erred by 0.4 m here: the vehicle moves."""
    flight = flown("pad", THREE, 3, settings=("vehicle.position=none",), **{"autopilot.rangefinder": False})
    horizontal, vertical = errors(flight, below_m=3.0).T
    assert len(horizontal) > 200
    assert np.median(horizontal) < 0.04
    assert np.quantile(horizontal, 0.9) < 0.08
    assert np.quantile(np.abs(vertical), 0.9) < 0.06


@pytest.mark.parametrize("rangefinder", [False, True])
def test_distance_sensor_by_the_tags_flows_where_no_rangefinder_is_heard(rangefinder):
    publish = f"{LANDING}distance_sensor = true\n"
    flight = flown("pad", THREE, publish=publish, **{"autopilot.rangefinder": rangefinder})
    sent = [(flight.mock.flight_s(now), each) for now, each in flight.companion.sent if each.name == "DISTANCE_SENSOR"]
    if rangefinder:
        assert sent == []
        return
    at_s = np.array([now_s for now_s, _ in sent])
    assert np.diff(at_s).max() < 0.25
    assert at_s[-1] - at_s[0] > 20.0
    true_m = [-flight.mock.flight.at(now_s - 0.1).position[2] for now_s in at_s]  # a tenth of a second old
    off_m = np.array([each.fields["current_distance"] / 100.0 for _, each in sent]) - true_m
    sigma_m = np.sqrt([each.fields["covariance"] for _, each in sent]) / 100.0
    assert np.mean(np.abs(off_m) < 2.0 * sigma_m + 0.05) > 0.95
