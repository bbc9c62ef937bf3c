"""Rate requests, and the rates found where a request is refused."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rates_peer import MS, T0, Empty, S, autopilot, peer, status

from fwav_companion.mavlink.client.rate_search import RateSearch
from fwav_companion.mavlink.client.rates import Rates
from fwav_companion.mavlink.client.subscriptions import default_subscriptions
from fwav_companion.types import AutopilotKind, Message, NoticeCode


def test_commands_are_what_pymavlink_packs():
    them = peer().start().run(3)
    commands = [out for _, out in them.sent if out.name == "COMMAND_LONG"]
    packed = [mavlink.MAVLink_command_long_message(**out.fields) for out in commands]
    assert {(one.target_system, one.target_component) for one in packed} == {(1, 1)}
    assert {out.component for out in commands} == {191}
    first = next(one for one in packed if one.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
    assert (first.param1, first.param2) == (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 10_000)


def test_every_wanted_message_comes_at_its_rate_and_is_measured_so():
    them = peer().start().run(12)
    assert status(them, "ATTITUDE_QUATERNION").measured_hz == pytest.approx(100, rel=0.02)
    assert status(them, "GLOBAL_POSITION_INT").measured_hz == pytest.approx(10, rel=0.06)
    assert status(them, "ATTITUDE_QUATERNION").state == "granted"


def test_what_is_granted_and_comes_is_not_asked_for_again():
    them = peer().start().run(90)
    assert them.asks_for("ATTITUDE_QUATERNION") == [100.0]
    assert them.asks_for("GLOBAL_POSITION_INT") == [10.0]


@pytest.mark.parametrize(("comes_hz", "again"), [(90.0, False), (80.0, True)])
def test_a_rate_that_is_granted_and_comes_at_less_than_85_percent_is_asked_for_again(comes_hz, again):
    them = peer()
    them.gives_hz = comes_hz
    them.start().run(30)
    assert (len(them.asks_for("ATTITUDE_QUATERNION")) > 1) is again


def test_plain_attitude_is_slow_once_the_quaternion_flows():
    them = peer().start().run(10)
    assert them.asks_for("ATTITUDE") == [4.0]


def test_where_the_quaternion_is_refused_plain_attitude_is_asked_for_in_full():
    them = peer()
    them.denied = {"ATTITUDE_QUATERNION"}
    them.start().run(10)
    assert them.asks_for("ATTITUDE") == [100.0]
    assert status(them, "ATTITUDE_QUATERNION").state == "denied"
    assert status(them, "ATTITUDE").measured_hz == pytest.approx(100, rel=0.02)


def test_plain_attitude_is_asked_for_in_full_where_the_quaternion_is_promised_and_never_comes():
    them = peer()
    grant = them.grant
    them.grant = lambda name, us: 0 if name == "ATTITUDE_QUATERNION" else grant(name, us)
    them.start().run(10)
    assert them.asks_for("ATTITUDE") == [100.0]


@pytest.mark.parametrize(
    ("setting", "asked", "not_asked"),
    [("ATTITUDE", "ATTITUDE", "ATTITUDE_QUATERNION"), ("ATTITUDE_QUATERNION", "ATTITUDE_QUATERNION", None)],
)
def test_the_configured_attitude_message_is_the_one(setting, asked, not_asked):
    them = peer(setting).start().run(10)
    assert them.asks_for(asked) == [100.0]
    assert not_asked is None or them.asks_for(not_asked) == []


@pytest.mark.parametrize(("ceiling", "expected"), [(40.0, 40.0), (320.0, 100.0), (50.0, 50.0), (7.3, 1000 / 137)])
def test_where_a_rate_is_refused_the_highest_accepted_one_is_found(ceiling, expected):
    them = peer()
    them.ceiling_hz = ceiling
    them.start().run(15)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got.asked_hz == pytest.approx(expected, rel=0.02)
    assert got.asked_hz <= ceiling + 0.01
    assert got.measured_hz == pytest.approx(got.asked_hz, rel=0.1)
    refused = [notice.text.split()[0] for notice in them.rates.notices() if notice.code is NoticeCode.RATE_REFUSED]
    assert refused.count("ATTITUDE_QUATERNION") == (0 if ceiling > 100 else 1)


@pytest.mark.parametrize("ceiling_us", [10_001, 12_345, 25_000, 99_000, 400_000, 999_999, 1_000_000])
def test_the_search_ends_within_a_step_of_the_ceiling(ceiling_us):
    search, questions, last_us = RateSearch(100.0), 0, None
    while search.asking_us is not None:
        questions, last_us = questions + 1, search.asking_us
        (search.on_accepted if search.asking_us >= ceiling_us else search.on_refused)()
    assert ceiling_us <= search.accepted_us <= max(ceiling_us + 1000, 1.03 * ceiling_us)
    assert questions <= 12
    assert (
        last_us == search.accepted_us
    )  # the accepted rate is requested last, because a refusal may have changed the rate


def test_a_message_that_is_refused_at_every_rate_is_left_alone_until_a_reboot():
    them = peer(kind=AutopilotKind.PX4)
    them.denied = {"ALTITUDE"}
    them.start().run(60)
    assert len(them.asks_for("ALTITUDE")) == 2
    them.denied.clear()
    them.reboot()
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(5)
    assert status(them, "ALTITUDE").state == "granted"
    assert status(them, "ALTITUDE").undone_by == "the autopilot rebooted"


def test_ardupilot_is_not_asked_for_what_it_does_not_have():
    them = peer().start().run(5)
    assert not them.asks_for("ALTITUDE")
    assert not them.asks_for("LOCAL_POSITION_NED")


def test_home_and_origin_are_requested_until_they_are_heard():
    them = peer().start().run(25)

    def requested(number):
        return sum(
            out.fields.get("command") == mavlink.MAV_CMD_REQUEST_MESSAGE and out.fields["param1"] == number
            for _, out in them.sent
        )

    assert requested(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) == 3
    them.deliver(Message("GPS_GLOBAL_ORIGIN", 1, 1, "fc", Empty()))
    them.run(30)
    assert requested(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) == 3


def test_parameters_are_read_three_times_at_most_and_from_ardupilot_only():
    them = peer().start().run(20)
    asked = [out.fields["param_id"] for _, out in them.sent if out.name == "PARAM_REQUEST_READ"]
    assert asked.count("SCHED_LOOP_RATE") == 1
    assert asked.count("PTCH_TRIM_DEG") == 3
    assert them.rates.parameters == {"SCHED_LOOP_RATE": 400.0}
    px4 = peer(kind=AutopilotKind.PX4).start().run(20)
    assert not [out for _, out in px4.sent if out.name == "PARAM_REQUEST_READ"]


def test_no_other_component_counts():
    them = peer().start()
    for count in range(500):
        them.rates.on_message(Message("ATTITUDE_QUATERNION", 2, 1, "fc", Empty()), T0 + count * 10 * MS)
    assert not status(them, "ATTITUDE_QUATERNION").measured_hz


def test_it_never_wakes_in_the_past_and_does_nothing_before_adoption():
    rates = Rates(default_subscriptions(100, 10))
    assert rates.wake_at is None
    assert rates.on_wake(T0) == []
    rates.on_rate_request_passed("x", T0)
    rates.adopt(autopilot(), T0)
    assert rates.wake_at == T0
    rates.ask_again("a reboot", T0 + S)
    assert rates.wake_at == T0 + S
