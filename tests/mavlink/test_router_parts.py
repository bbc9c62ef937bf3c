"""Small parts of the router, each alone: rate requests, held transfers, budgets, loads, clocks of peers, own frames."""

from __future__ import annotations

from math import inf

import pytest
from mavlink_wire import Wire

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.byte_budget import ByteBudget, RadioBackoff
from fwav_companion.mavlink.router.duplicates import Duplicates
from fwav_companion.mavlink.router.held_transfers import HeldTransfers
from fwav_companion.mavlink.router.link_load import MAX_STREAMS, LoadMeter
from fwav_companion.mavlink.router.own_frames import MAX_SENT, OwnFrames
from fwav_companion.mavlink.router.peers import PeerClock
from fwav_companion.mavlink.router.station_rates import (
    FORGOTTEN_NS,
    MAX_ASKERS,
    MAX_ONCE,
    MAX_RATES,
    ONCE_NS,
    AskedRates,
)
from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from sitl_mock.codec import NUMBERS

T0 = HostNs(500 * NS_PER_S)
ATTITUDE, VFR_HUD = NUMBERS["ATTITUDE"], NUMBERS["VFR_HUD"]


def at(seconds: float) -> HostNs:
    return HostNs(T0 + round(seconds * NS_PER_S))


def request(system: int = 255, target: int = 1, once: int | None = None, **rates: float | None) -> RateRequest:
    return RateRequest(
        system=system, component=190, link="ground", target_system=target, target_component=1,
        rates={NUMBERS[name]: hz for name, hz in rates.items()}, once=once,
    )  # fmt: skip


def by_id(rates: dict[int, float | None]) -> RateRequest:
    return RateRequest(system=255, component=190, link="ground", target_system=1, target_component=1, rates=rates)


# What the stations on a link ask for.


def test_the_highest_of_what_stations_ask_counts_to_our_system_or_to_all():
    asked = AskedRates()
    assert asked.note(request(255, ATTITUDE=4.0, VFR_HUD=0.0), T0)
    assert asked.note(request(254, target=0, ATTITUDE=10.0), T0)
    assert asked.note(request(253, target=9, ATTITUDE=50.0), T0)
    assert (asked.asked_hz(1, ATTITUDE), asked.asked_hz(1, VFR_HUD), asked.asked_hz(1, 1)) == (10.0, 0.0, None)
    assert asked.asked_hz(9, ATTITUDE) == 50.0
    assert set(asked.asked_ids(1)) == {ATTITUDE, VFR_HUD}
    assert set(asked.asked_ids(9)) == {ATTITUDE}


def test_a_request_that_changes_nothing_is_no_change_and_the_default_takes_it_back():
    asked = AskedRates()
    assert asked.note(request(ATTITUDE=4.0), T0)
    assert not asked.note(request(ATTITUDE=4.0), T0)
    assert asked.note(request(ATTITUDE=5.0), T0)
    assert asked.note(request(ATTITUDE=None), T0)
    assert asked.asked_hz(1, ATTITUDE) is None
    assert not asked.note(request(ATTITUDE=None), T0)


def test_a_silent_station_is_forgotten_after_its_last_heartbeat_or_request():
    asked = AskedRates()
    asked.note(request(ATTITUDE=4.0), T0)
    asked.heard(255 << 8 | 190, at(30.0))
    asked.heard(77 << 8 | 190, at(30.0))  # a heartbeat alone asks for nothing
    assert not asked.expire(HostNs(at(30.0) + FORGOTTEN_NS))
    assert asked.expire(HostNs(at(30.0) + FORGOTTEN_NS + 1))
    assert asked.asked_hz(1, ATTITUDE) is None
    assert not asked.expire(at(1000.0))


def test_the_station_that_was_silent_the_longest_makes_room():
    asked = AskedRates()
    for k in range(MAX_ASKERS):
        asked.note(request(100 + k, ATTITUDE=float(k)), at(k))
    asked.heard(100 << 8 | 190, at(60.0))
    asked.note(request(200, VFR_HUD=1.0), at(61.0))  # in place of 101
    assert asked.asked_hz(1, ATTITUDE) == MAX_ASKERS - 1
    asked.note(request(101 + MAX_ASKERS - 2, ATTITUDE=None), at(62.0))
    assert asked.asked_hz(1, ATTITUDE) == MAX_ASKERS - 2
    assert len(asked._askers) == MAX_ASKERS


def test_rates_of_one_station_are_bounded_with_those_of_unknown_messages():
    asked, known = AskedRates(), sorted(DEFINITIONS)
    asked.note(by_id({9_999_999: 1.0}), T0)
    assert asked.asked_hz(1, 9_999_999) == 1.0, "what is not remembered would outlive its station"
    for msgid in known[: MAX_RATES + 20]:
        asked.note(by_id({msgid: 2.0}), T0)
    assert len(set(asked.asked_ids(1))) == MAX_RATES
    asked.note(by_id({known[0]: 7.0}), T0)
    assert asked.asked_hz(1, known[0]) == 7.0, "what is remembered may change"


def test_one_sample_is_awaited_once_for_three_seconds():
    asked = AskedRates()
    assert not asked.note(request(once=ATTITUDE), T0)
    assert not asked.take_once(VFR_HUD, T0)
    assert asked.take_once(ATTITUDE, HostNs(T0 + ONCE_NS))
    assert not asked.take_once(ATTITUDE, T0)
    asked.note(request(once=ATTITUDE), T0)
    assert not asked.take_once(ATTITUDE, HostNs(T0 + ONCE_NS + 1))
    asked.note(request(once=ATTITUDE), T0)
    asked.expire(HostNs(T0 + ONCE_NS + 1))
    assert not asked._once_ns
    for msgid in range(MAX_ONCE + 1):
        asked.note(request(once=msgid), T0)
    assert len(asked._once_ns) <= MAX_ONCE


# Held transfers.


FROM = ("ground", "10.0.0.1")


def test_transfers_leave_in_order_at_six_tenths_of_the_budget():
    held, frames = HeldTransfers(), [bytes([k]) * 100 for k in range(50)]
    passed = [frame for frame in frames if not held.takes(frame, FROM, 1000.0, T0)]
    assert passed == frames[:3], "a bucket of 300 bytes"
    assert held
    left: list[tuple[float, bytes]] = []
    now = 0.0
    while held:
        now = (held.release_at(1000.0, at(now)) - T0) / NS_PER_S
        left += [(now, frame) for frame in held.release(1000.0, at(now))]
    assert [frame for _, frame in left] == frames[3:]
    assert left[-1][0] == pytest.approx(4700 / 600.0, rel=0.03)


def test_without_a_budget_what_was_held_leaves_at_once():
    held = HeldTransfers()
    for _ in range(9):
        held.takes(b"x" * 100, FROM, 1000.0, T0)
    assert held.release_at(None, at(1.0)) == at(1.0)
    assert len(held.release(None, T0)) == 6
    assert not held
    held.takes(b"x" * 100, FROM, 1000.0, T0)
    held.clear()
    assert held.release(None, T0) == []


# Budgets and radios.


def test_a_bucket_fills_at_its_rate_up_to_a_quarter_of_a_second():
    budget = ByteBudget()
    budget.fill(4000.0, T0)
    budget.spend(999)
    assert budget.is_free
    budget.spend(1)
    assert not budget.is_free
    assert budget.free_at(4000.0, T0) == T0 + NS_PER_S // 4000
    budget.fill(4000.0, at(0.1))
    budget.spend(399)
    assert budget.is_free
    budget.spend(1)
    assert not budget.is_free
    budget.fill(4000.0, at(99.0))
    budget.spend(1001)
    assert not budget.is_free
    assert budget.free_at(4000.0, at(99.0)) == at(99.0) + 2 * NS_PER_S // 4000


def test_a_budget_that_opens_is_full():
    budget = ByteBudget()
    budget.fill(100.0, T0)
    budget.spend(10_000)
    budget.fill(inf, at(0.001))
    assert budget.is_free


@pytest.mark.parametrize(
    ("txbuf", "sent", "expected"),
    [(19, 4000.0, 2000.0), (20, 4000.0, 3400.0), (49, 4000.0, 3400.0), (50, 4000.0, None), (100, 4000.0, None),
     (0, 300.0, 200.0)],
)  # fmt: skip
def test_the_first_report_of_a_radio(txbuf: int, sent: float, expected: float | None):
    backoff = RadioBackoff()
    backoff.on_report(txbuf, sent, 9000.0, T0)
    assert backoff.bytes_per_s == (None if expected is None else pytest.approx(expected))
    assert backoff.is_heard


def test_a_radio_slows_from_what_left_and_recovers_until_all_fits():
    backoff = RadioBackoff()
    backoff.on_report(10, None, 9000.0, T0)
    assert backoff.bytes_per_s is None, "nothing was measured yet"
    backoff.on_report(10, 4000.0, 9000.0, T0)
    backoff.on_report(30, 5000.0, 9000.0, T0)  # more left than allowed: commands
    assert backoff.bytes_per_s == pytest.approx(0.85 * 2000.0)
    backoff.on_report(90, 1700.0, 9000.0, T0)
    assert backoff.bytes_per_s == pytest.approx(1700.0)
    backoff.on_report(91, 1700.0, 1900.0, T0)
    assert backoff.bytes_per_s == pytest.approx(1870.0)
    backoff.on_report(91, 1700.0, 1900.0, T0)
    assert backoff.bytes_per_s is None


@pytest.mark.parametrize(
    ("reports", "expected"),
    [([70, 59], 0.85), ([70, 60], None), ([40, 55], None), ([100, 75, 74], None), ([60, 60], None)],
)
def test_radio_backoff_buffer_that_next_report_would_find_half_full_slows_now(reports, expected):
    """A fall from 70 to 59 leaves 48 at the next report; a rise, or a fall that leaves 50, changes nothing."""
    backoff = RadioBackoff()
    for txbuf in reports[:-1]:
        backoff.on_report(txbuf, None, 9000.0, T0)
    backoff.on_report(reports[-1], 4000.0, 9000.0, T0)
    assert backoff.bytes_per_s == (None if expected is None else pytest.approx(expected * 4000.0))


def test_a_radio_that_is_silent_for_ten_seconds_is_gone():
    backoff = RadioBackoff()
    backoff.expire(at(99.0))
    backoff.on_report(10, 4000.0, 9000.0, T0)
    backoff.expire(at(10.0))
    assert (backoff.txbuf, backoff.is_heard) == (10, True)
    backoff.expire(HostNs(at(10.0) + 1))
    assert (backoff.txbuf, backoff.bytes_per_s, backoff.is_heard) == (None, None, False)


# Loads.


def test_the_load_of_a_link_over_whole_windows():
    meter = LoadMeter()
    assert not meter.roll(T0)
    for k in range(40):
        meter.offer((30, 257, 0), 40, inf)
        if k % 4 == 0:
            meter.offer((74, 257, 0), 30 + k % 8, 3.0)
    meter.offer_other(500)
    meter.leave(1234)
    assert not meter.roll(HostNs(at(1.0) - 1))
    assert meter.sent is None
    assert meter.roll(at(2.0))
    assert meter.streams == [(20.0, 40.0), (3.0, pytest.approx(32.0))]
    assert (meter.other, meter.sent) == (250.0, 617.0)
    assert meter.offered == pytest.approx(250.0 + 800.0 + 96.0)
    assert meter.roll(at(3.0))
    assert (meter.streams, meter.other, meter.sent, meter.offered) == ([], 0.0, 0.0, 0.0)


def test_streams_beyond_the_table_count_as_never_thinned():
    meter = LoadMeter()
    meter.roll(T0)
    for k in range(MAX_STREAMS + 5):
        meter.offer((k, 257, 0), 10, inf)
    meter.roll(at(1.0))
    assert (len(meter.streams), meter.other) == (MAX_STREAMS, 50.0)


# Clocks of peers.


def test_a_clock_that_goes_back_and_stays_back_for_two_seconds_is_a_restart():
    clock = PeerClock()
    assert clock.on_stamp(90_000, T0) is None
    assert clock.on_stamp(500, at(1.0)) is None
    assert clock.on_stamp(1500, at(2.0)) is None
    assert clock.on_stamp(2500, HostNs(at(3.0) - 1)) is None
    assert clock.on_stamp(2600, at(3.0)) == at(1.0)


def test_a_clock_that_comes_back_or_goes_back_again_begins_anew():
    clock = PeerClock()
    clock.on_stamp(90_000, T0)
    clock.on_stamp(500, at(1.0))
    assert clock.on_stamp(90_000, at(1.5)) is None, "it was one late frame"
    assert clock.on_stamp(600, at(3.1)) is None
    assert clock.on_stamp(400, at(4.0)) is None, "lower still: another restart"
    assert clock.on_stamp(2000, at(5.5)) is None
    assert clock.on_stamp(2500, at(6.0)) == at(4.0)


# Own frames and copies.


def test_the_newest_frames_of_ours_are_remembered():
    own, wire = OwnFrames(), Wire(1, 191)
    first = wire.attitude(0)
    own.add(first)
    own.add(first)
    frames = [k.to_bytes(4, "big") for k in range(MAX_SENT - 1)]
    for frame in frames:
        own.add(frame)
    assert first in own
    own.add(b"one more")
    assert first not in own
    assert frames[0] in own
    assert len(own._order) == len(own._hashes) == MAX_SENT


def test_a_frame_belongs_to_the_link_by_which_it_came_first():
    copies, frame = Duplicates(), b"frame"
    copies.generations(T0)
    assert copies.came_first_by(frame, 2) == 2
    assert copies.came_first_by(frame, 1) == 2
    assert copies.came_first_by(frame, 2) == 2
    copies.generations(HostNs(T0 + 100 * NS_PER_MS))
    assert copies.came_first_by(frame, 0) == 2
    copies.generations(at(60.0))
    copies.generations(at(120.0))
    assert copies.came_first_by(frame, 0) == 0
