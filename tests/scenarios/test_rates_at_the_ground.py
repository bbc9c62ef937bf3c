"""Message rates that ground stations behind the service receive, with the mock streaming as ArduCopter and as PX4, in
invented time.
"""

from __future__ import annotations

from typing import Any

import pytest
from draws import first_of
from merged_network import LINKS, MergedNetwork, Station

from sitl_mock import scenario
from sitl_mock.codec import Heard, Listener

SHOWN = ("SYS_STATUS", "VFR_HUD", "BATTERY_STATUS", "RC_CHANNELS", "EKF_STATUS_REPORT", "GPS_RAW_INT", "ATTITUDE")
"""Messages that a station's display needs."""
ALL = 0


def flown(
    name: str, *stations: Station, seconds: float = 16.0, attitude_hz: float = 30.0, **differences: Any
) -> MergedNetwork:
    """Stations ask for at most 20 Hz: where our own rate is not judged, 30 Hz stand for the usual 100."""
    options = scenario(name).but({"seconds": seconds, "camera.enabled": False, **differences})
    return MergedNetwork(options, stations, text=f"{LINKS}[rates]\nattitude = {attitude_hz}\n").fly()


def heard_in(data: bytes) -> list[Heard]:
    return Listener().feed(data)


def test_arducopter_sends_its_heartbeat_and_four_attitudes_a_second_to_a_station_that_asks_for_nothing():
    station = Station("ground")
    flown("arducopter", station)
    unasked = {"HEARTBEAT", "HOME_POSITION", "GPS_GLOBAL_ORIGIN", "TIMESYNC"}
    rates = station.rates(6.0, 16.0)
    assert set(rates) <= unasked | {"ATTITUDE", "MESSAGE_INTERVAL"}
    assert rates["ATTITUDE"] == pytest.approx(4.0, abs=0.3)


def test_a_station_that_asks_arducopter_as_mavproxy_does_gets_all_groups_and_nothing_that_only_we_want():
    station = Station("ground").ask_group(6.0, ALL, 4).ask_group(21.0, ALL, 4)
    network = flown("arducopter", station, seconds=32.0, attitude_hz=100.0)
    rates = station.rates(8.0, 32.0)
    assert {name: rates.get(name) for name in SHOWN} == pytest.approx(dict.fromkeys(SHOWN, 4.0), abs=0.2)
    assert not station.of("ATTITUDE_QUATERNION")
    ours = network.pipeline.status(network._now).rates
    assert ours["ATTITUDE_QUATERNION"].measured_hz == pytest.approx(100.0, rel=0.02)
    assert ours["GLOBAL_POSITION_INT"].measured_hz == pytest.approx(10.0, rel=0.05)
    assert {rate.undone_by for rate in ours.values()} == {None}
    assert not [text for text in network.notices if "fell" in text]


def test_a_station_that_asks_as_qgroundcontrol_does_gets_each_group_at_its_rate():
    """APMFirmwarePlugin::initializeStreamRates: one request a group."""
    hz = {1: 2, 2: 2, 3: 2, 6: 3, 10: 12, 11: 8, 12: 3}
    station = Station("ground")
    for number, rate in hz.items():
        station.ask_group(6.0 + number / 100, number, rate)
    flown("arducopter", station)
    expected = {
        "RAW_IMU": 2, "SYS_STATUS": 2, "RC_CHANNELS": 2, "GLOBAL_POSITION_INT": 3, "ATTITUDE": 12, "VFR_HUD": 8,
        "BATTERY_STATUS": 3, "DISTANCE_SENSOR": 3,
    }  # fmt: skip
    rates = station.rates(8.0, 16.0)
    assert {name: rates.get(name) for name in expected} == pytest.approx(expected, abs=0.25)
    assert not station.of("ATTITUDE_QUATERNION")


def test_a_station_that_asks_message_by_message_is_answered_by_the_autopilot_and_gets_them():
    """As MAVSDK does."""
    station = Station("ground").ask(6.0, "SYS_STATUS", 2.0).ask(6.1, "VFR_HUD", 5.0).ask(6.2, "ATTITUDE_QUATERNION", 20)
    station.ask(6.3, "ALTITUDE", 5.0)  # which ArduPilot does not have
    flown("arducopter", station)
    answers = [(ack["command"], ack["result"], ack["target_system"]) for ack in station.of("COMMAND_ACK")]
    assert answers == [(511, 0, 255), (511, 0, 255), (511, 0, 255), (511, 2, 255)]
    rates = station.rates(8.0, 16.0)
    asked = {"SYS_STATUS": 2.0, "VFR_HUD": 5.0, "ATTITUDE_QUATERNION": 20.0}
    assert {name: rates.get(name) for name in asked} == pytest.approx(asked, abs=0.25)


def test_our_rates_follow_in_the_write_that_carries_the_request_unchanged():
    """ArduPilot's own rates fall between the two for no longer than the write takes."""
    station = Station("ground").ask_group(9.0, ALL, 2)
    network = flown("arducopter", station, seconds=12.0, attitude_hz=100.0)
    (write,) = [data for _, data in network.to_autopilot if b"\x42\x00\x00" in data and b"\xff\xbe" in data]
    names = [(heard.name, heard.system) for heard in heard_in(write)]
    assert names[0] == ("REQUEST_DATA_STREAM", 255)
    assert set(names[1:]) == {("COMMAND_LONG", 1)}
    followed = {heard.fields["param1"]: heard.fields["param2"] for heard in heard_in(write)[1:]}
    assert followed == {30.0: 250_000.0, 33.0: 100_000.0, 132.0: 100_000.0}
    gaps = network.mock.vehicle.rates_hz
    assert (gaps["ATTITUDE_QUATERNION"], gaps["GLOBAL_POSITION_INT"]) == (100.0, 10.0)


def test_two_stations_get_what_each_asked_for_whoever_asked_last():
    brisk = Station("ground").ask_group(6.0, ALL, 10)
    calm = Station("tablet", 254).ask_group(7.0, ALL, 2)
    flown("arducopter", brisk, calm)
    for station, hz in ((brisk, 10.0), (calm, 2.0)):
        rates = station.rates(9.0, 16.0)
        assert {name: rates.get(name) for name in SHOWN} == pytest.approx(dict.fromkeys(SHOWN, hz), abs=0.4)


def test_two_stations_on_one_link_get_the_higher_rate():
    one, other = Station("ground").ask_group(6.0, ALL, 5), Station("ground", 254).ask_group(7.0, ALL, 1)
    flown("arducopter", one, other)
    assert one.rates(9.0, 16.0)["VFR_HUD"] == pytest.approx(5.0, abs=0.3)
    assert other.rates(9.0, 16.0)["VFR_HUD"] == pytest.approx(5.0, abs=0.3)


def test_a_station_that_stops_a_message_gets_no_more_of_it_and_we_still_do():
    station = Station("ground").ask_group(6.0, ALL, 4).ask(10.0, "GLOBAL_POSITION_INT", 0.0)
    network = flown("arducopter", station)
    assert "GLOBAL_POSITION_INT" not in station.rates(11.0, 16.0)
    assert network.mock.vehicle.rates_hz["GLOBAL_POSITION_INT"] == 10.0


def test_a_message_that_a_station_requests_once_arrives_though_only_we_stream_it():
    station = Station("ground").command(8.0, 512, 31.0)
    flown("arducopter", station, seconds=12.0)
    assert len(station.of("ATTITUDE_QUATERNION")) == 1


def test_arduplane_sends_its_own_groups_and_our_rates_do_not_raise_them_at_the_ground():
    station = Station("ground")
    flown("arduplane", station)
    rates = station.rates(6.0, 16.0)
    for name in (*SHOWN, "GLOBAL_POSITION_INT", "DISTANCE_SENSOR"):
        assert rates[name] == pytest.approx(1.0, abs=0.15), name
    assert not station.of("ATTITUDE_QUATERNION")


def test_px4_for_a_radio_keeps_its_own_streams_and_sends_no_quaternion():
    station = Station("ground")
    flown("px4_normal", station)
    rates = station.rates(6.0, 16.0)
    expected = {
        "ATTITUDE": 4.0, "VFR_HUD": 4.0, "GLOBAL_POSITION_INT": 5.0, "RC_CHANNELS": 5.0, "SYS_STATUS": 1.0,
        "LOCAL_POSITION_NED": 1.0, "BATTERY_STATUS": 0.5, "ALTITUDE": 1.0,
    }  # fmt: skip
    assert {name: rates.get(name) for name in expected} == pytest.approx(expected, abs=0.3)
    assert not station.of("ATTITUDE_QUATERNION")


def test_px4_for_a_companion_passes_with_attitude_at_four_hertz():
    station = Station("ground")
    network = flown("px4_onboard", station, attitude_hz=100.0)
    rates = station.rates(6.0, 16.0)
    assert (rates["ATTITUDE"], rates["ATTITUDE_QUATERNION"]) == pytest.approx((4.0, 4.0), abs=0.3)
    own = {"VFR_HUD": 10.0, "SYS_STATUS": 5.0, "GLOBAL_POSITION_INT": 50.0, "LOCAL_POSITION_NED": 30.0}
    assert {name: rates[name] for name in own} == pytest.approx(own, rel=0.05), "ours are lower, and lower nothing"
    assert rates["GPS_RAW_INT"] == pytest.approx(5.0, abs=0.3), "of unlimited rate: as the receiver has news"
    ours = network.pipeline.status(network._now).rates["ATTITUDE_QUATERNION"]
    assert ours.measured_hz == pytest.approx(100.0, rel=0.02)


def test_a_station_that_asks_px4_gets_what_it_asked_for_and_groups_which_px4_ignores_harm_nothing():
    station = Station("ground").ask(6.0, "ATTITUDE", 20.0).ask(6.1, "VFR_HUD", 2.0).ask_group(6.2, ALL, 4)
    flown("px4_normal", station)
    rates = station.rates(8.0, 16.0)
    assert rates["VFR_HUD"] == pytest.approx(2.0, abs=0.2)
    assert rates["ATTITUDE"] == pytest.approx(4.0, abs=0.3), "the later request is for 4 Hz"
    assert rates["SYS_STATUS"] == pytest.approx(1.0, abs=0.1), "PX4's own rate"
    asked = Station("ground").ask(6.0, "ATTITUDE", 20.0)
    flown("px4_normal", asked)
    assert asked.rates(8.0, 16.0)["ATTITUDE"] == pytest.approx(20.0, abs=0.5)


def test_after_a_reboot_the_autopilots_own_rates_are_learned_again():
    station = Station("ground")
    changes = {"others.reboots_at_s": (10.0,), "autopilot.group_rates_hz": {6: 2.0}}
    network = flown("arducopter", station, seconds=30.0, **changes)
    assert network.pipeline.own_streams.before_hz[33] == pytest.approx(2.0)
    assert station.rates(18.0, 30.0)["GLOBAL_POSITION_INT"] == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("setting", first_of("false", "true"))
def test_where_requests_are_not_merged_everything_goes_to_the_ground_as_before(setting):
    text = LINKS.replace('role = "gcs"', f'role = "gcs"\nforward_rate_requests = {setting}')
    station = Station("ground").ask_group(8.0, ALL, 4)
    options = scenario("arducopter").but({"seconds": 16.0, "camera.enabled": False})
    network = MergedNetwork(options, [station], text=text).fly()
    assert station.rates(12.0, 16.0)["ATTITUDE_QUATERNION"] == pytest.approx(100.0, rel=0.03)
    assert ("VFR_HUD" in station.rates(12.0, 16.0)) is (setting == "true")
    assert network.node.statistics(network._now)[1].stopped == (setting == "false")
