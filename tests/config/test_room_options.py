"""Each key reaches its room: every value differs from its default, and is in the room's unit."""

from pathlib import Path

import msgspec

from fwav_companion.camera import Calibration, KannalaBrandt
from fwav_companion.config import parse
from fwav_companion.config.room_options import (
    camera_timing,
    link_policies,
    publish_options,
    recording_plan,
    signing_policy,
    telemetry_options,
    tracking_options,
    version_numbers,
)
from fwav_companion.mavlink.router.node import LinkPolicy
from fwav_companion.pairing import CameraTiming, StampRule
from fwav_companion.publishing.options import PublishTable
from fwav_companion.telemetry import TelemetryOptions

TEXT = """
[vehicle]
component_id = 192
position = "none"
attitude_message = "ATTITUDE"
position_delay_s = 0.25
[[link]]
name = "radio"
url = "serial:///dev/ttyAMA0:57600"
role = "autopilot"
[[link]]
name = "ground"
url = "udpout://127.0.0.1:14550"
role = "gcs"
max_rate_hz = { ATTITUDE = 4 }
forward_rate_requests = true
[signing]
accept_unsigned = ["ground"]
[camera]
calibration = "camera.yaml"
stamp = "row0_start"
exposure_s = 0.004
time_offset_s = 0.02
readout_s = -0.03
[camera.mount]
pitch_deg = 0.0
position_m = [0.1, 0.2, 0.3]
gimbal_device_id = 3
gimbal_delay_s = 0.04
[uncertainty]
attitude_stamp_delay_s = 0.005
[tracking]
alpha = 0.5
[publish]
select = "operator"
label = "person"
rate_hz = 7
camera_tracking = false
landing_target = true
landing_label = "pad"
landing_max_sigma_m = 0.7
distance_sensor = true
statustext = false
named_values = false
adsb = true
cot = "udpout://239.2.3.1:6969"
cot_type = "a-h-G"
cot_callsign = "T"
cot_rate_hz = 2
cot_stale_s = 20
cot_target_stale_s = 600
cot_vehicle = false
cot_client_cert = "unit.p12"
cot_client_key = "unit.key"
cot_password_file = "password"
cot_ca = "ca.pem"
cot_server_name = "tak.example"
cot_package = "dp.zip"
video_uri = "rtsp://10.0.0.1/main"
video_delay_s = 0.6
[record]
directory = "records"
when = "armed"
sync_s = 0.5
max_used_mb = 10
min_free_mb = 20
remove_oldest = true
"""
CONFIG = parse(TEXT, "/flights/one/flight.toml")
CALIBRATION = Calibration(KannalaBrandt((1.0,), (300.0, 300.0), (320.0, 240.0), (640, 480)), time_offset_s=0.5)


def test_links():
    assert link_policies(CONFIG) == [
        LinkPolicy("radio", "autopilot", max_bytes_per_s=0.7 * 57600 / 10),
        LinkPolicy("ground", "gcs", {"ATTITUDE": 4.0}, forward_rate_requests=True, datagrams=True),
    ]


def test_signing():
    key = bytes(range(32))
    policy = signing_policy(CONFIG, key, 77)
    assert policy is not None
    assert (policy.key, policy.timestamp, policy.accept_unsigned) == (key, 77, {"ground"})
    assert signing_policy(CONFIG, None, 77) is None


def test_telemetry():
    expected = TelemetryOptions(
        position="none",
        attitude_message="ATTITUDE",
        position_delay_s=0.25,
        attitude_stamp_delay_s=0.005,
        gimbal_device_id=3,
        gimbal_delay_s=0.04,
    )
    assert telemetry_options(CONFIG, None) == expected
    assert telemetry_options(CONFIG, 60.0).attitudes_kept_s == 60.0


def test_camera():
    assert camera_timing(CONFIG, CALIBRATION) == CameraTiming(
        time_offset_s=0.02, readout_s=-0.03, stamp_rule=StampRule.ROW0_START, exposure_s=0.004
    )
    silent = parse(TEXT.replace("time_offset_s = 0.02\n", ""), "f.toml")
    assert camera_timing(silent, CALIBRATION).time_offset_s == 0.5


def test_tracking():
    assert tracking_options(CONFIG).alpha == 0.5


def test_publishing():
    options = publish_options(CONFIG, CALIBRATION, "unit")
    written = msgspec.structs.asdict(CONFIG.publish)
    assert {name: getattr(options, name) for name in written} == written
    default = PublishTable()
    assert all(getattr(options, name) != getattr(default, name) for name in PublishTable.__struct_fields__)
    assert options.image_size == (640, 480)
    assert options.camera_position_m == (0.1, 0.2, 0.3)
    assert (options.companion_component, options.camera_component) == (192, 100)
    assert (options.version, options.unit) == (version_numbers(), "unit")
    assert publish_options(CONFIG, None, "").image_size == (0, 0)


def test_recording():
    plan = recording_plan(CONFIG, {"a": b"b"})
    assert plan is not None
    assert plan.directory == Path("/flights/one/records")
    assert (plan.when, plan.sync_s, plan.extra_files) == ("armed", 0.5, {"a": b"b"})
    space = plan.space
    assert (space.most_used_bytes, space.least_free_bytes, space.remove_oldest) == (10_000_000, 20_000_000, True)
    assert recording_plan(parse(TEXT.replace('directory = "records"', ""), "f.toml"), {}) is None
