"""Where requests are merged, ours follow each station's, and each acknowledgement is matched with its command."""

from __future__ import annotations

import pytest
from merging_peer import ATTITUDE, GET, GPS, HUD, POSITION, QUATERNION, SET, by_itself, follow, merging, request
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import MS, Ack, autopilot, status

from fwav_companion.mavlink.client.rate_dialogue import AckOrder
from fwav_companion.mavlink.wire.stream_groups import group_ids
from fwav_companion.types import AutopilotKind, Message


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


def test_rate_that_falls_after_a_merged_request_names_the_station_that_sent_it():
    """Each request may begin an interval again; that no station was seen would be false."""
    them = merging().start().run(20)
    asked = request({HUD: 2.0})
    follow(them, asked)
    them.gcs_requests_streams()
    them.run(8)
    assert status(them, "ATTITUDE_QUATERNION").undone_by == asked.requester
    assert any(f"undone by: {asked.requester}" in notice.text for notice in them.rates.notices())


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
    assert status(them, "GLOBAL_POSITION_INT").before_hz == pytest.approx(25.0)
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
    them = merging()
    them.defaults_hz = {"GLOBAL_POSITION_INT": 10.0}
    them.start().run(1.99)
    assert status(them, "ATTITUDE_QUATERNION").before_by is None
    them.now += 20 * MS

    def answer(command, result):
        them.deliver(Message("COMMAND_ACK", 1, 1, "fc", Ack(command, result, 0, 0, 1, 191)))

    accepted, refused = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
    them.rates.on_wake(them.now)
    assert len(them.rates.on_merged_requests([request({POSITION: 1.0})], {}, them.now)) == 1
    answer(SET, refused)
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
    them = merging().start().run(3)
    own = them.rates.own_streams
    assert (own.system, own.component) == (autopilot().system, autopilot().component)
