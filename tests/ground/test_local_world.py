"""Vehicles in a local world: from a fleet's messages to the picture."""

from __future__ import annotations

import json

import msgspec
import pytest
from fleet_messages import NOW, local, shared, tracks_message

from fwav_companion.fleet.payloads import MAX_TRACKS_A_PART, LocalPlace, StateMessage, TracksMessage, encoded
from fwav_companion.ground.exports import csv_table, geojson
from fwav_companion.ground.fleet_picture import FleetPicture
from fwav_companion.ground.picture import GroundPicture

COV = (0.25, 0.0, 0.0, 0.04, 0.0, 0.01)
HERE = LocalPlace(north=3.0, east=-2.0, down=-1.5)


def state(**changes) -> bytes:
    return msgspec.json.encode(StateMessage(vehicle="1", time_unix=NOW, session="a", heading_deg=90.0, **changes))


@pytest.fixture
def fleet():
    """(takes a message of vehicle 1 at an instant, the picture)."""
    picture = GroundPicture()
    fused = FleetPicture(picture)

    def take(data: bytes | TracksMessage, now: float = NOW) -> None:
        if isinstance(data, bytes):
            fused.on_message("1", "state", data, now)
        else:
            for part in encoded(data):
                fused.on_message("1", "tracks", part, now)
        fused.step(now)

    return take, picture


def test_local_place_and_tracks_are_the_vehicle_s_own_and_nothing_has_a_place_on_the_earth(fleet):
    take, picture = fleet
    take(state(local=HERE, position_age_s=2.0))
    take(tracks_message(local_tracks=(local(4, cov=COV, last_seen_s=7.0),)))
    vehicle = picture.vehicles["1"]
    assert vehicle.local_ned == (3.0, -2.0, -1.5)
    assert vehicle.lat is None
    assert vehicle.heading_deg == 90.0
    assert vehicle.heard["local"] == pytest.approx(NOW - 2.0)
    (target,) = vehicle.local_targets
    assert (target.north_m, target.east_m, target.track, target.label) == (-4.0, 5.0, "4", "person")
    assert target.ellipse.major_m == pytest.approx(2.4477 * 0.5, rel=1e-4)
    assert target.ellipse.minor_m == pytest.approx(2.4477 * 0.2, rel=1e-4)
    assert target.seen_unix == pytest.approx(NOW - 7.0)
    assert not picture.targets
    assert json.loads(geojson(picture.targets.values(), picture.vehicles.values()))["features"] == []
    assert csv_table(picture.targets.values()).count(b"\r\n") == 1
    assert picture.paths() == {}


def test_local_target_keeps_the_instant_of_its_first_report(fleet):
    take, picture = fleet
    for seq in (1, 2, 3):
        take(tracks_message(local_tracks=(local(4),), seq=seq, time_unix=NOW + seq), NOW + seq)
    (target,) = picture.vehicles["1"].local_targets
    assert target.first_unix == pytest.approx(NOW + 1.0)
    assert target.seen_unix == pytest.approx(NOW + 3.0)


def test_global_position_ends_the_local_world_in_the_picture(fleet):
    take, picture = fleet
    take(state(local=HERE))
    take(tracks_message(local_tracks=(local(4),)))
    take(state(lat=48.0, lon=11.0))
    take(tracks_message(shared(4), seq=2), NOW + 1.0)
    vehicle = picture.vehicles["1"]
    assert (vehicle.local_ned, vehicle.local_targets) == (None, ())
    assert (vehicle.lat, vehicle.lon) == (48.0, 11.0)
    assert len(picture.targets) == 1


def test_local_position_after_a_global_one_does_not_renew_the_place_on_the_earth(fleet):
    """The autopilot rebooted indoors: where it was on the earth is as old as it is."""
    take, picture = fleet
    take(state(lat=48.0, lon=11.0, position_age_s=0.0))
    later = NOW + 30.0
    data = msgspec.json.encode(StateMessage(vehicle="1", time_unix=later, session="a", local=HERE, position_age_s=0.0))
    take(data, later)
    heard = picture.vehicles["1"].heard
    assert (heard["position"], heard["local"]) == pytest.approx((NOW, later))


@pytest.mark.parametrize(
    "changes",
    [{"north": 1e9}, {"cov": (-1.0, 0.0, 0.0, 1.0, 0.0, 1.0)}, {"cov": (1.0, 5.0, 0.0, 1.0, 0.0, 1.0)}, {"track": -1}],
)
def test_impossible_local_track_is_refused_and_said(fleet, changes):
    take, picture = fleet
    take(tracks_message(local_tracks=(local(4, **changes),)))
    assert "1" not in picture.vehicles
    assert any("malformed" in text.text for text in picture.update_since(0, NOW).texts)


def test_most_local_tracks_with_the_longest_labels_fit_one_message():
    tracks = tuple(local(number, label="\x01" * 64) for number in range(MAX_TRACKS_A_PART))
    (data,) = encoded(tracks_message(local_tracks=tracks))
    assert len(json.loads(data)["local_tracks"]) == MAX_TRACKS_A_PART


def test_reader_without_the_local_fields_takes_the_messages_as_before():
    """As it was: lat and lon of every track are required, and unknown fields are ignored."""
    (data,) = encoded(tracks_message(local_tracks=(local(4),)))
    former = [(each.name, each.type) for each in msgspec.structs.fields(TracksMessage) if each.name != "local_tracks"]
    message = msgspec.json.decode(data, type=msgspec.defstruct("FormerMessage", former))
    assert message.tracks == ()
    former = [(each.name, each.type) for each in msgspec.structs.fields(StateMessage) if each.name != "local"]
    seen = msgspec.json.decode(state(local=HERE), type=msgspec.defstruct("FormerState", former))
    assert (seen.lat, seen.heading_deg) == (None, 90.0)
