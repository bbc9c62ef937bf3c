"""TIMESYNC against a simulated autopilot with its own clock, and against other components on the network."""

from collections import namedtuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fwav_companion.mavlink.client.timesync import Ignored, NotTaken, Timesync
from fwav_companion.types import Autopilot, AutopilotKind, ClockExchange, Destination, Message, Outgoing

MS, S = 10**6, 10**9
T0 = 77_000 * S
ARDUPILOT = Autopilot(system=5, component=1, kind=AutopilotKind.ARDUPILOT, vehicle_type=16, armed=False, link="fc")
One = namedtuple("One", "tc1 ts1")
Two = namedtuple("Two", "tc1 ts1 target_system target_component")


def timesync(tc1, ts1, system=5, component=1, target=None, link="fc"):
    fields = One(tc1, ts1) if target is None else Two(tc1, ts1, *target)
    return Message("TIMESYNC", system, component, link, fields)


@pytest.fixture
def sync():
    made = Timesync(191)
    made.adopt(ARDUPILOT, T0)
    return made


def request(sync, now=T0):
    return sync.on_wake(now).fields["ts1"]


def test_nothing_is_asked_or_answered_before_an_autopilot_is_adopted():
    sync = Timesync(191)
    assert sync.wake_at is None
    assert sync.on_wake(T0) is None
    assert sync.on_message(timesync(0, 123), T0) == Ignored(NotTaken.NO_AUTOPILOT)
    assert sync.on_message(timesync(55, 123), T0) == Ignored(NotTaken.NO_AUTOPILOT)


def test_a_request_carries_our_nanoseconds_and_an_empty_tc1(sync):
    out = sync.on_wake(T0)
    assert (out.name, out.to, out.component) == ("TIMESYNC", Destination.AUTOPILOT, 191)
    assert set(out.fields) == {"tc1", "ts1"}
    assert out.fields["tc1"] == 0
    assert 0 <= out.fields["ts1"] - T0 < 1000


def test_its_answer_gives_the_exchange_with_whole_microseconds(sync):
    ts1 = request(sync)
    got = sync.on_message(timesync(42 * S, ts1), T0 + 3 * MS)
    assert got == ClockExchange(sent_ns=T0, received_ns=T0 + 3 * MS, autopilot_ns=42 * S, link="fc")


def test_an_answer_counts_once(sync):
    ts1 = request(sync)
    sync.on_message(timesync(42 * S, ts1), T0 + MS)
    assert sync.on_message(timesync(42 * S, ts1), T0 + 2 * MS) == Ignored(NotTaken.REPLAYED)
    assert sync.ignored[NotTaken.REPLAYED] == 1


def test_an_answer_over_each_of_two_links_is_an_exchange_of_that_link(sync):
    ts1 = request(sync)
    exchanges = [sync.on_message(timesync(42 * S, ts1, link=link), T0 + MS) for link in ("fc", "radio")]
    assert [exchange.link for exchange in exchanges] == ["fc", "radio"]
    assert sync.exchanges == 1


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (lambda ts1: timesync(9 * S, ts1 + 1), NotTaken.NOT_OURS),
        (lambda ts1: timesync(9 * S, T0), NotTaken.NOT_OURS),
        (lambda ts1: timesync(9 * S, ts1, system=6), NotTaken.FOREIGN_SPEAKER),
        (lambda ts1: timesync(9 * S, ts1, component=191), NotTaken.FOREIGN_SPEAKER),
        (lambda ts1: timesync(9 * S, ts1, target=(5, 192)), NotTaken.OTHER_TARGET),
        (lambda ts1: timesync(9 * S, ts1, target=(255, 190)), NotTaken.OTHER_TARGET),
        (lambda ts1: timesync(-1, ts1), NotTaken.BAD_CLOCK),
        (lambda ts1: timesync(-(2**63), ts1), NotTaken.BAD_CLOCK),
        (lambda ts1: timesync(2**63 - 1, ts1), NotTaken.BAD_CLOCK),
    ],
)
def test_what_is_not_our_answer_is_ignored_for_its_reason_and_does_not_spoil_ours(sync, answer, reason):
    ts1 = request(sync)
    if ts1 == T0:  # the nonce may be 0: then this case shows nothing
        ts1 = request(sync, sync.wake_at)
    assert sync.on_message(answer(ts1), T0 + 200 * MS) == Ignored(reason)
    assert sync.ignored[reason] == 1
    assert isinstance(sync.on_message(timesync(9 * S, ts1, target=(5, 191)), T0 + 201 * MS), ClockExchange)


def test_an_answer_that_comes_before_its_request_or_after_five_seconds_is_none(sync):
    ts1 = request(sync)
    assert sync.on_message(timesync(9 * S, ts1), T0 - 1000) == Ignored(NotTaken.NOT_OURS)
    assert sync.on_message(timesync(9 * S, ts1), T0 + 5 * S + 1000) == Ignored(NotTaken.NOT_OURS)


def test_the_autopilots_own_requests_are_answered_with_our_clock_over_the_same_link(sync):
    out = sync.on_message(timesync(0, 987_654_321, link="spare"), T0 + 5000)
    assert isinstance(out, Outgoing)
    assert (out.to, out.link, out.component) == (Destination.REPLY, "spare", 191)
    assert out.fields == {"tc1": T0 + 5000, "ts1": 987_654_321}


def test_others_requests_are_answered_only_if_they_name_us(sync):
    assert sync.on_message(timesync(0, 1, 255, 190), T0) == Ignored(NotTaken.NOT_FOR_US)
    assert sync.on_message(timesync(0, 1, 255, 190, target=(5, 1)), T0) == Ignored(NotTaken.NOT_FOR_US)
    assert sync.on_message(timesync(0, 1, target=(5, 192)), T0) == Ignored(NotTaken.NOT_FOR_US)
    assert isinstance(sync.on_message(timesync(0, 1, 255, 190, target=(5, 191)), T0), Outgoing)


def test_where_the_definitions_have_target_fields_they_are_filled_in():
    sync = Timesync(191, target_fields=True)
    sync.adopt(ARDUPILOT, T0)
    asked = sync.on_wake(T0).fields
    assert (asked["target_system"], asked["target_component"]) == (5, 1)
    answer = sync.on_message(timesync(0, 1, 255, 190, target=(5, 191)), T0).fields
    assert (answer["target_system"], answer["target_component"]) == (255, 190)


def test_a_replay_learns_requests_from_the_recording_on_any_clock(sync):
    recorded_at = 1_790_000_000 * S
    sync.on_sent(123_456_789, recorded_at)
    got = sync.on_message(timesync(9 * S, 123_456_789), recorded_at + 2 * MS)
    assert got == ClockExchange(sent_ns=recorded_at, received_ns=recorded_at + 2 * MS, autopilot_ns=9 * S, link="fc")


def run(sync, seconds, round_trip_ns, answered=lambda now: True):
    """Instants of requests while the autopilot answers each after the round trip."""
    now, sent = T0, []
    while now < T0 + seconds * S:
        now = sync.wake_at
        ts1 = sync.on_wake(now).fields["ts1"]
        sent.append(now)
        if answered(now):
            sync.on_message(timesync(now - 1000 * S, ts1), now + round_trip_ns)
    return sent


def rate(sent, start, end):
    return sum(T0 + start * S <= at < T0 + end * S for at in sent) / (end - start)


@pytest.mark.parametrize("round_trip_ms", [1, 50])
def test_requests_are_frequent_until_an_answer_and_then_one_a_second(sync, round_trip_ms):
    sent = run(sync, 60, round_trip_ms * MS, answered=lambda now: now >= T0 + S)
    assert rate(sent, 0, 1) == pytest.approx(10)
    assert rate(sent, 2, 60) == pytest.approx(1.0, abs=0.02)


def test_in_doubt_requests_are_frequent_again(sync):
    run(sync, 30, 4 * MS)
    now = T0 + 30 * S
    sent, at = 0, now
    while at < now + 3 * S:
        sync.settle(at)
        at = sync.wake_at
        sent += sync.on_message(timesync(S, request(sync, at)), at) is not None
    assert sent == pytest.approx(30, abs=1)


def test_after_twenty_unanswered_requests_the_autopilot_counts_as_one_way_until_it_answers(sync):
    sent = run(sync, 62, MS, answered=lambda now: now >= T0 + 55 * S)
    assert rate(sent, 0, 2) == pytest.approx(10)
    assert rate(sent, 2, 52) == pytest.approx(0.1, abs=0.02)
    assert not sync.one_way
    assert sync.wake_at - sent[-1] <= S + MS


def test_a_one_way_autopilot_is_named(sync):
    run(sync, 1.8, MS, answered=lambda now: False)
    assert not sync.one_way
    run(sync, 2.1, MS, answered=lambda now: False)
    assert sync.one_way


def test_other_requests_wait_until_exchanges_agree_and_two_seconds_at_most(sync):
    assert sync.held_until_ns == T0 + S, "without any answer"
    sync.on_message(timesync(42 * S, request(sync)), T0 + MS)
    assert sync.held_until_ns == T0 + 2 * S
    sync.agreed()
    assert sync.held_until_ns <= T0


@pytest.mark.parametrize(("round_trip_ms", "request_ms"), [(10, 280 / 57.6), (2, 0.0)])
def test_ardupilots_stamp_is_the_beginning_of_the_request_on_a_serial_line(round_trip_ms, request_ms):
    """A round trip shorter than both transfers shows that the port has no baud rate, as USB."""
    sync = Timesync(191, bauds={"fc": 57600})
    sync.adopt(ARDUPILOT, T0)
    exchange = sync.on_message(timesync(42 * S, request(sync)), T0 + round_trip_ms * MS)
    assert exchange.request_ns == pytest.approx(request_ms * MS, rel=1e-3)


def test_bytes_relayed_beside_a_request_are_weighted_by_their_time_on_the_line(sync):
    sync.foreign_bytes = lambda: 1000
    answer = replace(timesync(42 * S, request(sync)), foreign_bytes=1000 + 1152)
    assert sync.on_message(answer, T0 + 5 * MS).beside_ns == pytest.approx(100 * MS, rel=1e-3)


def test_bytes_beside_a_request_that_nothing_counted_or_of_px4_have_no_weight(sync):
    answer = replace(timesync(42 * S, request(sync)), foreign_bytes=1152)
    assert sync.on_message(answer, T0 + 5 * MS).beside_ns == 0
    px4 = Timesync(191)
    px4.adopt(replace(ARDUPILOT, kind=AutopilotKind.PX4), T0)
    px4.foreign_bytes = lambda: 0
    answer = replace(timesync(42 * S, request(px4)), foreign_bytes=1152)
    assert px4.on_message(answer, T0 + 5 * MS).beside_ns == 0


def test_after_a_reboot_old_requests_are_void_and_it_settles_again(sync):
    ts1 = request(sync)
    sync.restart(T0 + MS)
    assert sync.on_message(timesync(9 * S, ts1), T0 + 2 * MS) == Ignored(NotTaken.NOT_OURS)
    assert sync.wake_at == T0 + MS


def test_the_table_of_requests_is_bounded():
    sync = Timesync(191)
    sync.adopt(ARDUPILOT, T0)
    for count in range(10_000):
        sync.on_sent(T0 + count, T0 + count * 1000)
    assert len(sync._outstanding) <= 32


def test_nonces_spread_and_no_ts1_is_used_twice(sync):
    nonces = [request(sync, sync.wake_at) % 1000 for _ in range(2000)]
    assert len(set(nonces)) > 800  # 2000 draws of 1000 values reach 865 on average
    assert max(nonces.count(value) for value in set(nonces)) < 12


@settings(derandomize=True, max_examples=200)
@given(tc1=st.integers(-(2**63), 2**63 - 1), ts1=st.integers(-(2**63), 2**63 - 1), system=st.integers(0, 255))
def test_no_foreign_content_gives_an_exchange_or_an_answer_to_a_stranger(tc1, ts1, system):
    sync = Timesync(191)
    sync.adopt(ARDUPILOT, T0)
    request(sync)
    got = sync.on_message(timesync(tc1, ts1, system), T0 + MS)
    assert not isinstance(got, ClockExchange)
    assert isinstance(got, Outgoing) == (tc1 == 0 and system == 5)


def test_the_status_shows_round_trips_and_how_much_they_vary(sync):
    assert sync.status().round_trip_s is None
    assert sync.status().jitter_s is None
    round_trips_ms = [4, 12] * 100
    for round_trip_ms in round_trips_ms:
        now = sync.wake_at
        ts1 = request(sync, now)
        sync.on_message(timesync(42 * S, ts1), now + round_trip_ms * MS)
    status = sync.status()
    assert status.exchanges == 200
    assert (status.round_trip_s, status.least_round_trip_s) == (0.012, 0.004)
    assert status.jitter_s == pytest.approx(0.008, rel=1e-3)
    sync.on_message(timesync(42 * S, 5), now)
    assert sync.status().ignored == {"not_ours": 1}
