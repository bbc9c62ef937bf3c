"""Named values, ADS-B markers and Cursor on Target, each decoded by an independent reader."""

import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from math import inf, isnan, nan

import pymap3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.publishing.cot import cot_event
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import AutopilotKind, Destination, NoticeCode

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


COT = PublishOptions(**QUIET, named_values=False, cot=True, unit="a1b2c3", cot_stale_s=10.0)


def parsed(event):
    root = ET.fromstring(event)
    return root.attrib, {name: float(value) for name, value in root.find("point").attrib.items()}, root


def test_cot_point_with_the_height_above_the_ellipsoid(world):
    target = world.track(position_ned=(120.0, -80.0, 5.0))
    event, point, _ = parsed(cot_event(target, COT, world.situation(undulation_m=47.3)))
    lat, lon, _ = pymap3d.ned2geodetic(
        120.0, -80.0, 0.0, world.ORIGIN.lat_deg, world.ORIGIN.lon_deg, world.ORIGIN.alt_amsl_m
    )
    assert (point["lat"], point["lon"]) == (pytest.approx(lat, abs=2e-7), pytest.approx(lon, abs=2e-7))
    assert point["hae"] == pytest.approx(483.0 + 47.3)
    assert (point["ce"], point["le"]) == (1.0, 0.6)
    assert (event["version"], event["type"]) == ("2.0", "a-u-G")


def test_cot_times_are_utc_and_it_goes_stale(world):
    event, _, _ = parsed(cot_event(world.track(), COT, world.situation()))
    utc = datetime.fromtimestamp(1_790_000_000 + world.NOW / 1e9, tz=UTC)
    read = {name: datetime.fromisoformat(event[name]) for name in ("time", "start", "stale")}
    assert read["time"] == read["start"] == utc
    assert (read["stale"] - utc).total_seconds() == 10.0


def test_cot_uid_survives_a_restart_and_another_track_number(world):
    first = parsed(cot_event(world.track(1), COT, world.situation()))[0]["uid"]
    again = parsed(cot_event(world.track(8), COT, world.situation(kind=AutopilotKind.PX4)))[0]["uid"]
    other = parsed(cot_event(world.track(1), COT, world.situation(autopilot=world.autopilot(system=2))))[0]["uid"]
    assert first == again
    assert other != first
    assert "a1b2c3" in first


def seen_again(publisher, world, wakes, **changes):
    """All that is sent while a target is seen, and once more whenever the publisher wakes."""
    yield from publisher.on_tracks((world.track(),), world.situation(**changes))
    for _ in range(wakes):
        at = publisher.wake_at
        publisher.on_tracks((world.track(at=at),), world.situation(now=at, **changes))
        yield from publisher.on_wake(at, world.situation(now=at, **changes))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"plane": None}, NoticeCode.COT_WITHOUT_POSITION),
        ({"undulation_m": None}, NoticeCode.COT_WITHOUT_GEOID),
        ({"utc_minus_host_s": None}, NoticeCode.COT_WITHOUT_UTC),
        ({"utc_minus_host_s": -1e9}, NoticeCode.COT_WITHOUT_UTC),
        ({"utc_minus_host_s": 1e13}, NoticeCode.COT_WITHOUT_UTC),
    ],
)
def test_cot_that_would_be_wrong_is_not_sent_and_that_is_reported_once(world, changes, reason):
    assert cot_event(world.track(), COT, world.situation(**changes)) is reason
    publisher = Publisher(PublishOptions(camera_tracking=False, named_values=False, cot=True))
    list(seen_again(publisher, world, 30, **changes))
    assert publisher.datagrams() == []
    (notice,) = (each for each in publisher.notices() if each.code is not NoticeCode.TARGET_FOUND)
    assert (notice.code, notice.to_ground) == (reason, True)


def test_cot_at_its_rate_and_each_datagram_once(world):
    publisher = Publisher(COT)
    list(seen_again(publisher, world, 10))
    assert publisher.wake_at == world.NOW + 11 * world.S
    assert len(publisher.datagrams()) == 11
    assert publisher.datagrams() == []


def test_datagrams_that_are_not_fetched_are_bounded(world):
    publisher = Publisher(COT)
    list(seen_again(publisher, world, 500))
    assert len(publisher.datagrams()) <= 64


@settings(derandomize=True, max_examples=150)
@given(label=st.text(max_size=20), callsign=st.text(max_size=20), kind=st.text(max_size=12))
def test_whatever_people_write_it_stays_xml(world, label, callsign, kind):
    options = PublishOptions(cot=True, cot_callsign=callsign, cot_type=kind, unit=label)
    _, _, root = parsed(cot_event(world.track(label=label), options, world.situation()))
    assert len(root.find("detail")) == 2


@pytest.mark.parametrize(("sigma", "expected"), [(nan, 9_999_999.0), (inf, 9_999_999.0), (1e9, 9_999_999.0)])
def test_cot_accuracy_that_is_unknown_is_sent_as_unknown(world, sigma, expected):
    vague = world.track(cov=world.diagonal(sigma, sigma, sigma))
    _, point, _ = parsed(cot_event(vague, COT, world.situation()))
    assert (point["ce"], point["le"]) == (expected, expected)
