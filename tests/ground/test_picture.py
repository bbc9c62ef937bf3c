"""MAVLink in, picture out: encoded with pymavlink, decoded with ours."""

from __future__ import annotations

from math import radians, tan

import pytest
from picture_receiver import NOW, Receiver, geo_status, heartbeat, position, target, text, value
from picture_vehicles import HOME, place_of
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import quaternion_from_euler
from fwav_companion.ground import picture as limits
from fwav_companion.ground.footprint import STEEPEST_DEG, corner_rays, footprint
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.text_chunks import TextChunks


@pytest.fixture
def receiver():
    made = Receiver()
    made.take(1, heartbeat())
    return made


def test_a_vehicle_is_shown_with_what_it_sends(receiver):
    receiver.take(1, position(*HOME[:2]))
    receiver.take(1, dialect.MAVLink_sys_status_message(0, 0, 0, 0, 15800, -1, 72, *(0,) * 6))
    receiver.take(191, dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 5, 3))
    receiver.flush()
    shown = receiver.picture.vehicles["1"]
    assert (shown.kind, shown.armed, shown.companion) == ("ArduPilot copter", True, "trouble")
    assert (shown.lat, shown.lon) == pytest.approx(HOME[:2], abs=1e-7)
    assert (shown.alt_amsl, shown.height_m, shown.heading_deg) == pytest.approx((HOME[2] + 20.0, 20.0, 90.0))
    assert shown.speed_m_s == pytest.approx(5.0)  # 3 and 4 m/s
    assert (shown.battery_v, shown.battery_percent) == (pytest.approx(15.8), 72)


def test_messages_without_an_autopilot_s_heartbeat_make_no_vehicle():
    receiver = Receiver()
    receiver.take(191, dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    receiver.take(1, position(*HOME[:2]))
    receiver.take(255, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system=255)
    receiver.flush()
    assert not receiver.picture.vehicles
    assert not receiver.picture.targets


def test_senders_with_every_system_id_keep_no_new_vehicle_out():
    """250 systems were remembered, whoever invented them, and a later vehicle was never shown, without a word."""
    receiver = Receiver()
    for system in range(256):
        receiver.take(190, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system=system)
    receiver.take(1, heartbeat(), system=253, now=NOW + 1.0)
    receiver.flush(NOW + 1.0)
    assert receiver.picture.vehicles.keys() == {"253"}


def test_a_place_of_0_0_is_no_place(receiver):
    receiver.take(1, position(0.0, 0.0))
    receiver.flush()
    assert receiver.picture.vehicles["1"].lat is None


def test_the_selected_target_has_its_number_and_its_own_95_percent_radius(receiver):
    place = place_of(12.0, 5.0)
    receiver.take(191, value(b"TGT_ID", 7.0))
    receiver.take(191, value(b"TGT_R95", 2.5))
    receiver.take(100, geo_status(*place, sigma=1.2))
    shown = receiver.picture.targets["1/7"]
    assert (shown.lat, shown.lon) == pytest.approx(place, abs=1e-7)
    assert (shown.radius95_m, shown.bound, shown.track) == (2.5, False, "7")


def test_without_a_radius_the_circle_is_the_largest_that_the_sigma_allows(receiver):
    """One sigma along the larger semi-axis: a round ellipse has the largest circle, sqrt(-2 ln 0.05) sigmas."""
    receiver.take(100, geo_status(*place_of(12.0, 5.0), sigma=2.0))
    shown = receiver.picture.targets["1/selected"]
    assert shown.radius95_m == pytest.approx(2.0 * 2.4477, rel=1e-4)
    assert shown.bound


@pytest.mark.parametrize(("lat", "flags"), [(0.0, 1), (HOME[0], 0)])
def test_a_status_without_place_or_target_shows_none(receiver, lat, flags):
    receiver.take(100, geo_status(lat, 0.0 if not lat else HOME[1], sigma=1.0, flags=flags))
    assert not receiver.picture.targets


def test_texts_bring_further_targets_and_readiness(receiver):
    receiver.take(191, text(b"found person 3: 48.137210, 11.575701, 95 % within 2.4 m"[:50], 4, 0))
    receiver.take(191, text(b"found person 3: 48.137210, 11.575701, 95 % within 2.4 m"[50:], 4, 1))
    receiver.take(191, text(b"not ready: no pictures: check"))
    shown = receiver.picture.targets["1/3"]
    assert (shown.label, shown.state, shown.lat, shown.radius95_m) == ("person", "reported", 48.137210, 2.4)
    assert receiver.picture.vehicles["1"].ready is False
    receiver.take(191, text(b"lost person 3: last at 48.1, 11.5, 95 % within 2 m"))
    assert receiver.picture.targets["1/3"].state == "lost"


def test_an_autopilot_s_text_makes_no_target(receiver):
    receiver.take(1, text(b"found x 3: 48.1, 11.5, 95 % within 2.4 m"))
    assert not receiver.picture.targets


def test_silence_is_reported_once_and_the_return_too(receiver):
    receiver.flush()
    receiver.flush(NOW + 6.0)
    receiver.flush(NOW + 7.0)
    silent = receiver.picture.vehicles["1"]
    assert silent.silent
    texts = [each.text for each in receiver.picture.update_since(0, NOW).texts]
    assert sum("silent for" in each for each in texts) == 1
    receiver.take(1, heartbeat(), now=NOW + 9.0)
    receiver.flush(NOW + 9.0)
    assert not receiver.picture.vehicles["1"].silent
    assert "heard again" in receiver.picture.update_since(0, NOW).texts[-1].text


def test_a_reader_gets_what_changed_since_its_last_visit():
    picture = GroundPicture()
    for number in range(3):
        picture.on_target(target(number), NOW)
    first = picture.update_since(0, NOW)
    assert first.whole
    assert len(first.targets) == 3
    picture.on_target(target(1, lat=48.5), NOW + 1.0)
    picture.remove_target("1/2")
    second = picture.update_since(first.revision, NOW + 1.0)
    assert not second.whole
    assert second.removed == ["1/2"]
    assert [each.id for each in second.targets] == ["1/1"]
    assert picture.update_since(second.revision, NOW).targets == []


def test_a_reader_of_an_earlier_process_gets_everything():
    picture = GroundPicture()
    picture.on_target(target(1), NOW)
    assert picture.update_since(10**6, NOW).whole


def test_nothing_grows_without_bound(monkeypatch):
    monkeypatch.setattr(limits, "MAX_TARGETS", 20)
    monkeypatch.setattr(limits, "MAX_VEHICLES", 5)
    picture = GroundPicture()
    for number in range(100):
        picture.on_target(target(number, state="dropped" if number == 3 else "confirmed"), NOW)
        picture.on_vehicle(str(number), NOW, lat=48.0 + number, lon=11.0)
        picture.say("1", "x" * 10_000, NOW, severity=6)
    assert len(picture.targets) == 20
    assert len(picture.vehicles) == 5
    assert "1/3" not in picture.targets  # the one that has ended made room
    assert picture.refused == 79 + 95
    for second in range(2000):
        picture.on_target(target(1), NOW + second)
        picture.say("1", f"text {second}", NOW, severity=6)
    assert len(picture.history("1/1")) == limits.MAX_HISTORY
    assert len(picture.update_since(0, NOW).texts) == limits.MAX_TEXTS


def test_vehicles_that_were_heard_for_a_moment_yield_their_places_and_a_full_picture_is_reported(monkeypatch):
    monkeypatch.setattr(limits, "MAX_VEHICLES", 3)
    picture = GroundPicture()
    for second in range(100):
        picture.on_vehicle("flew", NOW + second, heard={"autopilot": NOW + second}, lat=48.0, lon=11.0)
    for name in ("forged 1", "forged 2", "forged 3"):
        picture.on_vehicle(name, NOW + 100.0)
    assert "forged 3" not in picture.vehicles
    (source,) = picture.update_since(0, NOW).sources
    assert (source.works, source.text[:8]) == (False, "full: at")
    revision = picture.revision
    picture.on_vehicle("new", NOW + 200.0)
    assert picture.vehicles.keys() == {"flew", "forged 2", "new"}, "the last place of what flew stays"
    assert picture.update_since(revision, NOW + 200.0).whole
    assert "forged 1" not in picture.paths()


def test_targets_that_ended_disappear_after_a_minute():
    picture = GroundPicture()
    picture.on_target(target(1, state="lost"), NOW)
    picture.on_target(target(2), NOW)
    picture.advance(NOW + 59.0)
    assert len(picture.targets) == 2
    picture.advance(NOW + 61.0)
    assert list(picture.targets) == ["1/2"]


def test_chunks_are_joined_and_missing_ones_do_not_block():
    chunks = TextChunks()
    message = dialect.MAVLink_statustext_message
    assert chunks.add((1, 191), message(5, b"a" * 50, 3, 0), NOW) is None
    assert chunks.add((1, 191), message(5, b"b", 3, 1), NOW) == "a" * 50 + "b"
    assert chunks.add((1, 191), message(5, b"end", 4, 2), NOW) is None
    assert list(chunks.overdue(NOW + 3.0)) == [(1, 5, "......end")]
    for number in range(1, 1000):
        chunks.add((1, 191), message(5, b"c" * 50, number, 0), NOW)
    assert len(list(chunks.overdue(NOW + 3.0))) == 32


def ned_of(corners) -> list[tuple[float, float]]:
    plane = TangentPlane(Geodetic.from_degrees(*HOME))
    return [plane.ned_from_geodetic(Geodetic.from_degrees(*corner, HOME[2]))[:2] for corner in corners]


def test_the_footprint_of_a_level_camera_is_its_field_of_view():
    level = quaternion_from_euler(0.0, 0.0, radians(90.0))
    corners = footprint(Geodetic.from_degrees(*HOME), 20.0, level, corner_rays(60.0, 40.0))
    along, across = 20.0 * tan(radians(20.0)), 20.0 * tan(radians(30.0))
    # Heading east: the image's top is east, its right is south.
    wanted = [(across, along), (-across, along), (-across, -along), (across, -along)]
    for corner, (north, east) in zip(ned_of(corners), wanted, strict=True):
        assert corner == pytest.approx((north, east), abs=1e-3)


def test_rays_toward_the_horizon_are_cut():
    pitched = quaternion_from_euler(0.0, radians(75.0), 0.0)
    corners = ned_of(footprint(Geodetic.from_degrees(*HOME), 20.0, pitched, corner_rays(60.0, 40.0)))
    reach = 20.0 * tan(radians(STEEPEST_DEG))
    assert max((north**2 + east**2) ** 0.5 for north, east in corners) == pytest.approx(reach, rel=1e-3)
    assert footprint(Geodetic.from_degrees(*HOME), 0.1, pitched, corner_rays(60.0, 40.0)) == ()


def test_the_footprint_comes_from_the_camera_s_own_optics(receiver):
    vendor = [*b"x".ljust(32, b"\0")]
    optics = dialect.MAVLink_camera_information_message(0, vendor, vendor, 0, 6.0, 6.0, 4.0, 640, 480, 0, 0, 0, b"")
    receiver.take(100, optics)
    receiver.take(1, position(*HOME[:2]))
    receiver.take(1, dialect.MAVLink_attitude_message(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    receiver.flush()
    corners = ned_of(receiver.picture.vehicles["1"].footprint)
    # 6 mm wide at 6 mm: half a metre a metre of height; at 20 m 10 m to the right.
    assert corners[1] == pytest.approx((20.0 * 2.0 / 6.0, 10.0), abs=1e-2)
