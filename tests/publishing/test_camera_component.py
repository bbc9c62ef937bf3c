"""The camera component: what it says when ground stations ask a camera what it is."""

from math import inf, isnan, nan

import pytest
from camera_component import IMAGE, OPTIONS, SIZE, command, named, run
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import CommandAnswer, CommandResult, Destination

PARAMETER = st.floats(width=32, allow_nan=True, allow_infinity=True)


@pytest.fixture
def publisher():
    return Publisher(OPTIONS)


@pytest.mark.parametrize(("number", "param"), [(512, 259.0), (521, 1.0)])
def test_camera_information_by_both_requests(publisher, world, number, param):
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
    (out,) = publisher.on_command(command(number, param), world.situation()).messages
    assert out.name == name
    world.packed(out)


def test_the_video_stream_tells_its_address(publisher, world):
    (out,) = publisher.on_command(command(512, 269.0), world.situation()).messages
    got = world.packed(out)
    assert (got["uri"], got["type"], got["count"]) == ("rtsp://10.0.0.2/live", mavlink.VIDEO_STREAM_TYPE_RTSP, 1)


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
        (command(521, 0.0), CommandResult.DENIED),
        (command(2504, 2.0), CommandResult.DENIED),
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
    number=st.sampled_from([510, 511, 512, 521, 522, 527, 2004, 2005, 2010, 2504, 2505, 7]),
    params=st.tuples(*[PARAMETER | st.sampled_from([0.0, 1.0, 0.5, 275.0, 276.0, 259.0, -1.0])] * 7),
)
def test_no_parameter_whatever_disturbs_it(world, number, params):
    publisher = Publisher(OPTIONS)
    run(publisher, world, 0.05, (1,))
    answer = publisher.on_command(command(number, *params), world.situation())
    assert answer is None or isinstance(answer, CommandAnswer)
    for out in answer.messages if answer is not None else ():
        world.packed(out)
