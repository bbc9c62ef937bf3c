"""Where stations' requests are merged, the autopilot's default rates are learned before ours are asked for."""

from __future__ import annotations

from math import inf

import pytest
from merging_peer import ATTITUDE, GET, POSITION, QUATERNION, SET, by_itself, follow, merging, request
from rates_peer import Interval, peer, status

from fwav_companion.types import AutopilotKind, Message


def test_a_message_is_stopped_reset_and_asked_after_before_its_first_request():
    """All in one write, followed by the request itself: no round trip is lost."""
    them = merging().start()
    commands = [out.fields for out in them.rates.on_wake(them.now) if out.name == "COMMAND_LONG"]
    first = [(fields["command"], fields["param1"], fields["param2"]) for fields in commands[:4]]
    asked = [(SET, -1.0), (SET, 0.0), (GET, 0.0), (SET, 10_000.0)]
    assert first == [(command, QUATERNION, param2) for command, param2 in asked]


def test_its_own_rates_are_known_before_ours_flow_and_ours_are_granted_as_ever():
    them = merging()
    them.defaults_hz = {"ATTITUDE": 20.0, "GLOBAL_POSITION_INT": 5.0}
    them.start().run(12)
    known = by_itself(them)
    assert (known[ATTITUDE], known[POSITION], known[QUATERNION]) == (20.0, 5.0, 0.0)
    assert status(them, "ATTITUDE_QUATERNION").measured_hz == pytest.approx(100, rel=0.02)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)
    assert them.asks_for("GLOBAL_POSITION_INT") == [10.0]


def test_a_rate_of_an_earlier_run_is_not_taken_for_the_autopilots_own():
    """The service was restarted: the autopilot still sends at the rate requested before. The message has no default: a
    reset is refused.
    """
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 3.0}
    for name, hz in (("ATTITUDE_QUATERNION", 100.0), ("GLOBAL_POSITION_INT", 10.0)):
        them.set_rate(name, hz)
    them.start().run(12)
    known = by_itself(them)
    assert (known[QUATERNION], round(known[POSITION], 3)) == (0.0, 3.0)


def test_it_is_asked_again_after_a_reboot_and_not_otherwise():
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 5.0}
    them.start().run(60)

    def questions():
        return sum(out.fields.get("command") == GET for _, out in them.sent)

    assert questions() == 7, "once for each message that we want of ArduPilot"
    them.reboot()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 8.0}
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(12)
    assert questions() == 14
    assert by_itself(them)[POSITION] == 8.0


def test_an_autopilot_that_answers_nothing_is_not_stopped_again_and_again():
    them = merging()
    them.acknowledges = False
    them.start().run(120)
    stops = [out for _, out in them.sent if out.fields.get("param2") == -1.0 and out.fields["param1"] == QUATERNION]
    assert len(stops) == 2
    assert status(them, "ATTITUDE_QUATERNION").state == "granted", "it comes all the same"


@pytest.mark.parametrize(
    ("kind", "interval_us", "hz"),
    [
        (AutopilotKind.PX4, -1, inf),
        (AutopilotKind.PX4, 0, 0.0),
        (AutopilotKind.PX4, 20_000, 50.0),
        (AutopilotKind.ARDUPILOT, -1, 0.0),
        (AutopilotKind.ARDUPILOT, 0, 0.0),
    ],
)
def test_what_an_interval_means_on_each_autopilot(kind, interval_us, hz):
    them = merging(kind=kind)
    them.tell_interval = lambda _: None
    them.start().run(0.1)
    them.deliver(Message("MESSAGE_INTERVAL", 1, 1, "fc", Interval(QUATERNION, interval_us)))
    assert by_itself(them)[QUATERNION] == hz
    them.deliver(Message("MESSAGE_INTERVAL", 1, 1, "fc", Interval(QUATERNION, 10_000)))
    assert by_itself(them)[QUATERNION] == hz, "a later answer is to a station's question, and shows our rate"


def test_where_no_link_merges_nothing_is_stopped_or_asked_after():
    them = peer().start().run(10)
    assert not [out for _, out in them.sent if out.fields.get("command") == GET or out.fields.get("param2") == -1.0]


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
    assert follow(them, request({POSITION: 1.0})) == [(POSITION, 50)]
    assert follow(them, request({POSITION: 80.0})) == []


def test_a_stream_of_unlimited_rate_gets_its_default_back():
    them = merging(kind=AutopilotKind.PX4)
    them.tell_interval = lambda _: None
    them.start().run(1)
    them.deliver(Message("MESSAGE_INTERVAL", 1, 1, "fc", Interval(POSITION, -1)))
    before = len(them.sent)
    them.run(0.01)
    (restored,) = [out.fields for _, out in them.sent[before:] if out.fields.get("param1") == POSITION]
    assert restored["param2"] == 0.0


def test_plain_attitude_is_slow_all_the_same_while_the_quaternion_flows():
    them = merging(kind=AutopilotKind.PX4)
    them.defaults_hz = {"ATTITUDE": 100.0, "ATTITUDE_QUATERNION": 50.0}
    them.start().run(12)
    assert status(them, "ATTITUDE").measured_hz == pytest.approx(4.0, abs=0.5)
