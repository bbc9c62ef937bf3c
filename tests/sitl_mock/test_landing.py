"""Each consumer of LANDING_TARGET against each of its rules."""

from math import nan, tan

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sitl_mock import scenario, simulate
from sitl_mock.landing import BODY_FRD, CONSUMERS, LOCAL_FRD, LOCAL_NED, Situation, px4

EMPTY = {
    "time_usec": 0,
    "target_num": 0,
    "frame": BODY_FRD,
    "angle_x": 0.0,
    "angle_y": 0.0,
    "distance": 0.0,
    "size_x": 0.0,
    "size_y": 0.0,
    "x": 0.0,
    "y": 0.0,
    "z": 0.0,
    "q": [1.0, 0.0, 0.0, 0.0],
    "type": 2,
    "position_valid": 0,
}
NOW_S, LAG_S = 4.0, 0.02
FLIGHT = simulate(scenario("perfect").but({"autopilot.ekf_origin_m": (30.0, 10.0, -2.3)}))
TARGET = np.array(FLIGHT.scene[0].at(NOW_S))


def situation():
    belief = FLIGHT.vehicle.belief
    lagged, now = belief.truth(NOW_S - LAG_S), belief.truth(NOW_S)
    return Situation(lagged, now, -now.position[2], belief.projection, FLIGHT.world)


def in_body(state):
    return Rotation.from_euler("ZYX", state.euler[::-1]).inv().apply(TARGET - state.position)


def position_message(**changes):
    x, y, z = in_body(situation().lagged)
    distance = float(np.hypot(np.hypot(x, y), z))
    return {**EMPTY, "x": x, "y": y, "z": z, "distance": distance, "position_valid": 1, **changes}


def angles_message(state, **changes):
    x, y, z = in_body(state)
    return {**EMPTY, "angle_x": float(np.arctan2(y, z)), "angle_y": float(np.arctan2(-x, z)), **changes}


@pytest.mark.parametrize("name", ["ardupilot_old", "ardupilot_new"])
def test_ardupilot_takes_a_body_vector_at_the_attitude_of_its_lag(name):
    landing = CONSUMERS[name](position_message(), situation())
    np.testing.assert_allclose(landing.position, TARGET, atol=1e-9)


@pytest.mark.parametrize("name", ["ardupilot_old", "ardupilot_new"])
def test_ardupilot_takes_angles_with_a_distance_or_the_rangefinder(name):
    state = situation().lagged
    distance = float(np.linalg.norm(TARGET - state.position))
    landing = CONSUMERS[name](angles_message(state, distance=distance), situation())
    np.testing.assert_allclose(landing.position, TARGET, atol=1e-9)
    landing = CONSUMERS[name](angles_message(state), situation())
    np.testing.assert_allclose(landing.position, TARGET, atol=0.05)


def test_the_frame_counts_for_angles_only_in_the_newer_one():
    message = angles_message(situation().lagged, frame=8)
    assert CONSUMERS["ardupilot_old"](message, situation()).reason == ""
    assert CONSUMERS["ardupilot_new"](message, situation()).reason == "frame_not_supported"
    assert CONSUMERS["ardupilot_new"]({**message, "frame": 0}, situation()).reason == "frame_not_supported"


@pytest.mark.parametrize("frame", [0, LOCAL_NED, 8])
def test_a_position_in_another_frame_is_refused_by_both(frame):
    for name in ("ardupilot_old", "ardupilot_new"):
        assert CONSUMERS[name](position_message(frame=frame), situation()).reason == "frame_not_supported"


def test_a_position_wants_a_distance():
    for name in ("ardupilot_old", "ardupilot_new"):
        assert CONSUMERS[name](position_message(distance=0.0), situation()).reason == "distance_not_positive"
        assert CONSUMERS[name](position_message(distance=nan), situation()).reason == "not_finite"
        assert CONSUMERS[name](position_message(x=nan), situation()).reason == "not_finite"


def test_local_frd_has_its_yaw_the_wrong_way_round():
    """Right only where the nose points north; the older code does not know this frame."""
    state = situation().lagged
    level = Rotation.from_euler("Z", state.euler[2]).inv().apply(TARGET - state.position)
    message = position_message(frame=LOCAL_FRD, x=level[0], y=level[1], z=level[2])
    assert CONSUMERS["ardupilot_old"](message, situation()).reason == "frame_not_supported"
    landing = CONSUMERS["ardupilot_new"](message, situation())
    wrong = Rotation.from_euler("Z", -state.euler[2]).apply(level) + state.position
    np.testing.assert_allclose(landing.position, wrong, atol=1e-9)
    assert np.linalg.norm(np.array(landing.position) - TARGET) > 1.0


def test_px4_takes_its_own_local_frame():
    place = FLIGHT.world.place(tuple(TARGET))
    x, y, z = FLIGHT.vehicle.belief.projection.local(place)
    landing = px4({**EMPTY, "frame": LOCAL_NED, "x": x, "y": y, "z": z, "position_valid": 1}, situation())
    np.testing.assert_allclose(landing.position, TARGET, atol=1e-6)
    assert px4(position_message(), situation()).reason == "frame_not_local_ned"
    assert px4({**position_message(frame=LOCAL_NED), "z": nan}, situation()).reason == "not_finite"


def test_px4_takes_angles_as_tangents_at_the_attitude_of_now():
    state = situation().now
    message = angles_message(state)
    tangents = {**message, "angle_x": tan(message["angle_x"]), "angle_y": tan(message["angle_y"])}
    np.testing.assert_allclose(px4(tangents, situation()).position, TARGET, atol=1e-6)
    ray = Rotation.from_euler("ZYX", state.euler[::-1]).apply([-0.2, 0.35, 1.0])
    expected = state.position + ray * (-state.position[2] / ray[2])
    landing = px4({**EMPTY, "angle_x": 0.35, "angle_y": 0.2}, situation())
    np.testing.assert_allclose(landing.position, expected, atol=1e-9)


def test_a_ray_that_does_not_go_down_is_refused():
    assert CONSUMERS["ardupilot_new"]({**EMPTY, "angle_y": -1.4}, situation()).reason == "line_of_sight_not_downward"


def test_over_the_wire_it_is_kept_and_judged(companion):
    run = companion("perfect", seconds=6.0)
    at = 4.0
    state = run.flight.flight.at(at + 0.001 - LAG_S)
    x, y, z = Rotation.from_euler("ZYX", state.euler[::-1]).inv().apply(TARGET - state.position)
    good = {**EMPTY, "x": x, "y": y, "z": z, "distance": 12.0, "position_valid": 1, "time_usec": 1_003_950_000}
    run.at(at, "LANDING_TARGET", **good).at(4.5, "LANDING_TARGET", **{**good, "frame": 8})
    run.at(5.0, "LANDING_TARGET", **{**good, "frame": 0}).fly()
    report = run.flight.vehicle.precland.summary()
    assert report["accepted"] == 1
    assert report["refused"] == {"frame_not_supported": 2}
    assert report["last"]["error_m"] < 1e-5
    assert report["last"]["from"] == [1, 191]
    texts = [f["text"] for f in run.of("STATUSTEXT")]
    assert texts == ["PrecLand: Target Found", "Plnd: Frame not supported"]


def test_precision_landing_that_is_off_takes_nothing(companion):
    run = companion("perfect", **{"autopilot.precland_enabled": False}).at(1.0, "LANDING_TARGET", **EMPTY).fly()
    assert run.flight.vehicle.precland.refused == {"not_enabled": 1}


@pytest.mark.parametrize(
    ("name", "consumer"), [("perfect", "ardupilot_new"), ("old_ardupilot", "ardupilot_old"), ("px4", "px4")]
)
def test_the_scenario_names_the_consumer(name, consumer):
    assert simulate(scenario(name)).vehicle.precland.name == consumer
