"""An autopilot that dies in flight, while pictures go on: what is sent of the vehicle has its own time."""

from __future__ import annotations

from math import isnan

import msgspec
import pytest
from flying import fly

from fwav_companion.fleet.fleet_tracks import FleetTracks
from fwav_companion.fleet.options import FleetTable
from fwav_companion.publishing.cot_markers import MapMarkers
from fwav_companion.publishing.options import PublishOptions
from sitl_mock import scenario

DIES_S, SECONDS = 12.0, 30.0
KNOWN_UNTIL_S = DIES_S + 5.6
"""A place older than 5 s gives no distance; they are sent each half second."""


@pytest.fixture(name="flight", scope="module")
def _flight():
    return fly(scenario("demo").but({"seconds": SECONDS, "downlink.silences": ((DIES_S, 1e3),)}), ())


def test_after_the_autopilot_died_no_distance_from_the_vehicle_is_sent(flight):
    def values(begin_s: float, end_s: float) -> list[float]:
        times = ((flight.mock.flight_s(now), each) for now, each in flight.companion.sent)
        numbers = (each.fields for at, each in times if begin_s < at < end_s and each.name == "NAMED_VALUE_FLOAT")
        return [each["value"] for each in numbers if each["name"] in {"TGT_DIST", "TGT_BRG"}]

    assert any(not isnan(value) for value in values(0.0, DIES_S))
    assert all(isnan(value) for value in values(KNOWN_UNTIL_S, SECONDS))


def test_after_the_autopilot_died_the_fleet_and_the_map_get_no_new_place_of_the_vehicle(flight):
    companion = flight.companion
    tracks, situation, obstacle = companion.pipeline.shared(companion._now)
    situation = msgspec.structs.replace(situation, utc_minus_host_s=1000.0)
    _, state = FleetTracks(FleetTable(), companion.config.priors, "s").messages(tracks, situation, obstacle)
    silent_s = flight.mock.flight_s(companion._now) - DIES_S
    assert silent_s > 15.0
    assert state.lat is not None
    assert state.position_age_s == pytest.approx(silent_s, abs=0.3)
    assert state.autopilot_age_s == pytest.approx(silent_s, abs=1.1)
    assert state.frame_age_s < 1.0
    assert not state.ready
    markers = MapMarkers(PublishOptions(cot="udpout://127.0.0.1:1", unit="a"))
    events = markers.due(tracks, None, situation)
    assert not isinstance(events, str)
    assert [each for each in events if b".vehicle" in each] == []
