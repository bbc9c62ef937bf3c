"""No state of a vehicle is better than its newest evidence: parts that die one by one, by each kind of input."""

from __future__ import annotations

import asyncio

import msgspec
import pytest
from picture_receiver import NOW, Receiver, geo_status, heartbeat, position, target, text, value
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.fleet.payloads import StateMessage
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.picture_messages import PictureMessages
from fwav_companion.ground.status_reader import StatusReader
from fwav_companion.types.flight_status import (
    AgreementReport,
    AutopilotReport,
    SelfCalibrationReport,
    SightReport,
    TrackReport,
)
from fwav_companion.types.status import IntakeReport, RunStatus, VisionReport

HOME = (48.1371999, 11.5756003)
READY = b"ready: attitude 100 Hz, camera 30/s"


def companion(critical: bool = False):
    return dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 5 if critical else 4, 3)


def flown(seconds, autopilot_until=1e9, companion_until=1e9, begins=NOW, receiver=None):
    """A receiver after messages at 1 Hz, each until its sender dies, seconds after ``begins``."""
    receiver = receiver or Receiver()
    for tick in range(round(10 * seconds)):
        at = begins + 0.1 * tick
        if tick % 10 == 0 and at < NOW + autopilot_until:
            receiver.take(1, heartbeat(), now=at)
            receiver.take(1, position(*HOME), now=at)
        if tick % 10 == 0 and at < NOW + companion_until:
            receiver.take(191, companion(), now=at)
        if tick == 20 and begins == NOW:
            receiver.take(191, text(READY), now=at)
        receiver.flush(at)
    return receiver


def texts(picture):
    return [each.text for each in picture.update_since(0, NOW).texts]


def test_dead_autopilot_behind_a_live_companion_is_named_and_nothing_is_ready():
    picture = flown(50.0, autopilot_until=5.0).picture
    vehicle = picture.vehicles["1"]
    assert vehicle.quiet == {"autopilot": pytest.approx(NOW + 4.0)}
    assert (vehicle.silent, vehicle.ready, vehicle.companion) == (False, None, "healthy")
    assert vehicle.heard["position"] == pytest.approx(NOW + 4.0)
    assert "is heard again" not in "".join(texts(picture))
    assert sum("autopilot silent for" in each for each in texts(picture)) == 1


def test_autopilot_that_comes_back_is_reported_once():
    receiver = flown(50.0, autopilot_until=5.0)
    picture = flown(5.0, begins=NOW + 50.0, receiver=receiver).picture
    assert picture.vehicles["1"].quiet == {}
    assert texts(picture).count("autopilot is heard again") == 1


@pytest.mark.parametrize("reports", [True, False])
def test_silence_that_the_companion_reports_itself_is_not_said_twice(reports):
    receiver = flown(10.0, autopilot_until=5.0)
    if reports:
        receiver.take(191, text(b"autopilot lost: no heartbeat for 5 s"), now=NOW + 10.0)
    flown(8.0, autopilot_until=-1.0, begins=NOW + 10.0, receiver=receiver)
    assert receiver.picture.vehicles["1"].quiet.keys() == {"autopilot"}
    flown(5.0, begins=NOW + 18.0, receiver=receiver)
    said = [each for each in texts(receiver.picture) if each.startswith("autopilot")]
    own = ["autopilot silent for 7 s: check its power and its wire to the companion", "autopilot is heard again"]
    assert said == (["autopilot lost: no heartbeat for 5 s"] if reports else own)


def test_pictures_that_stopped_are_named_by_mavlink_alone_until_the_next_readiness():
    receiver = flown(5.0)
    receiver.take(191, text(b"not ready: no pictures: check [vision] source"), now=NOW + 5.0)
    flown(4.0, begins=NOW + 5.0, receiver=receiver)
    vehicle = receiver.picture.vehicles["1"]
    assert (vehicle.quiet, vehicle.ready) == ({"detector": NOW - 1.0}, False)
    receiver.take(191, text(READY), now=NOW + 9.0)
    flown(9.0, begins=NOW + 9.0, receiver=receiver)
    assert (receiver.picture.vehicles["1"].quiet, receiver.picture.vehicles["1"].ready) == ({}, True)
    assert not any("detector" in each for each in texts(receiver.picture))  # the companion has said it


def test_killed_companion_takes_its_readiness_with_it():
    picture = flown(20.0, companion_until=5.0).picture
    vehicle = picture.vehicles["1"]
    assert vehicle.quiet == {"companion": pytest.approx(NOW + 4.0)}
    assert (vehicle.ready, vehicle.ready_unix) == (None, pytest.approx(NOW + 9.1, abs=0.15))
    assert vehicle.readiness == READY.decode()  # what it said last, with its age
    assert vehicle.heard["readiness"] == pytest.approx(NOW + 2.0)


def test_companion_that_is_heard_again_is_not_ready_until_it_says_so():
    receiver = flown(20.0, companion_until=5.0)
    receiver = flown(3.0, begins=NOW + 20.0, receiver=receiver)
    assert receiver.picture.vehicles["1"].ready is None
    receiver.take(191, text(READY), now=NOW + 23.0)
    receiver.flush(NOW + 23.0)
    assert receiver.picture.vehicles["1"].ready is True


def test_vehicle_whose_link_is_cut_is_one_text_not_one_a_part():
    picture = flown(20.0, autopilot_until=5.0, companion_until=5.5).picture
    assert picture.vehicles["1"].silent
    assert [each for each in texts(picture) if "silent" in each] == ["silent for 5 s: check its link"]


def test_vehicle_whose_parts_return_one_by_one_is_reported_once():
    receiver = flown(20.0, autopilot_until=5.0, companion_until=5.5)
    flown(3.0, autopilot_until=-1.0, begins=NOW + 20.0, receiver=receiver)
    picture = flown(9.0, begins=NOW + 23.0, receiver=receiver).picture
    assert picture.vehicles["1"].quiet == {}
    assert [each for each in texts(picture) if "heard" in each] == ["heard for the first time", "is heard again"]


def test_text_that_comes_by_two_links_is_shown_once():
    receiver = flown(1.0)
    for at in (NOW + 1.0, NOW + 1.2, NOW + 20.0):
        receiver.take(1, text(b"PreArm: compass"), now=at)
    assert texts(receiver.picture).count("PreArm: compass") == 2


def test_coasting_report_does_not_renew_the_last_fix():
    receiver = flown(1.0)
    for second, flags in ((1, 1), (2, 1), (3, 9), (9, 9)):
        receiver.take(191, value(b"TGT_ID", 7.0), now=NOW + second)
        receiver.take(100, geo_status(*HOME, sigma=1.0, flags=flags), now=NOW + second)
    shown = receiver.picture.targets["1/7"]
    assert (shown.state, shown.seen_unix) == ("coasting", NOW + 2)


def shared(seconds, **changes):
    """A picture of one vehicle by Zenoh after states at 2 Hz; ``changes``: values, or functions of the second."""
    picture = GroundPicture()
    fleet = FleetPicture(picture)
    for tick in range(round(2 * seconds)):
        at = 0.5 * tick
        made = {name: each(at) if callable(each) else each for name, each in changes.items()}
        fields = {"vehicle": "2", "time_unix": NOW + at, "session": "a", "lat": HOME[0], "lon": HOME[1], "armed": True}
        fleet.on_message("2", "state", msgspec.json.encode(StateMessage(**fields | made)), NOW + at)
        picture.advance(NOW + at)
    return picture


def test_vehicle_by_zenoh_has_a_companion_and_its_readiness():
    vehicle = shared(10.0, ready=True, autopilot_age_s=0.3, position_age_s=0.1, frame_age_s=0.05).vehicles["2"]
    assert (vehicle.companion, vehicle.ready, vehicle.readiness) == ("healthy", True, "ready")
    assert vehicle.quiet == {}
    last = NOW + 9.5
    assert vehicle.heard == pytest.approx(
        {"companion": last, "readiness": last, "autopilot": last - 0.3, "detector": last - 0.05,
         "position": last - 0.1, "attitude": last - 0.1}
    )  # fmt: skip


def test_vehicle_by_zenoh_whose_autopilot_died_is_not_ready_and_its_place_is_old():
    """Its companion goes on sending the last position: its own time says so."""
    age = lambda at: max(0.2, at - 5.0)  # noqa: E731
    picture = shared(50.0, ready=True, autopilot_age_s=age, position_age_s=age)
    vehicle = picture.vehicles["2"]
    assert vehicle.ready is None
    assert vehicle.quiet == {"autopilot": pytest.approx(NOW + 5.0, abs=0.01)}
    assert vehicle.heard["position"] == pytest.approx(NOW + 5.0, abs=0.01)


def test_older_sender_by_zenoh_without_ages_names_no_part():
    vehicle = shared(10.0, ready=True).vehicles["2"]
    assert (vehicle.ready, set(vehicle.heard) & {"autopilot", "detector"}) == (True, set())


def by_status(status, at=NOW, picture=None):
    picture = picture or GroundPicture()
    reader = StatusReader("f", picture, clock=lambda: at, understand=lambda _: None, judge=lambda _: ())
    asyncio.run(reader._take(status))
    picture.advance(at)
    return picture


def status(**changes):
    usual = {
        "time_monotonic": 50.0, "autopilot": AutopilotReport(system=1, armed=True, age_s=0.4), "obstacle": "",
        "intake": IntakeReport(came=9, age_s=0.1), "vision": VisionReport(works=True),
        "tracks": [TrackReport(track=4, label="person", lat=48.1, lon=11.5, cov=(1.0, 0, 0, 1.0, 0, 1.0))],
    }  # fmt: skip
    return RunStatus(**usual | changes)


def test_status_file_names_each_part_that_is_silent():
    vehicle = by_status(status(intake=IntakeReport(came=9, age_s=7.0), obstacle="no pictures: check")).vehicles["1"]
    assert vehicle.quiet == {"detector": NOW - 7.0}
    assert (vehicle.ready, vehicle.readiness) == (False, "not ready: no pictures: check")
    picture = by_status(status())
    dead = status(time_monotonic=60.0, vision=VisionReport(works=False), intake=IntakeReport(came=9, age_s=10.0))
    by_status(dead, NOW + 10.0, picture)
    assert picture.vehicles["1"].quiet == {"camera": NOW}  # nothing is known of the detector behind it


def test_status_that_is_no_longer_written_leaves_nothing_ready():
    picture = by_status(status())
    assert picture.vehicles["1"].ready is True
    picture.advance(NOW + 6.0)
    assert (picture.vehicles["1"].ready, picture.vehicles["1"].silent) == (None, True)


@pytest.mark.parametrize(
    ("changes", "of_vehicle", "of_target"),
    [
        ({}, "", ""),
        ({"calibration": SelfCalibrationReport(mistake="turned by 90 degrees")}, "camera mount: turned", ""),
        ({"sight": SightReport(agreement=AgreementReport(apart=0.6, apart_m=3.0, turn_deg=90.0, label="person"))}, "",
         "disagree by 3.0 m"),
        ({"sight": SightReport(agreement=AgreementReport(apart=0.3, apart_m=3.0, label="person"))}, "", ""),
        ({"sight": SightReport(agreement=AgreementReport(apart=0.6, apart_m=3.0, label="cow"))}, "", ""),
    ],
)  # fmt: skip
def test_contradicted_claim_is_shown_with_its_reason(changes, of_vehicle, of_target):
    picture = by_status(status(**changes))
    vehicle, shown = picture.vehicles["1"], picture.targets["1/4"]
    for view, words in ((vehicle, of_vehicle), (shown, of_target)):
        assert words in view.contradicted
        assert bool(view.contradicted) == bool(words)
        assert view.contradicted_unix == (NOW if words else None)


def test_contradiction_keeps_its_first_instant_and_ends():
    picture = GroundPicture()
    for second, reason in enumerate(("", "apart", "apart by more", "")):
        picture.on_target(target(1, contradicted=reason), NOW + second)
        since = picture.targets["1/1"].contradicted_unix
        assert since == (NOW + 1 if reason else None)


def test_mount_mistake_by_text_contradicts_the_vehicles_claims():
    receiver = flown(1.0)
    receiver.take(191, text(b"camera mount: turned by 90 degrees"), now=NOW + 1.0)
    assert receiver.picture.vehicles["1"].contradicted_unix == NOW + 1.0


def test_viewers_get_a_place_once_with_its_own_time():
    receiver = flown(50.0, autopilot_until=5.0)
    messages, revision, placed = PictureMessages(), 0, []
    for second in range(3):
        update = receiver.picture.update_since(revision, NOW + 50.0 + second)
        revision = update.revision
        placed += [at for topic, at, _ in messages.of_update(update) if topic == "/vehicle/location"]
        receiver.take(191, companion(), now=NOW + 50.0 + second)
        receiver.flush(NOW + 50.0 + second)
    assert placed == [pytest.approx((NOW + 4.0) * 1e9, abs=1e6)]
