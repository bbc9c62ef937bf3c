"""Our rates where stations' requests are merged: the autopilot's default rates, and the requests that follow."""

from __future__ import annotations

from math import inf

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import MS, Ack, Interval, autopilot, peer, status

from fwav_companion.mavlink.client.ack_order import AckOrder
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.mavlink.wire.stream_groups import group_ids
from fwav_companion.types import AutopilotKind, Message

ATTITUDE, QUATERNION, POSITION, GPS, HUD = 30, 31, 33, 24, 74
SET, GET = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL


def merging(**how):
    return peer(merges_requests=True, **how)


def by_itself(them):
    return dict(them.rates.own_streams.by_itself_hz)


def request(rates, by_group=False, target=(1, 1), system=255):
    return RateRequest(
        system=system, component=190, link="ground", target_system=target[0], target_component=target[1], rates=rates,
        by_group=by_group,
    )  # fmt: skip


def follow(them, asked, demanded=None):
    """The requests that follow at once, after the autopilot has accepted both."""
    for msgid, hz in asked.rates.items():
        name = {ATTITUDE: "ATTITUDE", QUATERNION: "ATTITUDE_QUATERNION", POSITION: "GLOBAL_POSITION_INT"}.get(msgid)
        if name in them.intervals_ns and hz:
            them.set_rate(name, hz)
    highest = {msgid: hz for msgid, hz in asked.rates.items() if hz} | (demanded or {})
    followed = them.rates.on_merged_requests([asked], highest, them.now)
    for out in followed:
        them.take(out)
    return [
        (int(out.fields["param1"]), round(1e6 / out.fields["param2"]))
        if out.name == "COMMAND_LONG"
        else (out.name, out.fields["req_stream_id"], out.fields["req_message_rate"])
        for out in followed
    ]


# The autopilot's default rates.


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


# Requests that follow a request.


def test_our_higher_rates_follow_at_once_and_no_rate_ever_falls():
    them = merging().start().run(20)
    before = len(them.asked)
    assert follow(them, request({QUATERNION: 4.0})) == [(QUATERNION, 100)]
    assert them.intervals_ns["ATTITUDE_QUATERNION"] == 10 * MS
    them.run(20)
    got = status(them, "ATTITUDE_QUATERNION")
    assert (got.measured_hz, got.undone_by) == (pytest.approx(100, rel=0.02), None)
    assert len(them.asked) == before + 1, "it is not asked for again by the slower way"


def test_behind_all_groups_each_of_ours_in_them_follows():
    them = merging().start().run(20)
    asked = request(dict.fromkeys(group_ids(0), 1.0), by_group=True)
    assert sorted(follow(them, asked)) == [(GPS, 2), (ATTITUDE, 4), (POSITION, 10), (132, 10)]


def test_half_a_dozen_requests_in_a_row_leave_every_rate_where_it_was():
    them = merging().start().run(20)
    for number in (1, 2, 3, 6, 10, 11, 12):
        follow(them, request(dict.fromkeys(group_ids(number), 2.0), by_group=True))
    them.run(10)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)
    assert not [notice for notice in them.rates.notices() if "fell" in notice.text]


def test_a_station_that_asks_for_more_gets_more_and_its_end_is_no_fall():
    them = merging().start().run(20)
    assert follow(them, request({POSITION: 25.0})) == []
    them.run(10)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(25, rel=0.06)
    assert follow(them, request({POSITION: 1.0})) == [(POSITION, 10)]
    them.run(10)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)
    assert not [notice for notice in them.rates.notices() if "fell" in notice.text]


def test_a_rate_that_we_ask_for_again_does_not_lower_a_stations():
    """After a reboot the station requests its 25 Hz before we do."""
    them = merging().start().run(20)
    follow(them, request({POSITION: 25.0}))
    them.reboot()
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(10)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(25, rel=0.06)
    them.rates.stations_want({})  # it left
    them.reboot()
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(10)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)


def test_a_stations_rate_that_the_autopilot_refuses_costs_us_nothing():
    them = merging()
    them.ceiling_hz = 320.0
    them.start().run(20)
    follow(them, request({QUATERNION: 4.0}), {QUATERNION: 1000.0})
    assert them.intervals_ns["ATTITUDE_QUATERNION"] == 10 * MS
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(10)
    assert them.intervals_ns["ATTITUDE_QUATERNION"] == 10 * MS


def test_groups_that_a_station_slows_are_ardupilots_defaults_from_then_on():
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 25.0}
    them.start().run(12)
    assert by_itself(them)[POSITION] == pytest.approx(25.0)
    asked = request(dict.fromkeys(group_ids(6), 2.0), by_group=True)
    assert follow(them, asked) == [(POSITION, 10)], "ours; its former default is no one's any more"
    assert by_itself(them)[POSITION] == 2.0
    follow(them, request(dict.fromkeys(group_ids(6), 30.0), by_group=True))
    assert by_itself(them)[POSITION] == 2.0, "a higher one is the station's alone"


def test_another_stations_message_is_restored_though_we_do_not_want_it():
    them = merging().start().run(20)
    assert follow(them, request({HUD: 1.0}), {HUD: 10.0}) == [(HUD, 10)]


def test_a_request_to_another_vehicle_is_followed_by_nothing():
    them = merging().start().run(20)
    assert follow(them, request({QUATERNION: 4.0}, target=(2, 1))) == []


def test_before_adoption_nothing_follows():
    them = merging()
    assert them.rates.on_merged_requests([request({QUATERNION: 4.0})], {}, them.now) == []


def test_where_intervals_are_unknown_the_group_follows():
    them = merging()
    them.result = mavlink.MAV_RESULT_UNSUPPORTED
    them.start().run(10)
    asked = request(dict.fromkeys(group_ids(10), 4.0), by_group=True)
    assert follow(them, asked) == [("REQUEST_DATA_STREAM", 10, 100)]


def test_px4_ignores_groups_so_that_a_stations_rate_follows_for_our_messages():
    them = merging(kind=AutopilotKind.PX4).start().run(20)
    asked = request(dict.fromkeys(group_ids(0), 25.0), by_group=True)
    assert sorted(follow(them, asked)) == [(2, 25), (24, 25), (30, 25), (32, 25), (33, 25), (132, 25)]


def test_each_station_is_named_once_in_the_log():
    them = merging().start().run(20)
    them.rates.notices()
    for _ in range(3):
        follow(them, request({QUATERNION: 4.0}))
        follow(them, request({QUATERNION: 4.0}, system=254))
    texts = [notice.text for notice in them.rates.notices()]
    assert [text for text in texts if "merged" in text] == texts
    assert [text.split()[0] for text in texts] == ["255/190", "254/190"]


# Acknowledgements name no message.


def test_an_acknowledgement_of_what_follows_is_not_taken_for_the_answer_to_the_next_question():
    """The quaternion is refused at both rates that are tried; between them comes the answer to a position that
    followed a station's request.
    """
    them = merging().start()

    def answer(command, result):
        them.deliver(Message("COMMAND_ACK", 1, 1, "fc", Ack(command, result, 0, 0, 1, 191)))

    accepted, refused = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
    them.rates.on_wake(them.now)
    assert len(them.rates.on_merged_requests([request({POSITION: 1.0})], {}, them.now)) == 1
    for command, result in ((SET, accepted), (SET, refused), (GET, accepted), (SET, refused)):
        answer(command, result)
    them.deliver(Message("MESSAGE_INTERVAL", 1, 1, "fc", Interval(QUATERNION, -1)))
    them.rates.on_wake(them.now)  # the second rate is asked for
    answer(SET, accepted)  # of the position
    assert status(them, "ATTITUDE_QUATERNION").state == "asking"
    answer(SET, refused)
    assert status(them, "ATTITUDE_QUATERNION").state == "denied"


def test_acknowledgements_come_in_the_order_of_the_commands():
    order = AckOrder(100)
    for command, subject in ((SET, None), (SET, None), (GET, None), (SET, "ours"), (SET, None)):
        order.sent(command, subject, 0)
    assert [order.acknowledged(command, 1) for command in (SET, SET, GET, SET, SET)] == [None, None, None, "ours", None]


def test_a_lost_acknowledgement_shifts_nothing_beyond_the_next_other_command_and_nothing_beyond_its_time():
    order = AckOrder(100)
    for command, subject in ((SET, None), (GET, None), (SET, "ours")):
        order.sent(command, subject, 0)
    assert order.acknowledged(GET, 1) is None
    assert order.acknowledged(SET, 1) == "ours"
    order.sent(SET, "lost", 10)
    order.sent(SET, "next", 150)
    assert order.acknowledged(SET, 160) == "next"
    assert order.acknowledged(SET, 160) is None


def test_an_acknowledgement_for_another_component_moves_nothing():
    them = merging()
    them.acknowledges = False
    them.start().run(0.01)
    for _ in range(8):
        them.deliver(Message("COMMAND_ACK", 1, 1, "fc", Ack(511, 0, 0, 0, 255, 190)))
    assert status(them, "ATTITUDE_QUATERNION").state == "asking"


def test_own_streams_name_the_adopted_autopilot():
    them = merging().start().run(1)
    own = them.rates.own_streams
    assert (own.system, own.component) == (autopilot().system, autopilot().component)
