"""The camera component: its answers to ground stations that ask for camera information."""

from math import inf, isnan, nan

import pytest
from camera_component import IMAGE, OPTIONS, SIZE, command, named, run
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.camera import parse_calibration
from fwav_companion.publishing.camera_information import horizontal_fov_deg
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import CommandAnswer, CommandResult, Destination

PARAMETER = st.floats(width=32, allow_nan=True, allow_infinity=True)


@pytest.fixture
def publisher():
    return Publisher(OPTIONS)


@pytest.mark.parametrize(("number", "param"), [(512, 259.0), (521, 1.0), (521, 0.0), (521, nan)])
def test_camera_information_by_both_requests_also_as_mission_planner_sends_the_old_one(publisher, world, number, param):
    answer = publisher.on_command(command(number, param), world.situation())
    assert answer.result is CommandResult.ACCEPTED
    (out,) = answer.messages
    got = world.packed(out)
    assert (out.to, out.link, out.component) == (Destination.REPLY, "ground", 100)
    assert got["flags"] == (
        mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT
        | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
        | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_GEO_STATUS
        | mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
    )
    assert (got["resolution_h"], got["resolution_v"]) == SIZE
    assert got["firmware_version"] == 0x00030201
    assert bytes(got["vendor_name"]).rstrip(b"\0") == b"fwav-companion"
    assert got["cam_definition_uri"] == ""
    assert isnan(got["focal_length"])


@pytest.mark.parametrize(
    ("number", "param", "name"),
    [
        (512, 260.0, "CAMERA_SETTINGS"),
        (522, 1.0, "CAMERA_SETTINGS"),
        (512, 261.0, "STORAGE_INFORMATION"),
        (525, 0.0, "STORAGE_INFORMATION"),
        (525, 1.0, "STORAGE_INFORMATION"),
        (512, 262.0, "CAMERA_CAPTURE_STATUS"),
        (527, 1.0, "CAMERA_CAPTURE_STATUS"),
        (512, 269.0, "VIDEO_STREAM_INFORMATION"),
        (2504, 0.0, "VIDEO_STREAM_INFORMATION"),
        (2504, 1.0, "VIDEO_STREAM_INFORMATION"),
        (512, 270.0, "VIDEO_STREAM_STATUS"),
        (2505, 1.0, "VIDEO_STREAM_STATUS"),
    ],
)
def test_what_ground_stations_ask_a_camera_for(publisher, world, number, param, name):
    answer = publisher.on_command(command(number, param), world.situation())
    assert answer.result is CommandResult.ACCEPTED
    (out,) = answer.messages
    assert (out.name, out.to, out.link, out.component) == (name, Destination.REPLY, "ground", 100)
    world.packed(out)


def described(options, world, *request):
    """The fields of the answer, as pymavlink decodes them."""
    (out,) = Publisher(options).on_command(command(*request), world.situation()).messages
    return world.packed(out)


@pytest.mark.parametrize(
    ("uri", "kind", "shown", "encoding"),
    [
        ("rtsp://10.0.0.2/live", mavlink.VIDEO_STREAM_TYPE_RTSP, "rtsp://10.0.0.2/live", 0),
        ("RTSP://10.0.0.2:8554/live", mavlink.VIDEO_STREAM_TYPE_RTSP, "RTSP://10.0.0.2:8554/live", 0),
        ("udp://0.0.0.0:5600", mavlink.VIDEO_STREAM_TYPE_RTPUDP, "5600", 0),
        ("rtp://@:5004/", mavlink.VIDEO_STREAM_TYPE_RTPUDP, "5004", 0),
        ("udp://5600", mavlink.VIDEO_STREAM_TYPE_RTPUDP, "5600", 0),
        ("udp://[::1]:5600", mavlink.VIDEO_STREAM_TYPE_RTPUDP, "5600", 0),
        ("udp://somewhere", mavlink.VIDEO_STREAM_TYPE_RTPUDP, "udp://somewhere", 0),
        ("udp265://0.0.0.0:5600", mavlink.VIDEO_STREAM_TYPE_RTPUDP, "5600", mavlink.VIDEO_STREAM_ENCODING_H265),
        ("mpegts://0.0.0.0:5601", mavlink.VIDEO_STREAM_TYPE_MPEG_TS, "5601", 0),
        ("tcp://10.0.0.2:5602", mavlink.VIDEO_STREAM_TYPE_TCP_MPEG, "tcp://10.0.0.2:5602", 0),
    ],
)
def test_the_video_stream_by_its_uri(world, uri, kind, shown, encoding):
    """common.xml: for RTP over UDP and for MPEG-TS the URI is the port number, and stations prepend the rest."""
    got = described(PublishOptions(image_size=SIZE, hfov_deg=54.6, video_uri=uri), world, 512, 269.0)
    assert (got["uri"], got["type"], got["encoding"]) == (shown, kind, encoding)
    assert (got["stream_id"], got["count"], got["flags"]) == (1, 1, mavlink.VIDEO_STREAM_STATUS_FLAGS_RUNNING)
    assert (got["resolution_h"], got["resolution_v"], got["hfov"]) == (*SIZE, 55)


def test_the_streams_status_agrees_with_its_information(world):
    options = PublishOptions(image_size=SIZE, hfov_deg=54.6, video_uri="rtsp://10.0.0.2/live")
    information, status = (described(options, world, 512, number) for number in (269.0, 270.0))
    for name in ("stream_id", "flags", "framerate", "resolution_h", "resolution_v", "bitrate", "rotation", "hfov"):
        assert status[name] == information[name]


def test_a_storage_that_is_not_the_operators_is_shown_as_not_supported(world):
    """Then QGroundControl neither repeats its request nor shows a capacity."""
    got = described(PublishOptions(image_size=SIZE), world, 525, 0.0, 1.0)
    assert (got["storage_id"], got["storage_count"]) == (1, 1)
    assert got["status"] == mavlink.STORAGE_STATUS_NOT_SUPPORTED


def test_the_camera_is_idle_in_video_mode_and_on_its_gimbal(world):
    options = PublishOptions(image_size=SIZE, gimbal_device_id=154)
    assert described(options, world, 522, 1.0)["mode_id"] == mavlink.CAMERA_MODE_VIDEO
    status = described(options, world, 527, 1.0)
    assert (status["image_status"], status["video_status"]) == (0, 0)
    assert described(options, world, 512, 259.0)["gimbal_device_id"] == 154


@pytest.mark.parametrize("asked", [(510, 275.0), (512, 244.0, 275.0)])
def test_the_interval_by_both_requests(world, asked):
    got = described(OPTIONS, world, *asked)
    assert (got["message_id"], got["interval_us"]) == (275, 100_000)


@pytest.mark.parametrize(
    ("k1_mm", "max_angle_deg", "expected"), [(3.55, 75.0, 54.9), (3.55, 20.0, 40.0), (1.5, 95.0, 130.0)]
)
def test_the_horizontal_field_of_view_is_that_of_the_lens(k1_mm, max_angle_deg, expected):
    """Field of view of an equidistant lens: width over focal length, both in millimetres; a narrower limit of the lens
    applies.
    """
    text = (
        f"model: kannala_brandt\nimage_size: [640, 480]\nk_mm: [{k1_mm}, 0.0, 0.0, 0.0, 0.0]\n"
        f"pixels_per_mm: [188.0, 188.0]\nprincipal_point: [300.0, 240.0]\nmax_angle_deg: {max_angle_deg}\n"
    )
    assert horizontal_fov_deg(parse_calibration(text, "camera.yaml").lens) == pytest.approx(expected, abs=0.1)


def test_without_a_video_there_is_none_to_offer(world):
    publisher = Publisher(PublishOptions(image_size=SIZE))
    assert publisher.on_command(command(512, 269.0), world.situation()) is None
    (out,) = publisher.on_command(command(512, 259.0), world.situation()).messages
    assert not out.fields["flags"] & mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        (command(512, 263.0), None),
        (command(2000), None),
        (command(512, nan), CommandResult.DENIED),
        (command(521, 2.0), CommandResult.DENIED),
        (command(2504, 2.0), CommandResult.DENIED),
        (command(525, 2.0), CommandResult.DENIED),
        (command(512, 269.0, 2.0), CommandResult.DENIED),
        (command(512, 244.0, 30.0), CommandResult.DENIED),
        (command(511, 0.0, 1e5), CommandResult.DENIED),
        (command(511, 275.0, nan), CommandResult.DENIED),
        (command(511, inf, 1e5), CommandResult.DENIED),
        (command(512, 276.0), CommandResult.FAILED),
        (command(512, 259.0, component=191), None),
    ],
)
def test_what_it_does_not_know_and_what_is_no_request(publisher, world, asked, answer):
    got = publisher.on_command(asked, world.situation())
    assert (got.result if got is not None else None) is answer


def test_with_tracking_off_there_is_no_camera(world):
    publisher = Publisher(PublishOptions(image_size=SIZE, camera_tracking=False))
    assert publisher.on_command(command(512, 259.0), world.situation()) is None
    assert not named(run(publisher, world, 1.0, (1,)), IMAGE)


@settings(derandomize=True, max_examples=300)
@given(
    number=st.sampled_from([510, 511, 512, 521, 522, 525, 527, 2004, 2005, 2010, 2504, 2505, 7]),
    params=st.tuples(*[PARAMETER | st.sampled_from([0.0, 1.0, 0.5, 275.0, 276.0, 259.0, -1.0])] * 7),
)
def test_no_parameter_whatever_disturbs_it(world, number, params):
    publisher = Publisher(OPTIONS)
    run(publisher, world, 0.05, (1,))
    answer = publisher.on_command(command(number, *params), world.situation())
    assert answer is None or isinstance(answer, CommandAnswer)
    for out in answer.messages if answer is not None else ():
        world.packed(out)
