"""Whatever an autopilot answers to rate requests, stations receive what arrived before ours, in invented time."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from merged_network import LINKS, MergedNetwork, Station

from sitl_mock import scenario
from sitl_mock.autopilots import AUTOPILOTS

ALL = 0
TELEMETRY = ("ATTITUDE", "GLOBAL_POSITION_INT", "GPS_RAW_INT", "SYSTEM_TIME", "VFR_HUD", "SYS_STATUS")
OWN_HZ = {"ATTITUDE": 4.0, "GLOBAL_POSITION_INT": 3.0, "GPS_RAW_INT": 2.0, "SYSTEM_TIME": 2.0, "VFR_HUD": 4.0,
          "SYS_STATUS": 2.0}  # fmt: skip
"""Rates of the default scenario's autopilot."""


def flown(
    autopilot: str, *stations: Station, seconds: float = 20.0, name: str = "default", **differences: Any
) -> MergedNetwork:
    changes = AUTOPILOTS[autopilot][1] if autopilot else {}
    options = scenario(name).but({"seconds": seconds, "camera.enabled": False, **changes, **differences})
    return MergedNetwork(options, stations, text=f"{LINKS}[rates]\nattitude = 30\n").fly()


def states(network: MergedNetwork) -> dict[str, str]:
    return {name: row.state for name, row in network.pipeline.status(network._now).rates.items()}


def test_behind_a_mute_autopilot_every_message_comes_at_the_rate_at_which_it_arrives():
    """Before, the four messages that we request vanished ten seconds after the start, without a word."""
    station = Station("ground")
    flown("mute", station, seconds=30.0)
    rates = station.rates(12.0, 30.0)
    assert {name: rates.get(name, 0.0) for name in TELEMETRY} == pytest.approx(OWN_HZ, abs=0.2)


def test_an_autopilot_without_stated_rates_is_measured_and_its_streams_are_not_thinned():
    station = Station("ground")
    network = flown("ack-only", station, seconds=30.0)
    rates = station.rates(12.0, 30.0)
    for name in TELEMETRY:
        assert OWN_HZ[name] - 0.1 <= rates.get(name, 0.0) <= OWN_HZ[name] + 1.0, name
    assert not station.of("ATTITUDE_QUATERNION"), "it came only after our request"
    assert states(network)["ATTITUDE_QUATERNION"] == "granted"


def test_attitude_that_came_only_after_our_request_passes_at_four_hertz():
    station = Station("ground")
    quiet = {"autopilot.rates_hz": dict.fromkeys(("ATTITUDE", "GLOBAL_POSITION_INT"), 0.0)}
    flown("ack-only", station, **quiet)
    rates = station.rates(10.0, 20.0)
    assert rates["ATTITUDE"] == pytest.approx(4.0, abs=0.3)
    assert "GLOBAL_POSITION_INT" not in rates


def test_inav_is_asked_by_group_and_its_station_keeps_what_it_had():
    station = Station("ground")
    network = flown("inav", station, seconds=40.0)
    rates = station.rates(25.0, 40.0)
    for name, hz in {"ATTITUDE": 10.0, "GLOBAL_POSITION_INT": 5.0, "GPS_RAW_INT": 5.0, "SYSTEM_TIME": 1.0}.items():
        assert rates[name] >= hz - 0.2, name
    row = network.pipeline.status(network._now).rates["ATTITUDE"]
    assert (row.state, row.measured_hz) == ("granted", pytest.approx(30.0, rel=0.05))


def test_betaflight_is_adopted_sent_no_request_and_passed_on_as_it_comes():
    station = Station("ground")
    network = flown("betaflight", station)
    identity = network.pipeline.identity
    assert (identity.system, identity.vehicle) == (1, 0)
    attitudes = [at for at, heard in station.heard if heard.name == "ATTITUDE" and at >= 8.0]
    assert len(attitudes) / 12.0 == pytest.approx(10.0, abs=0.3)
    assert not {"COMMAND_LONG", "REQUEST_DATA_STREAM", "PARAM_REQUEST_READ"} & network.mock.vehicle.heard.keys()
    assert {row.state for row in network.pipeline.status(network._now).rates.values()} == {"unsupported"}
    assert any("we speak as system 1" in text for text in network.notices)
    assert {heard.system for _, heard in station.heard if heard.component == 191} == {1}


def test_an_autopilot_that_knows_group_requests_alone_streams_by_them():
    """ArduPilot before 4.0."""
    station = Station("ground")
    network = flown("", station, name="old_rates")
    assert states(network)["ATTITUDE"] == "granted"
    assert network.pipeline.status(network._now).rates["ATTITUDE"].measured_hz == pytest.approx(30.0, rel=0.06)
    assert station.rates(10.0, 20.0)["ATTITUDE"] >= 4.0 - 0.2


@pytest.mark.slow
def test_a_station_that_asks_and_leaves_does_not_take_what_the_silent_one_has():
    """The silent one gets what the autopilot streams; what only we request does not go there, attitude at 4 Hz.

    Messages that only the first station and we requested are sent to it for a minute after it left, and then no longer.
    """
    asks = Station("ground", silent_from_s=10.0).ask_group(6.0, ALL, 10)
    silent = Station("tablet", 254)
    flown("", asks, silent, seconds=84.0, name="arducopter")
    rates = silent.rates(76.0, 84.0)
    assert rates["ATTITUDE"] == pytest.approx(4.0, abs=0.3)
    assert rates["VFR_HUD"] == pytest.approx(10.0, abs=0.5), "the autopilot still streams it"
    assert not {"DISTANCE_SENSOR", "ATTITUDE_QUATERNION"} & rates.keys()
    assert asks.rates(50.0, 68.0)["GLOBAL_POSITION_INT"] == pytest.approx(10.0, abs=0.2)
    assert asks.rates(76.0, 80.0)["VFR_HUD"] == pytest.approx(10.0, abs=0.3), "the autopilot still sends it"
    assert "DISTANCE_SENSOR" not in asks.rates(76.0, 80.0)


def test_after_a_reboot_the_stations_rates_are_requested_again_by_group_and_by_message():
    """Neither station asks again: before, only messages that we need came back."""
    groups = Station("ground").ask_group(6.0, ALL, 5)
    single = Station("tablet", 254).ask(6.5, "VFR_HUD", 8.0).ask(6.6, "ATTITUDE", 12.0)
    network = flown("", groups, single, name="arducopter", seconds=30.0, **{"others.reboots_at_s": (12.0,)})
    after, other = groups.rates(20.0, 30.0), single.rates(20.0, 30.0)
    for name in ("SYS_STATUS", "RC_CHANNELS", "BATTERY_STATUS", "VFR_HUD", "GLOBAL_POSITION_INT"):
        assert after.get(name, 0.0) == pytest.approx(5.0, abs=0.4), name
    assert other["VFR_HUD"] == pytest.approx(8.0, abs=0.4)
    assert other["ATTITUDE"] == pytest.approx(12.0, abs=0.5)
    rates = network.pipeline.status(network._now).rates
    assert rates["ATTITUDE_QUATERNION"].measured_hz == pytest.approx(30.0, rel=0.05)


HZ = st.sampled_from([0.0, 0.5, 1.0, 3.0, 10.0, 25.0])


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    answers=st.sampled_from(["all", "ack_only", "groups_only", "nothing"]),
    streams=st.sampled_from(["", "arducopter", "px4_normal"]),
    knows=st.booleans(),
    ceiling_hz=st.sampled_from([0.0, 2.0, 18.0]),
    own=st.fixed_dictionaries(dict.fromkeys((*TELEMETRY, "ATTITUDE_QUATERNION"), HZ)),
    stated=st.sampled_from([None, -1, 0, 40_000, 2_000_000]),
)
def test_a_station_never_receives_less_than_what_arrived_before_our_request(
    answers, streams, knows, ceiling_hz, own, stated
):
    """``stated``: an interval in microseconds that the autopilot states for each message, whatever is true.

    SYS_STATUS is left out where groups are requested: it shares one with GPS_RAW_INT, whose rate it then takes. An
    ArduPilot that states its rates sends no quaternion by itself: it is in no group.
    """
    if not streams.startswith("px4") and answers == "all":
        own = {**own, "ATTITUDE_QUATERNION": 0.0}
    station = Station("ground")
    changes = {
        "autopilot.firmware": "px4" if streams.startswith("px4") else "ardupilot",
        "autopilot.streams": streams,
        "autopilot.answers": answers,
        "autopilot.knows_set_message_interval": knows,
        "autopilot.true_ceiling_hz": ceiling_hz,
        "autopilot.rates_hz": own,
        "seconds": 22.0,
        "camera.enabled": False,
    }
    network = MergedNetwork(scenario("default").but(changes), [station], text=f"{LINKS}[rates]\nattitude = 30\n")
    if stated is not None:
        network.mock.vehicle._broadcast.streams.reported_interval_us = lambda _name: stated  # type: ignore[method-assign]
    network.fly()
    before, after = station.rates(0.5, 3.0), station.rates(10.0, 22.0)
    by_group = answers == "groups_only" or not knows
    for name, hz in own.items():
        if by_group and name == "SYS_STATUS":
            continue
        least = min(hz, 4.0) if name in {"ATTITUDE", "ATTITUDE_QUATERNION"} else hz
        if ceiling_hz:
            least = min(least, ceiling_hz)
        if before.get(name, 0.0) >= 1.0:
            assert after.get(name, 0.0) >= 0.94 * least - 0.1, (name, before.get(name), after.get(name))
