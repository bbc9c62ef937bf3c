"""The camera component: what it says when asked, what a click selects, and its two statuses field by field."""

from math import atan2, inf, isnan, nan

import numpy as np
import pymap3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.nouns import Command, CommandAnswer, CommandResult, Destination, TrackState
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher

MS = 10**6
SIZE = (640, 480)
OPTIONS = PublishOptions(
    image_size=SIZE, named_values=False, statustext=False, version=(1, 2, 3), video_uri="rtsp://10.0.0.2/live"
)
IMAGE, GEO = "CAMERA_TRACKING_IMAGE_STATUS", "CAMERA_TRACKING_GEO_STATUS"
PARAMETER = st.floats(width=32, allow_nan=True, allow_infinity=True)


def command(number, *params, sender=(255, 190), component=100):
    params = (*params, *(0.0,) * (7 - len(params)))
    return Command(
        number=number, params=params, system=sender[0], component=sender[1], link="ground", to_component=component
    )


@pytest.fixture
def publisher():
    return Publisher(OPTIONS)


def run(publisher, world, seconds, tracks=(), start=None, step_ms=5, **situation):
    """Messages by name over some seconds, with a frame of these tracks every 50 ms."""
    start = start if start is not None else world.NOW
    sent = []
    for tick in range(round(seconds * 1000 / step_ms)):
        now = start + tick * step_ms * MS
        moment = world.situation(now=now, **situation)
        if tick * step_ms % 50 == 0:
            sent += publisher.on_tracks(tuple(world.track(n, at=now) for n in tracks), moment)
        while publisher.wake_at is not None and publisher.wake_at <= now:
            sent += publisher.on_wake(now, moment)
    return sent


def named(sent, name):
    return [one for one in sent if one.name == name]


# What it is.


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


# Where the target is.


def test_geo_status_field_by_field(publisher, world):
    moving = world.track(
        position_ned=(40.0, -25.0, 3.0),
        velocity_ned=(1.0, 2.0, 0.0),
        velocity_cov=world.diagonal(0.1, 0.2, 0.05),
        cov=((1.3, 0.5, 0.0), (0.5, 0.9, 0.0), (0.0, 0.0, 0.49)),
    )
    sent = publisher.on_tracks((moving,), world.situation(vehicle=world.state(position=(10.0, -5.0, -27.0))))
    (out,) = named(sent, GEO)
    got = world.packed(out)
    origin = (world.ORIGIN.lat_deg, world.ORIGIN.lon_deg, world.ORIGIN.alt_amsl_m)
    lat, lon, _ = pymap3d.ned2geodetic(40.0, -25.0, 0.0, *origin)
    assert got["tracking_status"] == mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
    assert got["lat"] / 1e7 == pytest.approx(lat, abs=1e-7)
    assert got["lon"] / 1e7 == pytest.approx(lon, abs=1e-7)
    assert got["alt"] == pytest.approx(485.0)
    assert got["h_acc"] == pytest.approx(np.sqrt(np.linalg.eigvalsh([[1.3, 0.5], [0.5, 0.9]])[1]), rel=1e-6)
    assert got["v_acc"] == pytest.approx(0.7)
    assert (got["vel_n"], got["vel_e"], got["vel_d"]) == (1.0, 2.0, 0.0)
    assert got["vel_acc"] == pytest.approx(0.2)
    assert got["dist"] == pytest.approx(np.linalg.norm([30.0, -20.0, 30.0]), rel=1e-6)
    assert got["hdg"] == pytest.approx(atan2(2.0, 1.0), rel=1e-6)
    assert (out.component, out.to) == (100, Destination.GROUND)


def test_what_is_unknown_is_nan_and_not_zero(publisher, world):
    (out,) = named(publisher.on_tracks((world.track(),), world.situation(vehicle=None)), GEO)
    got = world.packed(out)
    assert all(isnan(got[name]) for name in ("vel_n", "vel_e", "vel_d", "vel_acc", "dist", "hdg", "hdg_acc"))


def test_a_target_that_may_stand_still_has_no_heading(publisher, world):
    slow = world.track(velocity_ned=(0.1, 0.1, 0.0), velocity_cov=world.diagonal(0.2, 0.2, 0.2))
    (out,) = named(publisher.on_tracks((slow,), world.situation()), GEO)
    assert isnan(out.fields["hdg"])
    assert not isnan(out.fields["vel_n"])


def test_without_a_global_position_no_latitude_is_made_up(publisher, world):
    sent = publisher.on_tracks((world.track(),), world.situation(plane=None))
    assert not named(sent, GEO)
    assert named(sent, IMAGE)


def test_a_covariance_that_is_none_is_unknown_accuracy_and_not_perfect(publisher, world):
    broken = world.track(cov=((nan,) * 3,) * 3)
    (out,) = named(publisher.on_tracks((broken,), world.situation()), GEO)
    assert isnan(out.fields["h_acc"])
    assert isnan(out.fields["v_acc"])


def test_image_status_of_a_point(publisher, world):
    seen = world.track(fix=world.fix(pixel=(159.5, 359.5), sigma_px=8.0))
    (out,) = named(publisher.on_tracks((seen,), world.situation()), IMAGE)
    got = world.packed(out)
    assert (got["tracking_status"], got["tracking_mode"]) == (1, mavlink.CAMERA_TRACKING_MODE_POINT)
    assert got["target_data"] == mavlink.CAMERA_TRACKING_TARGET_DATA_IN_STATUS
    assert (got["point_x"], got["point_y"]) == (0.25, 0.75)
    assert got["radius"] == pytest.approx(3 * 8.0 / 640)
    assert all(isnan(got[name]) for name in ("rec_top_x", "rec_top_y", "rec_bottom_x", "rec_bottom_y"))


def test_image_status_of_a_box(publisher, world):
    seen = world.track(fix=world.fix(box=(-0.5, 119.5, 319.5, 479.5)))
    (out,) = named(publisher.on_tracks((seen,), world.situation()), IMAGE)
    got = world.packed(out)
    assert got["tracking_mode"] == mavlink.CAMERA_TRACKING_MODE_RECTANGLE
    assert [got[f"rec_{name}"] for name in ("top_x", "top_y", "bottom_x", "bottom_y")] == [0.0, 0.25, 0.5, 1.0]
    assert all(isnan(got[name]) for name in ("point_x", "point_y", "radius"))


def test_a_predicted_target_has_its_own_bit_and_no_pixel_that_nobody_knows(publisher, world):
    coasting = world.track(state=TrackState.COASTING, with_fix=False)
    image, geo = publisher.on_tracks((coasting,), world.situation())
    assert image.fields["tracking_status"] == geo.fields["tracking_status"] == 1 | 8
    assert isnan(image.fields["point_x"])


def test_a_predicted_target_is_shown_where_it_should_be(publisher, world):
    coasting = world.track(state=TrackState.COASTING, with_fix=False)
    image, _ = publisher.on_tracks((coasting,), world.situation(), lambda ned: (319.5, 239.5))
    assert (image.fields["point_x"], image.fields["point_y"]) == (0.5, 0.5)


def test_when_the_pictures_stop_the_target_coasts_and_then_there_is_none(publisher, world):
    publisher.on_tracks((world.track(),), world.situation())
    seen = {}
    for second in range(1, 15):
        now = world.NOW + second * world.S
        seen[second] = [one.fields["tracking_status"] for one in publisher.on_wake(now, world.situation(now=now))]
    assert seen[2] == [9, 9]
    assert seen[9] == [9, 9]
    assert seen[11] == [0]
    assert seen[14] == []


def test_when_no_target_is_left_idle_is_told_three_times_and_then_nothing(publisher, world):
    run(publisher, world, 0.5, (1,))
    sent = run(publisher, world, 3.0, (), start=world.NOW + world.S)
    assert [one.fields["tracking_status"] for one in sent] == [0, 0, 0]
    assert {one.name for one in sent} == {IMAGE}


# How often.


def test_both_statuses_at_the_configured_rate_and_seldom_through_the_autopilots_link(publisher, world):
    sent = run(publisher, world, 10.0, (1,))
    for name in (IMAGE, GEO):
        assert len(named(sent, name)) == pytest.approx(100, abs=2)
        assert sum(one.to is Destination.GROUND for one in named(sent, name)) == pytest.approx(20, abs=1)
        assert {one.to for one in named(sent, name)} == {Destination.GROUND, Destination.GROUND_LINKS}


@pytest.mark.parametrize(
    ("interval_us", "hz"), [(500_000.0, 2), (50_000.0, 20), (10.0, 50), (1e30, 0.1), (-1.0, 0), (0.0, 0)]
)
def test_the_interval_on_request_with_both_spellings_of_stop(publisher, world, interval_us, hz):
    run(publisher, world, 0.5, (1,))
    answer = publisher.on_command(command(511, 275.0, interval_us), world.situation(now=world.NOW + world.S))
    assert answer.result is CommandResult.ACCEPTED
    sent = run(publisher, world, 10.0, (1,), start=world.NOW + world.S)
    assert len(named(sent, IMAGE)) == pytest.approx(10 * hz, abs=1.5)
    assert len(named(sent, GEO)) == pytest.approx(100, abs=2)
    assert {one.to for one in named(sent, IMAGE)} <= {Destination.GROUND}


def test_a_station_that_stops_it_stops_it_for_itself(publisher, world):
    now = world.NOW + world.S
    publisher.on_command(command(511, 275.0, 200_000.0), world.situation(now=now))
    publisher.on_command(command(511, 275.0, 500_000.0, sender=(254, 190)), world.situation(now=now))
    (told,) = publisher.on_command(command(510, 275.0), world.situation(now=now)).messages
    assert told.fields == {"message_id": 275, "interval_us": 200_000}
    publisher.on_command(command(511, 275.0, -1.0), world.situation(now=now))
    assert len(named(run(publisher, world, 10.0, (1,), start=now), IMAGE)) == pytest.approx(20, abs=1.5)
    (told,) = publisher.on_command(command(510, 275.0), world.situation(now=now)).messages
    assert told.fields == {"message_id": 275, "interval_us": 500_000}


# Clicks.


def click(publisher, world, at, x, y, radius=0.0, number=2004):
    params = (x, y, radius) if number == 2004 else (x, y, radius[0], radius[1])
    return publisher.on_command(command(number, *params), world.situation(now=at))


def show(publisher, world, at, *places):
    """A frame with track numbers at normalized places, all of equal age."""
    tracks = tuple(
        world.track(number, at=at, confirmed_at=world.NOW - world.S, fix=world.fix(pixel=pixel, box=box, at=at))
        for number, (pixel, box) in enumerate(places, start=1)
    )
    publisher.on_tracks(tracks, world.situation(now=at))


def test_a_click_selects_what_was_there_when_the_picture_was_taken(publisher, world):
    """The two swap places every 100 ms: only the picture of 300 ms ago tells which one was meant."""
    left, right = ((120.0, 240.0), None), ((520.0, 240.0), None)
    for count in range(10):
        places = (left, right) if count % 2 == 0 else (right, left)
        show(publisher, world, world.NOW + count * 100 * MS, *places)
    shown = 6  # 1 is on the left there
    answer = click(publisher, world, world.NOW + (shown * 100 + 300) * MS, 120.5 / 640, 240.5 / 480)
    assert answer.result is CommandResult.ACCEPTED
    assert publisher.selected.id == 1
    click(publisher, world, world.NOW + (7 * 100 + 300) * MS, 120.5 / 640, 240.5 / 480)
    assert publisher.selected.id == 2


def test_a_click_beside_every_target_fails_and_says_so(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), None))
    answer = click(publisher, world, world.NOW + 300 * MS, 0.8, 0.5)
    assert answer.result is CommandResult.FAILED
    (text,) = answer.messages
    assert (text.name, text.fields["text"], text.link) == ("STATUSTEXT", "tracking: no target there", "ground")


def test_a_click_of_a_time_without_a_picture_fails(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), None))
    assert click(publisher, world, world.NOW + 600 * MS, 0.2, 0.5).result is CommandResult.FAILED


def test_the_box_is_the_target_and_the_radius_widens_the_click(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), (100.0, 60.0, 140.0, 260.0)))
    at = world.NOW + 300 * MS
    assert click(publisher, world, at, 120 / 640, 70 / 480).result is CommandResult.ACCEPTED
    assert click(publisher, world, at, 220 / 640, 240 / 480).result is CommandResult.FAILED
    assert click(publisher, world, at, 220 / 640, 240 / 480, radius=0.2).result is CommandResult.ACCEPTED


def test_a_rectangle_takes_the_target_nearest_to_its_middle_however_it_was_drawn(publisher, world):
    show(publisher, world, world.NOW, ((120.0, 240.0), None), ((300.0, 240.0), None))
    at = world.NOW + 300 * MS
    answer = click(publisher, world, at, 0.7, 0.9, (0.1, 0.2), number=2005)
    assert answer.result is CommandResult.ACCEPTED
    assert publisher.selected.id == 2
    assert click(publisher, world, at, 0.8, 0.1, (0.9, 0.2), number=2005).result is CommandResult.FAILED


@pytest.mark.parametrize("point", [(nan, 0.5), (0.5, nan), (-0.1, 0.5), (0.5, 1.1), (inf, 0.5)])
def test_a_click_outside_the_picture_is_invalid(publisher, world, point):
    assert click(publisher, world, world.NOW, *point).result is CommandResult.DENIED
    assert click(publisher, world, world.NOW, *point, (0.6, 0.6), number=2005).result is CommandResult.DENIED


def test_between_pictures_the_ground_tells(world):
    asked = []

    def locate(u, v, sigma_px, host_ns):
        asked.append((u, v, host_ns))
        return world.fix((4.2, 2.9, 0.0))

    publisher = Publisher(OPTIONS, locate)
    far = world.track(1, position_ned=(40.0, 3.0, 0.0), confirmed_at=world.NOW - 9 * world.S)
    publisher.on_tracks((far, world.track(2)), world.situation())
    answer = click(publisher, world, world.NOW + 2 * world.S, 0.5, 0.5)
    assert answer.result is CommandResult.ACCEPTED
    assert publisher.selected.id == 2
    assert asked == [(319.5, 239.5, world.NOW + 1700 * MS)]


@pytest.mark.parametrize("place", [None, (9.0, 3.0, 0.0)])
def test_ground_without_a_target_is_answered_so(world, place):
    publisher = Publisher(OPTIONS, lambda *_: world.fix(place) if place is not None else None)
    publisher.on_tracks((world.track(),), world.situation())
    assert click(publisher, world, world.NOW + 2 * world.S, 0.5, 0.5).result is CommandResult.FAILED


def test_without_a_calibrated_camera_nothing_can_be_clicked(world):
    answer = click(Publisher(PublishOptions()), world, world.NOW, 0.5, 0.5)
    assert answer.result is CommandResult.FAILED


def test_a_tentative_track_cannot_be_clicked(publisher, world):
    publisher.on_tracks((world.track(state=TrackState.TENTATIVE),), world.situation())
    assert click(publisher, world, world.NOW + 300 * MS, 0.5, 0.5).result is CommandResult.FAILED


def test_stop_ends_the_statuses_with_idle(publisher, world):
    run(publisher, world, 0.3, (1,))
    assert publisher.on_command(command(2010), world.situation()).result is CommandResult.ACCEPTED
    sent = run(publisher, world, 1.0, (1,), start=world.NOW + world.S)
    assert [one.fields["tracking_status"] for one in sent] == [0, 0, 0]
    assert publisher.status()["selected"] is None
