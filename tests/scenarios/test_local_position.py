"""Flights without a global position by the autopilot's local one: targets that stand still, landings, replay."""

from itertools import pairwise
from math import hypot

import numpy as np
import pytest
from flying import Flight, fly

from fwav_companion.recording.line_types import CalibrationLine, OriginLine, TargetLine
from fwav_companion.types import NoticeCode
from sitl_mock import scenario
from sitl_mock.flow import Flow

LOCAL_POSITION_NED, ODOMETRY = 32, 331
WORLD_S = 10.0
"""Flight time at which the wait for a global position ends."""
CALIBRATED = ("tracking.self_calibration=true",)
FLOW = {"autopilot.gps": False, "autopilot.flow": True}
ROUND = scenario("copter_circles").but({"seed": 5, "seconds": 40.0, **FLOW})
"""Circles of 3 m radius at 2 m/s, 14 m over the pad: 80 m of way."""
LANDING = (
    "publish.landing_target=true",
    'publish.landing_label="pad"',
    "camera.readout_s=0.0",
    "ground.model=rangefinder",
)
DOWN = scenario("descent").but(
    {
        **FLOW,
        "seed": 4,
        "seconds": 40.0,
        "camera.time_offset_s": 0.0,
        "flight.waypoints": (
            (0.0, -20.0, 1.0, 8.0, 30.0),
            (14.0, -2.5, 1.0, 8.0, 30.0),
            (22.0, -0.5, 1.0, 5.0, 30.0),
            (38.0, 0.0, 0.0, 1.0, 30.0),
        ),
    }
)
"""Indoors: on to the pad at up to 2.3 m/s, then down to 1 m over it."""


def requests_of(flight: Flight, message_id: int) -> list[float]:
    """Flight times of the requests for a message's rate, seconds."""
    return [
        flight.mock.flight_s(now)
        for now, each in flight.companion.sent
        if each.name == "COMMAND_LONG" and each.fields["command"] == 511 and each.fields["param1"] == message_id
    ]


def confirmed(flight: Flight, from_s: float) -> list[TargetLine]:
    """The lines of confirmed targets from this flight time on."""
    return [
        line
        for line in flight.companion.targets("pad")
        if line.state == "confirmed" and flight.seen_at_s(line) > from_s
    ]


def local_errors(flight: Flight, lines: list[TargetLine]) -> list[tuple[float, float]]:
    """(distance, normalised square) of places from the truth in the local frame as it was when it became the world."""
    drift = Flow(flight.mock.flight, 0.01, flight.options.seed).error(WORLD_S)
    true = np.array(flight.mock.scene[0].at(0.0)[:2]) + np.array(drift[:2])
    found = []
    for line in lines:
        error = np.array((line.north, line.east)) - true
        found.append((float(np.hypot(*error)), float(error @ np.linalg.solve(np.array(line.cov)[:2, :2], error))))
    return found


def test_targets_stand_still_in_the_local_frame_and_have_no_place_on_the_earth():
    flight = fly(ROUND)
    assert flight.companion.codes.count(NoticeCode.LOCAL_WORLD) == 1
    assert flight.companion.lines[0].origin is None
    lines = confirmed(flight, 15.0)
    assert {line.track for line in lines} == {lines[0].track}, "one track"
    assert all(line.lat is line.lon is line.alt_amsl is None for line in lines)
    ground_m = 2.3  # the EKF's origin lies that far above the take-off ground
    assert np.mean([line.down for line in lines]) == pytest.approx(ground_m, abs=1.0)
    assert len(lines) > 400


def test_claims_in_the_local_frame_hold_the_drift_and_relative_to_the_vehicle_none_of_it():
    """The position drifts by up to 1.3 sigma of its claim along each axis, 0.8 m by the end."""
    squares, relative = [], []
    for seed in (6, 7, 9):
        flight = fly(ROUND.but({"seed": seed}))
        lines = [line for line in confirmed(flight, 20.0) if line.fix]
        errors = local_errors(flight, lines)
        assert np.median([error_m for error_m, _ in errors]) < 0.4
        squares.append(np.mean([square for _, square in errors]))
        relative.append(np.mean([flight.relative_error(line)[1] for line in lines]))
    assert np.mean(squares) < 3.0, "two degrees of freedom"
    assert np.mean(relative) < 2.0


def test_local_position_is_requested_only_where_no_global_one_comes():
    quiet = {"autopilot.streams": "arducopter", "autopilot.pitch_trim_deg": 0.0}
    without = requests_of(fly(ROUND.but({**quiet, "seconds": 20.0})), LOCAL_POSITION_NED)
    assert len(without) == 1
    assert 9.0 < without[0] < 16.0, "after the wait for a global position"
    beside = fly(ROUND.but({**quiet, "seconds": 20.0, "autopilot.gps": True}))
    assert requests_of(beside, LOCAL_POSITION_NED) == []
    assert requests_of(fly(ROUND.but({**quiet, "seconds": 20.0})), ODOMETRY) == [], "an ArduPilot has none"
    assert beside.companion.codes.count(NoticeCode.LOCAL_WORLD) == 0


RESET_S, STEP_M = 22.0, (0.5, -0.4)
ODOMETRY_ONLY = ROUND.but(
    {
        "seed": 6,
        "seconds": 30.0,
        "autopilot.firmware": "px4",
        "autopilot.local_message": "ODOMETRY",
        "autopilot.position_shifts": ((RESET_S, RESET_S, *STEP_M),),
    }
)


def test_odometry_where_only_that_comes_is_the_world_and_its_resets_are_steps_of_the_error():
    """The step of 0.64 m is less than what counts as a jump without the reset counter."""
    flight = fly(ODOMETRY_ONLY)
    asked = requests_of(flight, ODOMETRY)
    assert len(asked) == 1
    assert 9.0 < asked[0] < 16.0, "after the wait for a global position"
    assert flight.companion.codes.count(NoticeCode.LOCAL_WORLD) == 1
    assert flight.companion.codes.count(NoticeCode.POSITION_JUMPED) == 1
    lines = confirmed(flight, 17.0)
    assert {line.track for line in lines} == {lines[0].track}, "one track through the reset"
    after = [line for line in lines if RESET_S + 0.2 < flight.seen_at_s(line) < RESET_S + 2.0]
    assert len(after) > 20
    assert np.median([error_m for error_m, _ in local_errors(flight, after)]) < 0.4, "the target did not step"
    squares = [flight.relative_error(line)[1] for line in after if line.relative and line.fix]
    assert np.mean(squares) < 2.0, "two degrees of freedom; 4.4 without the counter"


def test_landing_target_indoors_is_in_nearly_every_frame_and_leads_to_the_pad():
    flight = fly(DOWN, LANDING)
    sent = [flight.mock.flight_s(now) for now, each in flight.companion.sent if each.name == "LANDING_TARGET"]
    first_s = sent[0]
    assert first_s < 15.0
    frames = [
        flight.seen_at_s(line)
        for line in flight.companion.targets("pad")
        if line.fix is not None and flight.seen_at_s(line) >= first_s
    ]
    assert len([at for at in sent if at <= frames[-1] + 0.2]) >= 0.95 * len(frames)
    assert max(after - before for before, after in pairwise(sent)) < 0.5
    true = flight.mock.scene[0].at(0.0)
    last = [
        hypot(each["north"] - true[0], each["east"] - true[1])
        for each in flight.accepted_landings
        if each["flight_s"] > 34.0
    ]
    assert np.median(last) < 0.1
    assert not flight.refused_landings
    assert not flight.companion.texts(NoticeCode.LANDING_WITHHELD)


def test_filter_that_does_not_vouch_for_its_local_position_leaves_targets_relative_to_the_vehicle():
    flight = fly(ROUND.but({"seconds": 20.0, "autopilot.flow_lost_s": ((0.0, 100.0),)}))
    assert flight.companion.codes.count(NoticeCode.LOCAL_WORLD) == 0
    assert flight.companion.codes.count(NoticeCode.RELATIVE_WORLD) == 1


def test_tracks_outlive_the_first_global_position_and_lie_on_the_earth_from_then_on():
    flight = fly(ROUND.but({"seed": 7, "autopilot.gps": True, "autopilot.gps_fix_at_s": 25.0}))
    assert flight.companion.texts_to_ground(NoticeCode.POSITION_SOURCE) == ["global position: tracks stay"]
    lines = confirmed(flight, 15.0)
    assert {line.track for line in lines} == {lines[0].track}, "one track through the change"
    assert "origin_set" not in {line.reason for line in flight.companion.targets()}
    (origin,) = [line for line in flight.companion.lines if isinstance(line, OriginLine)]
    assert origin.lat == origin.origin.lat
    before = [line for line in lines if flight.seen_at_s(line) < 24.4]  # written before the change
    after = [line for line in lines if flight.seen_at_s(line) > 25.6]
    assert all(line.lat is None for line in before)
    assert all(line.lat is not None for line in after)
    assert abs(after[0].north - before[-1].north) < 0.3, "NED's zero stays"
    assert abs(after[0].east - before[-1].east) < 0.3
    truth = flight.mock.world.place(flight.mock.scene[0].at(0.0))
    for line in after[:: len(after) // 10]:
        north_m = (line.lat - truth.lat) * 111_195.0
        east_m = (line.lon - truth.lon) * 111_195.0 * np.cos(np.radians(truth.lat))
        error = np.array((north_m, east_m))
        assert error @ np.linalg.solve(np.array(line.cov)[:2, :2], error) < 13.8, "99.9 %"


def test_tracks_outlive_a_loss_of_the_global_position_and_its_return():
    lost = {"seed": 7, "autopilot.gps": True, "autopilot.gps_lost_s": ((18.0, 28.0),)}
    flight = fly(ROUND.but(lost))
    assert flight.companion.texts_to_ground(NoticeCode.POSITION_SOURCE) == [
        "global position lost: the local one carries on",
        "global position: tracks stay",
    ]
    lines = confirmed(flight, 10.0)
    assert {line.track for line in lines} == {lines[0].track}
    assert all(line.lat is not None for line in lines), "NED's zero keeps its place on the earth"
    assert len([line for line in flight.companion.lines if isinstance(line, OriginLine)]) == 2
    seen = [flight.seen_at_s(line) for line in lines if line.fix is not None]
    assert max(np.diff(seen)) < 1.5, "fixes go on"
    relative = [flight.relative_error(line) for line in lines if line.relative and line.fix]
    assert np.mean([nis for _, nis in relative]) < 2.5


@pytest.mark.slow
def test_self_calibration_in_the_local_frame_finds_the_delay_within_its_claim():
    """A swinging body shows it, in the autopilot's local frame as anywhere."""
    flight = fly(scenario("flow").but({"seed": 3, "seconds": 35.0, "biases.time_offset_s": 0.02}), CALIBRATED)
    assert flight.companion.codes.count(NoticeCode.LOCAL_WORLD) == 1
    last = [line for line in flight.companion.lines if isinstance(line, CalibrationLine)][-1]
    assert abs(last.time_offset_s - 0.02) < 3.0 * last.time_offset_sigma_s
    assert last.time_offset_sigma_s < 0.005, "half of the prior's"
