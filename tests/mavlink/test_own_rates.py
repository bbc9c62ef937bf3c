"""What was there before our first request: learned by GET_MESSAGE_INTERVAL and by arrivals, whatever is answered."""

from __future__ import annotations

from math import inf

import pytest
from merging_peer import ATTITUDE, GET, POSITION, QUATERNION, SET, by_itself, follow, merging, request
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import T0, Empty, Interval, S, autopilot, status

from fwav_companion.types import AutopilotKind, Message


def commands(them):
    fields = [out.fields for _, out in them.sent if out.name == "COMMAND_LONG"]
    return [(each["command"], each["param1"], each["param2"]) for each in fields if each["command"] in {SET, GET}]


def test_each_message_is_asked_after_before_anything_is_requested():
    them = merging().start().run(1.9)
    assert {command for command, _, _ in commands(them)} == {GET}
    assert len(commands(them)) == 7, "once for each message that we want of ArduPilot"
    them.run(0.3)
    assert commands(them)[7] == (SET, QUATERNION, 10_000.0)


def test_stated_rates_are_known_before_ours_flow_and_ours_are_granted_as_ever():
    them = merging()
    them.defaults_hz = {"ATTITUDE": 20.0, "GLOBAL_POSITION_INT": 5.0}
    them.start().run(12)
    known = by_itself(them)
    assert (known[ATTITUDE], known[POSITION], known[QUATERNION]) == (20.0, 5.0, 0.0)
    assert status(them, "ATTITUDE_QUATERNION").measured_hz == pytest.approx(100, rel=0.02)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)
    assert them.asks_for("GLOBAL_POSITION_INT") == [10.0]
    assert status(them, "GLOBAL_POSITION_INT").before_by == "stated"


def test_a_rate_of_an_earlier_run_is_not_taken_for_the_autopilots_own():
    """The service was restarted: the autopilot still sends at the rate requested before. The quaternion has no default
    to be reset to, and ArduPilot never sends it by itself.
    """
    them = merging()
    them.set_rate("ATTITUDE_QUATERNION", 100.0)
    them.set_rate("GLOBAL_POSITION_INT", 10.0)
    them.defaults_hz = {"GLOBAL_POSITION_INT": 3.0}
    them.start().run(12)
    known = by_itself(them)
    assert (known[QUATERNION], round(known[POSITION], 3)) == (0.0, 3.0)


def test_the_rates_are_learned_again_after_a_reboot_and_not_otherwise():
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 5.0}
    them.start().run(60)

    def questions():
        return sum(out.fields.get("command") == GET for _, out in them.sent)

    assert questions() == 7
    them.defaults_hz = {"GLOBAL_POSITION_INT": 8.0}
    them.reboot()
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(12)
    assert questions() == 14
    assert by_itself(them)[POSITION] == 8.0


def test_an_autopilot_that_answers_nothing_is_asked_three_times_for_one_rate():
    them = merging()
    them.hears = False
    them.defaults_hz = {"ATTITUDE": 4.0}
    them.start().run(120)
    assert sum(command == GET for command, _, _ in commands(them)) == 3
    assert by_itself(them) == {}, "nothing that arrives is ours"
    assert {row.state for row in them.rates.status().values()} <= {"unanswered", "held_back", "granted"}


@pytest.mark.parametrize(
    ("kind", "interval_us", "hz"),
    [
        (AutopilotKind.PX4, -1, inf),
        (AutopilotKind.PX4, 0, 0.0),
        (AutopilotKind.ARDUPILOT, -1, 0.0),
        (AutopilotKind.ARDUPILOT, 0, 0.0),
    ],
)
def test_what_an_interval_means_on_each_autopilot(kind, interval_us, hz):
    them = merging(kind=kind)
    them.stated_us = {"SYSTEM_TIME": interval_us}
    them.start().run(4)
    assert them.rates._loop.rows["SYSTEM_TIME"].before_hz == hz
    them.deliver(Message("MESSAGE_INTERVAL", 1, 1, "fc", Interval(2, 10_000)))
    assert them.rates._loop.rows["SYSTEM_TIME"].before_hz == hz, "a later answer is to a station's question"


@pytest.mark.parametrize("stated_hz", [0.0, 1.0, 100.0])
def test_a_stated_rate_that_the_arrivals_contradict_is_counted_and_the_measured_one_is_used(stated_hz):
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 5.0}
    them.stated_us = {"GLOBAL_POSITION_INT": round(1e6 / stated_hz) if stated_hz else -1}
    them.start().run(12)
    row = status(them, "GLOBAL_POSITION_INT")
    assert (row.contradicted, row.before_by) == (1, "measured")
    assert 5.0 <= by_itself(them)[POSITION] <= 5.6
    assert them.asks_for("GLOBAL_POSITION_INT") == [10.0], "the statement of 100 Hz does not stand for our rate"


def test_arrivals_before_the_adoption_count_as_before_our_request():
    them = merging()
    for i in range(12):
        them.rates.on_message(Message("GLOBAL_POSITION_INT", 1, 1, "fc", Empty()), T0 + i * S // 4)
    them.now = T0 + 3 * S
    them.states_rates = False
    them.defaults_hz = {"GLOBAL_POSITION_INT": 4.0}
    them.start().run(3)
    assert them.asks_for("GLOBAL_POSITION_INT"), "no further two seconds are needed"
    assert 4.0 <= by_itself(them)[POSITION] <= 4.3


def test_an_autopilot_that_acknowledges_and_states_nothing_is_measured():
    them = merging()
    them.states_rates = False
    them.defaults_hz = {"ATTITUDE": 4.0, "GLOBAL_POSITION_INT": 3.0, "SYSTEM_TIME": 2.0}
    them.start().run(12)
    known = by_itself(them)
    assert 3.0 <= known[POSITION] <= 3.6
    assert known[QUATERNION] == 0.0
    assert not them.rates.own_streams.stated
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)


def test_an_autopilot_that_denies_everything_sends_nothing_that_is_ours():
    them = merging()
    them.result, them.states_rates = mavlink.MAV_RESULT_DENIED, False
    them.defaults_hz = {"ATTITUDE": 10.0, "GPS_RAW_INT": 1.0}
    them.start().run(20)
    assert by_itself(them) == {}
    assert {row.state for row in them.rates.status().values()} == {"denied"}


def test_an_autopilot_that_supports_no_request_sends_nothing_that_is_ours():
    """Neither the command nor the group request has an effect."""
    them = merging()
    them.result, them.states_rates, them.groups = mavlink.MAV_RESULT_UNSUPPORTED, False, {}
    them.defaults_hz = {"ATTITUDE": 10.0, "GPS_RAW_INT": 1.0}
    them.start().run(60)
    assert by_itself(them) == {}
    assert status(them, "ATTITUDE").state == "unsupported"


def test_an_autopilot_that_takes_group_requests_in_silence_is_found_out():
    """INAV: COMMAND_LONG is not read, REQUEST_DATA_STREAM is, and nothing is acknowledged."""
    them = merging(kind=AutopilotKind.OTHER)
    them.knows_intervals = them.acknowledges = False
    them.defaults_hz = {"ATTITUDE": 3.0, "GLOBAL_POSITION_INT": 2.0}
    them.start().run(40)
    for name, hz in (("ATTITUDE", 100.0), ("GLOBAL_POSITION_INT", 10.0)):
        assert status(them, name).state == "granted"
        assert status(them, name).measured_hz == pytest.approx(hz, rel=0.06)
    assert 2.0 <= by_itself(them)[POSITION] <= 2.6


def test_a_message_that_is_refused_is_not_ours():
    them = merging()
    them.denied = {"ATTITUDE_QUATERNION"}
    them.start().run(10)
    assert QUATERNION not in by_itself(them)
    assert ATTITUDE in by_itself(them)


def test_a_message_that_the_autopilot_sends_faster_by_itself_stays_as_it_is():
    """PX4's Onboard mode: other components behind us depend on its default rates."""
    them = merging(kind=AutopilotKind.PX4)
    them.defaults_hz = {"GLOBAL_POSITION_INT": 50.0, "LOCAL_POSITION_NED": 30.0, "DISTANCE_SENSOR": 5.0}
    them.start().run(12)
    measured = {name: status(them, name).measured_hz for name in (*them.defaults_hz, "ATTITUDE_QUATERNION")}
    expected = {"GLOBAL_POSITION_INT": 50, "LOCAL_POSITION_NED": 30, "DISTANCE_SENSOR": 10, "ATTITUDE_QUATERNION": 100}
    assert measured == pytest.approx(expected, rel=0.06)
    assert not them.asks_for("GLOBAL_POSITION_INT"), "there is no difference to request"
    assert follow(them, request({POSITION: 1.0})) == [(POSITION, 50)]
    assert follow(them, request({POSITION: 80.0})) == []


def test_a_stream_of_unlimited_rate_is_left_alone():
    them = merging(kind=AutopilotKind.PX4)
    them.stated_us = {"GPS_RAW_INT": -1}
    them.defaults_hz = {"GPS_RAW_INT": 5.0}
    them.start().run(12)
    assert not them.asks_for("GPS_RAW_INT")
    assert status(them, "GPS_RAW_INT").state == "granted"


def test_plain_attitude_is_slow_all_the_same_while_the_quaternion_flows():
    them = merging(kind=AutopilotKind.PX4)
    them.defaults_hz = {"ATTITUDE": 100.0, "ATTITUDE_QUATERNION": 50.0}
    them.start().run(12)
    assert status(them, "ATTITUDE").measured_hz == pytest.approx(4.0, abs=0.5)


def test_system_zero_is_sent_no_request_and_its_streams_are_not_ours():
    them = merging()
    them.defaults_hz = {"ATTITUDE": 10.0}
    them.send_defaults()
    vehicle = autopilot(AutopilotKind.OTHER)
    them.rates.adopt(type(vehicle)(0, 200, vehicle.kind, 2, False, "fc"), them.now)
    them.run(20)
    assert them.sent == []
    assert {row.state for row in them.rates.status().values()} == {"unsupported"}
    assert by_itself(them) == {}


def test_only_home_and_origin_are_requested_while_the_gate_is_closed_and_measuring_goes_on():
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 5.0}
    opens_ns = T0 + 5 * S
    them.rates.gate = lambda now: now >= opens_ns
    them.start().run(4.9)
    assert {each.fields["param1"] for _, each in them.sent} == {242, 49}, "home and origin"
    seldom = len(them.sent)
    them.run(4)
    assert len(them.sent) > seldom
    assert min(at for at, _ in them.sent[seldom:]) >= opens_ns
    assert by_itself(them)[POSITION] == 5.0
