"""The camera component's two statuses: the target's place, field by field, and the message intervals."""

from math import atan2, isnan, nan
from types import SimpleNamespace

import numpy as np
import pymap3d
import pytest
from camera_component import GEO, IMAGE, OPTIONS, command, named, run
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import CommandResult, Destination, Message, TrackState


@pytest.fixture
def publisher():
    return Publisher(OPTIONS)


# The target's place.


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


def test_a_predicted_target_has_its_own_bit_and_no_pixel(publisher, world):
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


def test_when_no_target_is_left_idle_is_sent_three_times_and_then_nothing(publisher, world):
    run(publisher, world, 0.5, (1,))
    sent = run(publisher, world, 3.0, (), start=world.NOW + world.S)
    assert [one.fields["tracking_status"] for one in sent] == [0, 0, 0]
    assert {one.name for one in sent} == {IMAGE}


# Intervals.


def test_both_statuses_at_the_configured_rate_and_seldom_through_the_autopilots_link(publisher, world):
    sent = run(publisher, world, 10.0, (1,))
    for name in (IMAGE, GEO):
        assert len(named(sent, name)) == pytest.approx(100, abs=2)
        assert sum(one.to is Destination.GROUND for one in named(sent, name)) == pytest.approx(20, abs=1)
        assert {one.to for one in named(sent, name)} == {Destination.GROUND, Destination.GROUND_LINKS}


@pytest.mark.parametrize(
    ("interval_us", "hz"), [(500_000.0, 2), (50_000.0, 20), (10.0, 50), (1e30, 0.1), (-1.0, 0), (0.0, 10)]
)
def test_the_interval_on_request_where_minus_one_stops_and_zero_is_the_default(publisher, world, interval_us, hz):
    run(publisher, world, 0.5, (1,))
    answer = publisher.on_command(command(511, 275.0, interval_us), world.situation(now=world.NOW + world.S))
    assert answer.result is CommandResult.ACCEPTED
    sent = run(publisher, world, 10.0, (1,), start=world.NOW + world.S)
    assert len(named(sent, IMAGE)) == pytest.approx(10 * hz, abs=1.5)
    assert len(named(sent, GEO)) == pytest.approx(100, abs=2)
    if interval_us:
        assert {one.to for one in named(sent, IMAGE)} <= {Destination.GROUND}


def test_the_default_interval_is_not_one_that_was_asked_for(publisher, world):
    """Through the autopilot's link the rate stays low; a station that requests the message gets it on its own link,
    even if another stopped it.
    """
    now = world.NOW + world.S
    publisher.on_command(command(511, 275.0, -1.0, sender=(254, 190)), world.situation(now=now))
    publisher.on_command(command(511, 275.0, 0.0), world.situation(now=now))
    sent = named(run(publisher, world, 10.0, (1,), start=now), IMAGE)
    assert len(sent) == pytest.approx(100, abs=2)
    assert sum(one.to is Destination.GROUND for one in sent) == pytest.approx(20, abs=1)


def test_a_station_that_stops_it_stops_it_for_itself(publisher, world):
    now = world.NOW + world.S
    publisher.on_command(command(511, 275.0, 200_000.0), world.situation(now=now))
    publisher.on_command(command(511, 275.0, 500_000.0, sender=(254, 190)), world.situation(now=now))
    (reported,) = publisher.on_command(command(510, 275.0), world.situation(now=now)).messages
    assert reported.fields == {"message_id": 275, "interval_us": 200_000}
    publisher.on_command(command(511, 275.0, -1.0), world.situation(now=now))
    assert len(named(run(publisher, world, 10.0, (1,), start=now), IMAGE)) == pytest.approx(20, abs=1.5)
    (reported,) = publisher.on_command(command(510, 275.0), world.situation(now=now)).messages
    assert reported.fields == {"message_id": 275, "interval_us": 500_000}


def heard(publisher, now, *stations, kind=mavlink.MAV_TYPE_GCS):
    for station in stations:
        publisher.on_heartbeat(Message("HEARTBEAT", *station, "ground", SimpleNamespace(type=kind)), now)


@pytest.mark.parametrize("interval_us", [-1.0, 30e6])
def test_a_stranger_that_stops_or_slows_a_status_takes_it_from_no_station_that_is_heard(publisher, world, interval_us):
    """Without a key any sender on a station's link may ask. The others got nothing more until the next start."""
    strangers, counted = [(200 + k, 190) for k in range(40)], []
    for second in range(100):
        now = world.NOW + second * world.S
        heard(publisher, now, (255, 190), *strangers)
        for stranger in strangers:
            publisher.on_command(command(511, 275.0, interval_us, sender=stranger), world.situation(now=now))
        counted.append(len(named(run(publisher, world, 1.0, (1,), start=now), IMAGE)))
    assert min(counted) >= 9


def test_a_request_for_a_status_ends_a_minute_after_its_station_is_gone(publisher, world):
    now = world.NOW
    publisher.on_command(command(511, 275.0, 20_000.0), world.situation(now=now))
    heard(publisher, now + 30 * world.S, (255, 190))
    assert len(named(run(publisher, world, 1.0, (1,), start=now + 85 * world.S), IMAGE)) == pytest.approx(50, abs=2)
    later = now + 95 * world.S
    heard(publisher, later, (254, 190))
    assert len(named(run(publisher, world, 1.0, (1,), start=later), IMAGE)) == pytest.approx(10, abs=1)


def test_a_request_of_a_program_that_is_no_station_lasts_while_its_heartbeats_do(publisher, world):
    now = world.NOW
    publisher.on_command(command(511, 275.0, 20_000.0, sender=(1, 195)), world.situation(now=now))
    for second in range(0, 120, 10):
        heard(publisher, now + second * world.S, (1, 195), kind=mavlink.MAV_TYPE_ONBOARD_CONTROLLER)
    sent = run(publisher, world, 1.0, (1,), start=now + 121 * world.S)
    assert len(named(sent, IMAGE)) == pytest.approx(50, abs=2)
