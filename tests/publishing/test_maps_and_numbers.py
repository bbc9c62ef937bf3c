"""Named values and ADS-B markers, each decoded by an independent reader."""

from math import isnan

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import Destination

QUIET = {"statustext": False, "camera_tracking": False}


def named(sent, name):
    return [one for one in sent if one.name == name]


def values(world, sent):
    got = [world.packed(one) for one in named(sent, "NAMED_VALUE_FLOAT")]
    return {one["name"]: one["value"] for one in got}


def test_named_values_of_the_selected_target(world):
    publisher = Publisher(PublishOptions(**QUIET))
    vehicle = world.state(position=(1.0, 7.0, -12.0))
    sent = publisher.on_tracks((world.track(5),), world.situation(vehicle=vehicle))
    got = values(world, sent)
    assert got == {
        "TGT_ID": 5.0,
        "TGT_N": 4.0,
        "TGT_E": 3.0,
        "TGT_DIST": 13.0,
        "TGT_BRG": pytest.approx(306.8699, abs=1e-3),
        "TGT_ACC": 1.0,
        "TGT_R95": pytest.approx(circle_radius(world.track().cov, 0.95), rel=2e-3),
    }
    assert all(one.to is Destination.GROUND for one in sent)
    assert max(map(len, got)) <= 10


@pytest.mark.parametrize(("age_s", "known"), [(4, True), (6, False)])
def test_distance_from_a_place_where_the_vehicle_was_is_unknown(world, age_s, known):
    """The autopilot has died: its last place is no longer where the vehicle is; the target's own place remains."""
    publisher = Publisher(PublishOptions(**QUIET))
    last, now = world.state(position=(1.0, 7.0, -12.0)), world.NOW + age_s * world.S
    got = values(world, publisher.on_tracks((world.track(5, at=now),), world.situation(now=now, vehicle=last)))
    assert (got["TGT_N"], got["TGT_E"]) == (4.0, 3.0)
    assert [isnan(got[name]) for name in ("TGT_DIST", "TGT_BRG")] == [not known] * 2


def test_without_a_global_position_the_distance_is_from_above_the_origin_of_the_tracks(world):
    publisher = Publisher(PublishOptions(**QUIET))
    hovering = world.state(position=None, velocity=None, height=12.0)
    got = values(world, publisher.on_tracks((world.track(),), world.situation(plane=None, vehicle=hovering)))
    assert got["TGT_DIST"] == 13.0
    assert got["TGT_BRG"] == pytest.approx(36.8699, abs=1e-3)


def test_named_values_come_twice_a_second_and_once_more_when_the_target_is_gone(world):
    publisher = Publisher(PublishOptions(**QUIET))
    sent = publisher.on_tracks((world.track(),), world.situation())
    now = world.NOW
    for _ in range(20):
        now = publisher.wake_at
        publisher.on_tracks((world.track(at=now),), world.situation(now=now))
        sent += publisher.on_wake(now, world.situation(now=now))
    assert now == world.NOW + 10 * world.S
    assert len(named(sent, "NAMED_VALUE_FLOAT")) == 21 * 7
    publisher.on_tracks((), world.situation(now=now))
    gone = publisher.on_wake(publisher.wake_at, world.situation(now=publisher.wake_at))
    got = values(world, gone)
    assert got.pop("TGT_ID") == 0.0
    assert all(isnan(value) for value in got.values())
    assert publisher.on_wake(publisher.wake_at, world.situation(now=publisher.wake_at)) == []


def test_adsb_only_where_asked_and_only_to_ground_links(world):
    assert not named(Publisher(PublishOptions(**QUIET)).on_tracks((world.track(),), world.situation()), "ADSB_VEHICLE")
    publisher = Publisher(PublishOptions(**QUIET, adsb=True))
    moving = world.track(12, "person!", velocity_ned=(0.0, -2.0, 0.0), position_ned=(0.0, 0.0, 2.0))
    (out,) = named(publisher.on_tracks((moving,), world.situation()), "ADSB_VEHICLE")
    got = world.packed(out)
    assert out.to is Destination.GROUND_LINKS
    assert (got["lat"], got["lon"], got["altitude"]) == (473977420, 85455940, 486_000)
    assert (got["heading"], got["hor_velocity"]) == (27000, 200)
    assert got["callsign"] == "PERSON12"
    assert got["flags"] & mavlink.ADSB_FLAGS_VALID_COORDS
    assert got["ICAO_address"] == 0xF0100C  # reserved by ICAO; system 1, track 12


def test_adsb_without_a_position_is_not_sent(world):
    publisher = Publisher(PublishOptions(**QUIET, adsb=True))
    assert not named(publisher.on_tracks((world.track(),), world.situation(plane=None)), "ADSB_VEHICLE")
