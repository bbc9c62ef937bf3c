"""A camera on a gimbal, over the wire: the mock rotates it by its own geometry, and the pipeline must locate the
target.
"""

import pytest
from draws import first_of
from flying import fly

from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import SightingLine
from fwav_companion.replay import read_recording, replay
from fwav_companion.types import NoticeCode
from sitl_mock import scenario
from sitl_mock.scenarios import NO_NOISE, NO_TROUBLE

BEHIND_AUTOPILOT, OWN_COMPONENT = 1, 154


def flown(device_id, *settings, seconds=9.0, **differences):
    options = scenario("gimbal").but(
        {"seconds": seconds, "gimbal.device_id": device_id, **NO_NOISE, **NO_TROUBLE, **differences}
    )
    return fly(
        options,
        [f"camera.mount.gimbal_device_id={device_id}", "camera.mount.pitch_deg=0.0", "camera.readout_s=0.0", *settings],
    )


def errors_m(flight, from_s=4.0):
    start = flight.options.start_unix_s + from_s
    lines = [line for line in flight.companion.targets() if line.fix and line.time_unix >= start]
    return [flight.error_m(line) for line in lines]


YAWS = ("north", "vehicle", "vehicle_and_delta", "old_lock", "old_follow")


@pytest.mark.parametrize(
    "yaw_and_device",
    first_of(
        *((yaw, BEHIND_AUTOPILOT) for yaw in YAWS),
        *((yaw, OWN_COMPONENT) for yaw in reversed(YAWS)),  # old_follow and old_lock are messages of their own
        few=7,
    ),
)
def test_the_target_is_found_however_the_gimbal_reports_its_yaw(yaw_and_device):
    yaw, device_id = yaw_and_device
    errors = errors_m(flown(device_id, **{"gimbal.yaw": yaw}))
    assert len(errors) > 80
    most_m = {BEHIND_AUTOPILOT: 0.01, OWN_COMPONENT: 0.03}[device_id]  # a clock by arrivals is a millisecond late
    assert max(errors) < most_m, "the vehicle rolls and flaps by degrees: counted twice, they were half a metre"


def test_the_gimbal_behind_the_autopilot_is_asked_for_and_the_other_is_not():
    asked = [
        {message.fields["param1"] for _, message in flight.companion.sent if message.fields.get("command") == 511}
        for flight in (flown(BEHIND_AUTOPILOT, seconds=6.0), flown(OWN_COMPONENT, seconds=6.0))
    ]
    assert 285.0 in asked[0]
    assert 285.0 not in asked[1]


def test_a_gimbal_that_falls_silent_gives_no_fixes_and_says_why():
    flight = flown(OWN_COMPONENT, **{"gimbal.silent_from_s": 6.0})
    silent = flight.options.start_unix_s + 6.0 + 0.35
    assert not [line for line in flight.companion.targets() if line.fix and line.time_unix > silent]
    assert flight.companion.lines[-1].dropped["stale_gimbal"] > 30
    reported = flight.companion.pipeline.status(flight.companion._now)
    assert reported.telemetry.gimbal.age_s > 2.0
    assert reported.sight.refused is None


def test_another_gimbal_is_not_ours():
    flight = fly(
        scenario("gimbal").but({"seconds": 5.0}),
        ["camera.mount.gimbal_device_id=155", "camera.mount.pitch_deg=0.0", "camera.readout_s=0.0"],
    )
    assert not flight.companion.targets()
    assert flight.companion.lines[-1].dropped["no_gimbal"] > 30


def test_a_fixed_camera_pays_no_heed_to_a_gimbal():
    options = scenario("perfect").but({"seconds": 6.0})
    with_gimbal_messages = options.but({"autopilot.rates_hz": {"GIMBAL_DEVICE_ATTITUDE_STATUS": 10.0}})
    settings = ["camera.readout_s=0.0"]
    assert errors_m(fly(options, settings)) == errors_m(fly(with_gimbal_messages, settings))


@pytest.mark.parametrize(("configured", "reports"), [(0, 1), (154, 0)])
def test_a_gimbal_that_is_heard_and_not_configured_is_reported_once(configured, reports):
    options = scenario("gimbal").but({"seconds": 5.0})
    settings = [f"camera.mount.gimbal_device_id={configured}", "camera.mount.pitch_deg=0.0", "camera.readout_s=0.0"]
    assert fly(options, settings).companion.codes.count(NoticeCode.GIMBAL_UNUSED) == reports


@pytest.mark.parametrize("device_id", [BEHIND_AUTOPILOT, OWN_COMPONENT])
def test_a_recorded_flight_replays_to_the_line(device_id):
    options = scenario("gimbal").but({"seconds": 8.0, "gimbal.device_id": device_id, "downlink.loss": 0.1})
    companion = fly(
        options, [f"camera.mount.gimbal_device_id={device_id}", "camera.mount.pitch_deg=0.0"], sightings=True
    ).companion
    recording = read_recording(bytes(companion.tlog), bytes(companion.detections), own_components(companion.config))
    assert list(replay(recording, companion.config, companion.calibration, sightings=True)) == companion.lines
    assert any(isinstance(line, SightingLine) and line.q_ned_gimbal for line in companion.lines)
