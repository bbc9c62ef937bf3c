"""Rates against a small autopilot of the test's own: it grants, refuses, forgets and lies in invented time."""

from collections import namedtuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fwav_companion.mavlink.rate_search import RateSearch
from fwav_companion.mavlink.rates import MESSAGE_IDS, Rates
from fwav_companion.mavlink.wanted import default_wanted
from fwav_companion.nouns import Autopilot, AutopilotKind, Message

MS, S = 10**6, 10**9
T0 = 9_000 * S
STEP = 2 * MS
Ack = namedtuple("Ack", "command result progress result_param2 target_system target_component")
Param = namedtuple("Param", "param_id param_value param_type param_count param_index")
Empty = namedtuple("Empty", "")
NAMES = {number: name for name, number in MESSAGE_IDS.items()}
STREAM_MEMBERS = {10: {"ATTITUDE"}, 6: {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"}, 2: {"GPS_RAW_INT"}}


def autopilot(kind=AutopilotKind.ARDUPILOT):
    return Autopilot(system=1, component=1, kind=kind, vehicle_type=16, armed=False, link="fc")


class Peer:
    """The other end: intervals by message, a ceiling, refusals, and an answer two milliseconds later."""

    def __init__(self, rates, kind=AutopilotKind.ARDUPILOT):
        self.rates, self.kind = rates, kind
        self.ceiling_hz, self.gives_hz = 1000.0, 1000.0
        self.denied, self.result = set(), None
        self.intervals_ns, self.next_ns = {}, {}
        self.parameters = {"SCHED_LOOP_RATE": 400.0}
        self.sent, self.asked, self.replies = [], [], []
        self.acknowledges, self.now = True, T0

    def start(self):
        self.rates.adopt(autopilot(self.kind), self.now)
        return self

    def run(self, seconds):
        end = self.now + round(seconds * S)
        while self.now < end:
            self.now += STEP
            for name in list(self.intervals_ns):
                while self.next_ns[name] <= self.now:
                    self.next_ns[name] += self.intervals_ns[name]
                    self.deliver(Message(name, 1, 1, "fc", Empty()))
            due, self.replies = self.replies, []
            for message in due:
                self.deliver(message)
            while self.rates.wake_at is not None and self.rates.wake_at <= self.now:
                for out in self.rates.on_wake(self.now):
                    self.take(out)
        return self

    def deliver(self, message):
        self.rates.on_message(message, self.now)

    def take(self, out):
        self.sent.append((self.now, out))
        fields = out.fields
        if out.name == "COMMAND_LONG" and fields["command"] == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            name, interval_us = NAMES[int(fields["param1"])], fields["param2"]
            self.asked.append((name, 1e6 / interval_us))
            result = self.result if self.result is not None else self.grant(name, interval_us)
            if self.acknowledges:
                self.replies.append(Message("COMMAND_ACK", 1, 1, "fc", Ack(511, result, 0, 0, 1, 191)))
        elif out.name == "REQUEST_DATA_STREAM":
            for name in STREAM_MEMBERS.get(fields["req_stream_id"], ()):
                self.set_rate(name, fields["req_message_rate"])
        elif out.name == "PARAM_REQUEST_READ" and fields["param_id"] in self.parameters:
            value = self.parameters[fields["param_id"]]
            self.replies.append(Message("PARAM_VALUE", 1, 1, "fc", Param(fields["param_id"], value, 9, 900, 0)))

    def grant(self, name, interval_us):
        if name in self.denied:
            return mavlink.MAV_RESULT_DENIED
        if 1e6 / interval_us > self.ceiling_hz * (1 + 1e-9):
            return mavlink.MAV_RESULT_FAILED
        self.set_rate(name, 1e6 / interval_us)
        return mavlink.MAV_RESULT_ACCEPTED

    def set_rate(self, name, hz):
        self.intervals_ns[name] = round(S / min(hz, self.gives_hz))
        self.next_ns[name] = self.now + self.intervals_ns[name]

    def gcs_requests_streams(self, hz=4.0):
        for name in ("ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT"):
            if name in self.intervals_ns:
                self.set_rate(name, hz)

    def reboot(self):
        self.intervals_ns.clear()
        self.replies.clear()

    def asks_for(self, name):
        return [hz for asked, hz in self.asked if asked == name]


def peer(attitude_message="auto", kind=AutopilotKind.ARDUPILOT, attitude_hz=100):
    return Peer(Rates(default_wanted(attitude_hz, 10), attitude_message=attitude_message), kind)


def status(them, name):
    return them.rates.status()[name]


def test_commands_are_what_pymavlink_packs():
    them = peer().start().run(1)
    commands = [out for _, out in them.sent if out.name == "COMMAND_LONG"]
    packed = [mavlink.MAVLink_command_long_message(**out.fields) for out in commands]
    assert {(one.target_system, one.target_component) for one in packed} == {(1, 1)}
    assert {out.component for out in commands} == {191}
    first = next(one for one in packed if one.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
    assert (first.param1, first.param2) == (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 10_000)


def test_every_wanted_message_comes_at_its_rate_and_is_measured_so():
    them = peer().start().run(12)
    assert status(them, "ATTITUDE_QUATERNION")["measured_hz"] == pytest.approx(100, rel=0.02)
    assert status(them, "GLOBAL_POSITION_INT")["measured_hz"] == pytest.approx(10, rel=0.06)
    assert status(them, "ATTITUDE_QUATERNION")["state"] == "granted"


def test_what_is_granted_and_comes_is_not_asked_for_again():
    them = peer().start().run(90)
    assert them.asks_for("ATTITUDE_QUATERNION") == [100.0]
    assert them.asks_for("GLOBAL_POSITION_INT") == [10.0]


def test_plain_attitude_is_slow_once_the_quaternion_flows():
    them = peer().start().run(10)
    assert them.asks_for("ATTITUDE") == [4.0]


def test_where_the_quaternion_is_refused_plain_attitude_is_asked_for_in_full():
    them = peer()
    them.denied = {"ATTITUDE_QUATERNION"}
    them.start().run(10)
    assert them.asks_for("ATTITUDE") == [100.0]
    assert status(them, "ATTITUDE_QUATERNION")["state"] == "denied"
    assert status(them, "ATTITUDE")["measured_hz"] == pytest.approx(100, rel=0.02)


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
    assert got["asked_hz"] == pytest.approx(expected, rel=0.02)
    assert got["asked_hz"] <= ceiling + 0.01
    assert got["measured_hz"] == pytest.approx(got["asked_hz"], rel=0.1)
    told = [notice.text for notice in them.rates.notices() if "ATTITUDE_QUATERNION at" in notice.text]
    assert len(told) == (0 if ceiling > 100 else 1)


@pytest.mark.parametrize("ceiling_us", [10_001, 12_345, 25_000, 99_000, 400_000, 999_999, 1_000_000])
def test_the_search_ends_within_a_step_of_the_ceiling(ceiling_us):
    search, questions, last_us = RateSearch(100.0), 0, None
    while search.asking_us is not None:
        questions, last_us = questions + 1, search.asking_us
        (search.on_accepted if search.asking_us >= ceiling_us else search.on_refused)()
    assert ceiling_us <= search.accepted_us <= max(ceiling_us + 1000, 1.03 * ceiling_us)
    assert questions <= 12
    assert last_us == search.accepted_us  # whatever a refusal did over there, what was accepted is asked for last


def test_a_message_that_is_refused_at_every_rate_is_left_alone_until_a_reboot():
    them = peer(kind=AutopilotKind.PX4)
    them.denied = {"ALTITUDE"}
    them.start().run(60)
    assert len(them.asks_for("ALTITUDE")) == 2
    them.denied.clear()
    them.reboot()
    them.rates.ask_again("the autopilot rebooted", them.now)
    them.run(5)
    assert status(them, "ALTITUDE")["state"] == "granted"
    assert status(them, "ALTITUDE")["undone_by"] == "the autopilot rebooted"


def test_ardupilot_is_not_asked_for_what_it_does_not_have():
    them = peer().start().run(5)
    assert not them.asks_for("ALTITUDE")
    assert not them.asks_for("LOCAL_POSITION_NED")


def test_an_acknowledgement_without_the_rate_is_not_believed():
    """PX4 acknowledged 50 Hz and gave 18.4: it is shown, and asked again with growing patience."""
    them = peer(kind=AutopilotKind.PX4, attitude_hz=50)
    them.gives_hz = 18.4
    them.start().run(200)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got["asked_hz"] == 50.0
    assert got["measured_hz"] == pytest.approx(18.4, rel=0.05)
    assert 3 <= len(them.asks_for("ATTITUDE_QUATERNION")) <= 8


def test_somebodys_rate_request_is_undone_at_once_and_named():
    them = peer().start().run(20)
    before = len(them.asked)
    them.gcs_requests_streams()
    them.rates.on_rate_request_passed("255/190 over ground", them.now)
    them.run(0.1)
    assert "ATTITUDE_QUATERNION" in [name for name, _ in them.asked[before:]]
    them.run(6)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got["measured_hz"] == pytest.approx(100, rel=0.02)
    assert got["undone_by"] == "255/190 over ground"
    assert any("255/190 over ground" in notice.text for notice in them.rates.notices())


def test_half_a_dozen_requests_in_a_row_are_all_undone_within_a_second():
    them = peer().start().run(20)
    for _ in range(6):
        them.gcs_requests_streams()
        them.rates.on_rate_request_passed("255/190 over ground", them.now)
        them.run(0.04)
    them.run(1.0)
    assert them.intervals_ns["ATTITUDE_QUATERNION"] == 10 * MS
    asked_once = [name for name, _ in them.asked].count("GPS_RAW_INT")
    assert asked_once <= 3


def test_a_rate_that_falls_without_anybody_seen_is_asked_for_again_and_told():
    them = peer().start().run(20)
    them.gcs_requests_streams()
    them.run(8)
    got = status(them, "ATTITUDE_QUATERNION")
    assert got["measured_hz"] == pytest.approx(100, rel=0.02)
    assert got["undone_by"] == "nobody seen"
    assert any("fell from 100" in notice.text for notice in them.rates.notices())


Beat = namedtuple("Beat", "type")
Command = namedtuple("Command", "command")


def test_a_ground_station_that_shares_the_link_is_presumed_to_have_taken_a_rate():
    """It spoke to the autopilot out of our sight; its heartbeat shows that it is there."""
    them = peer().start().run(18)
    them.deliver(Message("HEARTBEAT", 255, 190, "fc", Beat(mavlink.MAV_TYPE_GCS)))
    them.deliver(Message("HEARTBEAT", 254, 190, "ground", Beat(mavlink.MAV_TYPE_GCS)))  # its requests pass us by
    them.deliver(Message("HEARTBEAT", 1, 154, "fc", Beat(mavlink.MAV_TYPE_GIMBAL)))
    them.gcs_requests_streams()
    them.run(8)
    assert status(them, "ATTITUDE_QUATERNION")["undone_by"] == "presumably the ground station 255/190 on fc"
    assert any("255/190" in notice.text for notice in them.rates.notices())


def test_a_component_whose_command_was_heard_is_named():
    them = peer().start().run(20)
    them.deliver(Message("COMMAND_LONG", 1, 195, "fc", Command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)))
    them.gcs_requests_streams()
    them.run(8)
    assert status(them, "ATTITUDE_QUATERNION")["undone_by"] == "1/195 on fc"


def test_nobody_is_blamed_for_a_link_that_fell_silent():
    them = peer().start().run(20)
    them.rates.notices()
    deliver, them.deliver = them.deliver, lambda message: None
    them.run(6)
    them.deliver = deliver
    them.run(10)
    assert status(them, "ATTITUDE_QUATERNION")["measured_hz"] == pytest.approx(100, rel=0.02)
    assert {got["undone_by"] for got in them.rates.status().values()} == {None}
    assert not [notice for notice in them.rates.notices() if "fell" in notice.text]


def test_a_rate_that_is_taken_again_and_again_is_not_fought_for_more_than_once_in_four_seconds():
    them = peer().start().run(20)
    before = len(them.asks_for("ATTITUDE_QUATERNION"))
    for _ in range(120):
        them.gcs_requests_streams()
        them.run(0.5)
    assert len(them.asks_for("ATTITUDE_QUATERNION")) - before <= 16


def test_a_lost_acknowledgement_is_asked_for_again_with_a_growing_confirmation():
    them = peer()
    them.acknowledges = False
    them.start().run(2.5)
    first = [out.fields for _, out in them.sent if out.fields.get("param1") == 31.0]
    assert [fields["confirmation"] for fields in first] == [0, 1, 2, 3]


def test_a_rate_that_comes_without_any_acknowledgement_counts():
    them = peer()
    them.acknowledges = False
    them.start().run(120)
    assert status(them, "ATTITUDE_QUATERNION")["state"] == "granted"


def test_data_streams_are_requested_only_where_the_command_itself_is_unknown():
    them = peer()
    them.result = mavlink.MAV_RESULT_UNSUPPORTED
    them.start().run(10)
    streams = [out.fields for _, out in them.sent if out.name == "REQUEST_DATA_STREAM"]
    assert {fields["req_stream_id"]: fields["req_message_rate"] for fields in streams}[10] == 100
    assert status(them, "ATTITUDE")["measured_hz"] == pytest.approx(100, rel=0.02)
    for fields in streams:
        mavlink.MAVLink_request_data_stream_message(**fields)

    modern = peer()
    modern.denied = {"GPS_RAW_INT"}
    modern.start().run(30)
    assert not [out for _, out in modern.sent if out.name == "REQUEST_DATA_STREAM"]


def test_unsupported_for_one_message_is_a_refusal_where_others_were_accepted():
    them = peer()
    grant = them.grant
    them.grant = lambda name, us: mavlink.MAV_RESULT_UNSUPPORTED if name == "GPS_RAW_INT" else grant(name, us)
    them.start().run(10)
    assert status(them, "GPS_RAW_INT")["state"] == "denied"
    assert not [out for _, out in them.sent if out.name == "REQUEST_DATA_STREAM"]


@pytest.mark.parametrize(
    "ack",
    [Ack(511, 4, 0, 0, 255, 190), Ack(400, 4, 0, 0, 1, 191), Ack(511, 5, 0, 0, 1, 191), Ack(511, 4, 0, 0, 1, 100)],
)
def test_acknowledgements_of_others_and_of_progress_are_not_taken(ack):
    them = peer()
    them.acknowledges = False
    them.start().run(0.01)
    them.deliver(Message("COMMAND_ACK", 1, 1, "fc", ack))
    assert status(them, "ATTITUDE_QUATERNION")["state"] == "asking"
    assert len(them.run(0.5).asked) == 1


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


def test_nobody_else_counts():
    them = peer().start()
    for count in range(500):
        them.rates.on_message(Message("ATTITUDE_QUATERNION", 2, 1, "fc", Empty()), T0 + count * 10 * MS)
    assert not status(them, "ATTITUDE_QUATERNION")["measured_hz"]


def test_it_never_wakes_in_the_past_and_does_nothing_before_adoption():
    rates = Rates(default_wanted(100, 10))
    assert rates.wake_at is None
    assert rates.on_wake(T0) == []
    rates.on_rate_request_passed("x", T0)
    rates.adopt(autopilot(), T0)
    assert rates.wake_at == T0
    rates.ask_again("a reboot", T0 + S)
    assert rates.wake_at == T0 + S
