"""Cursor on Target, read by TAK's own schema (takproto) and by an XML parser that knows nothing of this package."""

import re
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from math import atan2, degrees, inf, nan

import pymap3d
import pytest
from cot_schema import complaints
from hypothesis import given, settings
from hypothesis import strategies as st
from takproto.functions import xml2message

from fwav_companion.geoid import geoid_undulation_m
from fwav_companion.publishing.cot_events import CameraAim
from fwav_companion.publishing.cot_markers import MapMarkers
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.publisher import Publisher
from fwav_companion.types import AutopilotKind, NoticeCode, Reason, TrackState

QUIET = {"statustext": False, "camera_tracking": False, "named_values": False}
COT = PublishOptions(
    **QUIET, cot="udpout://127.0.0.1:1", unit="a1b2c3", cot_vehicle=False, hfov_deg=62.0, vfov_deg=48.0
)
WITH_VEHICLE = PublishOptions(**QUIET, cot="udpout://127.0.0.1:1", unit="a1b2c3", hfov_deg=62.0, vfov_deg=48.0)
UNKNOWN = 9_999_999.0


class Read:
    """One event, by two independent readers."""

    def __init__(self, data):
        assert complaints(data) == []
        self.root = ET.fromstring(data)
        self.uid, self.kind = self.root.get("uid"), self.root.get("type")
        self.point = {name: float(value) for name, value in self.root.find("point").attrib.items()}
        self.times = {name: datetime.fromisoformat(self.root.get(name)) for name in ("time", "start", "stale")}
        proto = xml2message(data.decode()).cotEvent
        assert (proto.uid, proto.type, proto.how) == (self.uid, self.kind, self.root.get("how"))
        assert (proto.lat, proto.lon, proto.hae) == (self.point["lat"], self.point["lon"], self.point["hae"])
        assert (proto.ce, proto.le) == (self.point["ce"], self.point["le"])
        assert proto.detail.contact.callsign == (self.attribute("contact", "callsign") or "")

    def attribute(self, element, name):
        found = self.root.find(f"detail/{element}")
        return None if found is None else found.get(name)

    @property
    def remarks(self):
        return self.root.findtext("detail/remarks") or ""

    @property
    def valid_s(self):
        return (self.times["stale"] - self.times["time"]).total_seconds()


def events(markers, world, tracks=None, selected=None, **situation):
    tracks = (world.track(),) if tracks is None else tracks
    return [Read(each) for each in markers.due(tracks, selected, world.situation(**situation))]


def target(world, track=None, options=COT, geoid=None, **situation):
    track = track or world.track()
    return events(MapMarkers(options, geoid=geoid), world, (track,), track, **situation)[0]


def test_point_is_the_target_with_its_height_above_the_ellipsoid(world):
    got = target(world, world.track(position_ned=(120.0, -80.0, 5.0)), undulation_m=47.3)
    at = world.ORIGIN
    lat, lon, _ = pymap3d.ned2geodetic(120.0, -80.0, 0.0, at.lat_deg, at.lon_deg, at.alt_amsl_m)
    assert (got.point["lat"], got.point["lon"]) == (pytest.approx(lat, abs=2e-7), pytest.approx(lon, abs=2e-7))
    assert got.point["hae"] == pytest.approx(483.0 + 47.3)
    assert (got.point["ce"], got.point["le"]) == (1.0, 0.6)
    assert (got.root.get("version"), got.kind) == ("2.0", "a-u-G")


def test_height_without_an_ellipsoid_height_is_by_the_geoid_else_unknown_never_silence(world):
    swiss_m = 47.25  # EGM96 near Zurich: 47.0 to 47.5 m above the ellipsoid
    assert target(world, undulation_m=None, geoid=geoid_undulation_m).point["hae"] == pytest.approx(
        488 + swiss_m, abs=0.3
    )
    assert target(world, undulation_m=None).point["hae"] == UNKNOWN
    assert b'hae="9999999.0"' in MapMarkers(COT).due((world.track(),), None, world.situation(undulation_m=None))[0]


def test_times_are_utc_and_the_last_look_begins_the_validity(world):
    got = target(world, world.track(last_seen_host_ns=world.NOW - 100 * world.S))
    utc = datetime.fromtimestamp(1_790_000_000 + world.NOW / 1e9, tz=UTC)
    assert got.times["time"] == got.times["start"] == utc
    assert got.valid_s == 3500.0
    seen = datetime.fromtimestamp(utc.timestamp() - 100, tz=UTC)
    assert f"last seen {seen:%H:%M} UTC" in got.remarks
    assert "95 %" in got.remarks


def test_selected_target_keeps_its_uid_through_restart_and_track_number(world):
    first, again = target(world).uid, target(world, world.track(8), kind=AutopilotKind.PX4).uid
    assert first == again == "fwav-companion.a1b2c3.1.target"
    assert target(world, autopilot=world.autopilot(system=2)).uid == "fwav-companion.a1b2c3.2.target"


def test_other_tracks_have_uids_of_this_run(world):
    tracks = (world.track(1), world.track(2, "person"), world.track(3, ""))
    got = events(MapMarkers(COT), world, tracks, tracks[0])
    later = events(MapMarkers(COT), world, tracks, tracks[0], utc_minus_host_s=1_790_009_000.0)
    assert [each.attribute("contact", "callsign") for each in got] == ["pad 1", "person 2", "target 3"]
    assert len({each.uid for each in got}) == 3
    assert got[0].uid == later[0].uid
    assert not {each.uid for each in got[1:]} & {each.uid for each in later[1:]}


def test_former_selected_target_keeps_a_marker_of_its_own(world):
    markers = MapMarkers(COT)
    (first,) = events(markers, world, (world.track(1),), world.track(1))
    got = events(markers, world, (world.track(2),), world.track(2), now=world.NOW + 60 * world.S)
    assert got[0].uid == first.uid
    assert got[0].attribute("contact", "callsign") == "pad 2"
    assert (got[1].attribute("contact", "callsign"), got[1].valid_s) == ("pad 1", 3540.0)
    assert got[1].uid != first.uid


def test_track_that_is_selected_later_has_one_marker(world):
    markers = MapMarkers(COT)
    (own,) = events(markers, world, (world.track(1),))
    selected, deleted = events(markers, world, (world.track(1),), world.track(1))
    assert selected.uid.endswith(".target")
    assert (deleted.kind, deleted.attribute("link", "uid")) == ("t-x-d-d", own.uid)


def test_lost_track_is_not_deleted_and_is_repeated_until_stale(world):
    markers = MapMarkers(COT)
    (first,) = events(markers, world)
    dropped = world.track(state=TrackState.DROPPED, reason=Reason.NOT_SEEN)
    markers.on_tracks((dropped,))
    sent = [(s, each) for s in range(1, 4000) for each in events(markers, world, (), now=world.NOW + s * world.S)]
    assert {each.kind for _, each in sent} == {"a-u-G"}
    assert {each.uid for _, each in sent} == {first.uid}
    assert [s for s, _ in sent] == list(range(60, 3600, 60))
    assert {each.times["stale"] for _, each in sent} == {first.times["stale"]}
    assert {each.remarks for _, each in sent} == {first.remarks}


def test_merged_track_is_deleted(world):
    markers = MapMarkers(COT)
    _, second = events(markers, world, (world.track(1), world.track(2)))
    markers.on_tracks((world.track(2, state=TrackState.DROPPED, replaced_by=1),))
    got = events(markers, world, (world.track(1),))
    assert [each.kind for each in got] == ["t-x-d-d", "a-u-G"]
    assert got[0].attribute("link", "uid") == second.uid
    assert got[0].root.find("detail/__forcedelete") is not None


@pytest.mark.parametrize(
    ("of", "into", "complaint"),
    [
        ('lat="47', 'lat="147', "attribute 'lat'"),
        ('how="m-f"', 'how="magic?"', "attribute 'how'"),
        ('type="a-u-G"', 'type="a u G"', "attribute 'type'"),
        ("Z", "", "attribute 'time'"),
        ('ce="1.00"', "", "'ce' is required"),
        ('ce="1.00"', 'ce="nan"', "attribute 'ce'"),
        ('callsign="pad 1"', 'callsign=""', "attribute 'callsign'"),
        ("<remarks>", "<remark/><remarks>", "'remark'"),
    ],
)
def test_schema_refuses_what_is_no_event(world, of, into, complaint):
    (event,) = MapMarkers(COT).due((world.track(),), None, world.situation())
    assert complaints(event) == []
    broken = event.decode().replace(of, into)
    assert broken != event.decode()
    assert any(complaint in each for each in complaints(broken.encode()))


AIM = CameraAim((0.6, 0.0, 0.8), (7.5, 0.0, 0.0), 2.0)


def test_vehicle_has_its_cameras_view_and_the_point_that_it_looks_at(world):
    markers = MapMarkers(WITH_VEHICLE, lambda _now: AIM)
    moving = world.state(velocity=(3.0, 4.0, 0.0))
    vehicle, spi = events(markers, world, (), vehicle=moving, undulation_m=47.3)
    assert (vehicle.kind, vehicle.point["hae"], vehicle.valid_s) == ("a-f-A-M-F-Q", 545.3, 10.0)
    sensor = {name: float(value) for name, value in vehicle.root.find("detail/sensor").attrib.items()}
    assert (sensor["azimuth"], sensor["fov"], sensor["vfov"]) == (0.0, 62.0, 48.0)
    assert (sensor["range"], sensor["elevation"]) == (12.5, pytest.approx(-53.1, abs=0.05))
    assert float(vehicle.attribute("track", "course")) == pytest.approx(degrees(atan2(4, 3)), abs=0.05)
    assert float(vehicle.attribute("track", "speed")) == 5.0
    assert (spi.kind, spi.root.get("how"), spi.point["ce"]) == ("b-m-p-s-p-i", "m-p", 2.0)
    link = spi.root.find("detail/link").attrib
    assert link == {"uid": vehicle.uid, "type": vehicle.kind, "relation": "p-p"}
    at = world.ORIGIN
    lat, lon, _ = pymap3d.ned2geodetic(7.5, 0.0, 0.0, at.lat_deg, at.lon_deg, at.alt_amsl_m)
    assert (spi.point["lat"], spi.point["lon"]) == (pytest.approx(lat, abs=2e-7), pytest.approx(lon, abs=2e-7))


def test_vehicle_that_is_not_heard_keeps_the_time_of_its_place_and_is_not_sent_once_stale(world):
    markers, last = MapMarkers(WITH_VEHICLE, lambda _now: AIM), world.state()
    sent = {}
    for second in range(15):
        made = events(markers, world, (), vehicle=last, now=world.NOW + second * world.S)
        sent[second] = {(each.times["time"], each.times["stale"]) for each in made}
    (times,) = sent[0]
    assert all(each == {times} for second, each in sent.items() if second < 10)
    assert all(each == set() for second, each in sent.items() if second >= 10)


def test_view_above_the_horizon_has_the_longest_range_and_no_point(world):
    (vehicle,) = events(MapMarkers(WITH_VEHICLE, lambda _now: CameraAim((0.0, 1.0, 0.0), None, nan)), world, ())
    assert (vehicle.attribute("sensor", "azimuth"), vehicle.attribute("sensor", "range")) == ("90.0", "15000.0")


def test_vehicle_of_unknown_view_has_no_sensor_and_is_left_out_without_a_position(world):
    (vehicle,) = events(MapMarkers(WITH_VEHICLE), world, ())
    assert vehicle.root.find("detail/sensor") is None
    assert events(MapMarkers(WITH_VEHICLE), world, (), vehicle=world.state(position=None)) == []


def published(world, wakes, tracks=1, options=COT, **changes):
    """The publisher after this number of wakes with tracks in sight, and all of its events."""
    publisher, made = Publisher(options), []
    for _ in range(wakes):
        at = publisher.wake_at or world.NOW
        seen = tuple(world.track(1 + i, at=at) for i in range(tracks))
        publisher.on_tracks(seen, world.situation(now=at, **changes))
        publisher.on_wake(at, world.situation(now=at, **changes))
        made += publisher.datagrams()
    return publisher, made


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"plane": None}, NoticeCode.COT_WITHOUT_POSITION),
        ({"utc_minus_host_s": None}, NoticeCode.COT_WITHOUT_UTC),
        ({"utc_minus_host_s": -1e9}, NoticeCode.COT_WITHOUT_UTC),
        ({"utc_minus_host_s": 1e13}, NoticeCode.COT_WITHOUT_UTC),
    ],
)
def test_event_that_would_be_wrong_is_not_sent_and_that_is_reported_once(world, changes, reason):
    publisher, made = published(world, 30, **changes)
    assert made == []
    (notice,) = (each for each in publisher.notices() if each.code is not NoticeCode.TARGET_FOUND)
    assert (notice.code, notice.to_ground) == (reason, True)


def test_64_targets_at_10_hz_are_thinned_to_the_rate(world):
    publisher = Publisher(COT)
    made = []
    for tick in range(100):
        at = world.NOW + tick * world.S // 10
        publisher.on_tracks(tuple(world.track(1 + i, at=at) for i in range(64)), world.situation(now=at))
        if publisher.wake_at <= at:
            publisher.on_wake(at, world.situation(now=at))
        made.append(publisher.datagrams())
    assert [len(each) for each in made if each] == [64] * 10


def test_events_that_are_not_fetched_are_bounded(world):
    publisher = Publisher(COT)
    for second in range(50):
        at = world.NOW + second * world.S
        publisher.on_tracks(tuple(world.track(1 + i, at=at) for i in range(64)), world.situation(now=at))
        publisher.on_wake(at, world.situation(now=at))
    assert len(publisher.datagrams()) <= 256


@settings(derandomize=True, max_examples=150)
@given(
    label=st.text(max_size=20),
    callsign=st.text(max_size=20),
    kind=st.from_regex(re.compile(r"[a-z](-[A-Za-z0-9]{1,3}){1,4}", re.ASCII), fullmatch=True),
)
def test_whatever_people_write_it_stays_an_event_by_the_schema(world, label, callsign, kind):
    """``kind`` is what the configuration accepts; labels and names are anybody's."""
    options = PublishOptions(cot="udpout://a:1", cot_callsign=callsign, cot_type=kind, unit=label, cot_vehicle=False)
    track = world.track(label=label)
    (event,) = MapMarkers(options).due((track,), track, world.situation())
    assert complaints(event) == []
    root = ET.fromstring(event)
    assert [each.tag for each in root.find("detail")] == ["contact", "remarks"]


@pytest.mark.parametrize("sigma", [nan, inf, 1e9])
def test_accuracy_that_is_unknown_is_sent_as_unknown(world, sigma):
    got = target(world, world.track(cov=world.diagonal(sigma, sigma, sigma)))
    assert (got.point["ce"], got.point["le"]) == (UNKNOWN, UNKNOWN)
