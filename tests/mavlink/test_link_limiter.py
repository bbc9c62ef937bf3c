"""A link that is too slow for its traffic: which messages are thinned, which never are, and that no buffer fills."""

from __future__ import annotations

import random
from collections import Counter
from math import inf

import pytest
from mavlink_wire import MESSAGES

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.byte_budget import DEPTH_S, SILENT_NS, SLOWEST_BYTES_PER_S, ByteBudget, RadioBackoff
from fwav_companion.mavlink.router.held_transfers import MAX_HELD_BYTES, SHARE
from fwav_companion.mavlink.router.link_limiter import LinkLimiter
from fwav_companion.mavlink.router.link_load import MAX_STREAMS, LoadMeter, common_rate
from fwav_companion.mavlink.router.never_thinned import is_telemetry
from sitl_mock.codec import NUMBERS

T0 = HostNs(1000 * NS_PER_S)
AUTOPILOT = 1 << 8 | 1
LONGEST_FRAME = 293


def at(seconds: float) -> HostNs:
    return HostNs(T0 + round(seconds * NS_PER_S))


class Traffic:
    """Streams of given rates and sizes through a limiter, in order of time; keeps what was sent, by name."""

    def __init__(self, limiter: LinkLimiter, seed: int = 1) -> None:
        self.limiter = limiter
        self.left: list[tuple[float, str, int]] = []
        self._rng = random.Random(seed)

    def run(self, from_s: float, to_s: float, **streams: tuple[float, int]) -> Traffic:
        """``streams``: name = (hertz, bytes)."""
        due = []
        for name, (hz, size) in streams.items():
            phase = self._rng.random() / hz
            due += [(from_s + phase + i / hz, name, size) for i in range(int((to_s - from_s) * hz))]
        for seconds, name, size in sorted(due):
            if self.limiter.passes((NUMBERS[name], AUTOPILOT, 0), size, at(seconds)):
                self.left.append((seconds, name, size))
        return self

    def hz(self, name: str, from_s: float, to_s: float) -> float:
        return sum(each == name and from_s <= at_s < to_s for at_s, each, _ in self.left) / (to_s - from_s)

    def bytes_per_s(self, from_s: float, to_s: float) -> float:
        return sum(size for at_s, _, size in self.left if from_s <= at_s < to_s) / (to_s - from_s)

    def largest_backlog(self, drain: float) -> float:
        """The largest backlog of a line that drains ``drain`` bytes a second."""
        backlog = last_s = worst = 0.0
        for at_s, _, size in self.left:
            backlog = max(0.0, backlog - drain * (at_s - last_s)) + size
            worst, last_s = max(worst, backlog), at_s
        return worst


HEAVY = {"ATTITUDE": (50.0, 40), "VFR_HUD": (10.0, 32), "SYS_STATUS": (1.0, 43), "HIGHRES_IMU": (50.0, 75)}


# The common rate.


def test_all_fits_where_the_budget_is_large_enough():
    assert common_rate([(50.0, 40), (1.0, 43)], 2043.0) == inf
    assert common_rate([], 0.0) == inf


def test_fast_streams_are_cut_to_one_rate_and_slow_ones_keep_theirs():
    assert common_rate([(50.0, 40), (1.0, 40), (10.0, 20)], 40 + 60 * 8.0) == pytest.approx(8.0)


def test_the_common_rate_spends_the_budget_whatever_the_streams():
    rng = random.Random(3)
    for _ in range(200):
        streams = [(rng.uniform(0.1, 100.0), rng.uniform(12, 280)) for _ in range(rng.randrange(1, 40))]
        whole = sum(hz * size for hz, size in streams)
        budget = rng.uniform(0.01, 0.99) * whole
        hz = common_rate(streams, budget)
        assert sum(min(each, hz) * size for each, size in streams) == pytest.approx(budget)


# The token bucket.


def test_over_any_time_at_most_the_budget_and_one_depth_leave():
    budget, rng, rate = ByteBudget(), random.Random(5), 4032.0
    left: list[tuple[float, int]] = []
    now = 0.0
    for _ in range(20_000):
        now += rng.expovariate(300.0)
        size = rng.randrange(12, 280)
        budget.fill(rate, at(now))
        if budget.is_free:
            budget.spend(size)
            left.append((now, size))
    for start in range(0, len(left) - 400, 97):
        for stop in (start + 5, start + 50, start + 400):
            seconds = left[stop][0] - left[start][0]
            assert sum(size for _, size in left[start : stop + 1]) <= rate * (seconds + DEPTH_S) + 280


def test_a_debt_is_forgotten_after_a_second():
    budget = ByteBudget()
    budget.fill(1000.0, at(0))
    budget.spend(50_000)
    budget.fill(1000.0, at(0.1))
    assert not budget.is_free
    assert budget.free_at(1000.0, at(0.1)) <= at(1.2)
    budget.fill(1000.0, at(1.2))
    assert budget.is_free


# Which messages are telemetry.


@pytest.mark.parametrize(
    "name",
    [
        "HEARTBEAT", "COMMAND_LONG", "COMMAND_INT", "COMMAND_ACK", "PARAM_VALUE", "PARAM_SET", "PARAM_REQUEST_READ",
        "MISSION_ITEM_INT", "MISSION_REQUEST_INT", "MISSION_ACK", "MISSION_COUNT", "MISSION_CURRENT", "STATUSTEXT",
        "FILE_TRANSFER_PROTOCOL", "LOG_DATA", "AUTOPILOT_VERSION", "CAMERA_INFORMATION", "SET_MODE",
        "RC_CHANNELS_OVERRIDE", "MANUAL_CONTROL", "GPS_RTCM_DATA", "LANDING_TARGET",
    ],
)  # fmt: skip
def test_never_thinned_on_the_way_to_an_autopilot(name):
    assert not is_telemetry(NUMBERS[name], to_autopilot=True)


def test_no_message_of_commands_parameters_and_missions_is_thinned_anywhere():
    for message in MESSAGES:
        if message.msgname.startswith(("COMMAND_", "PARAM_", "MISSION_", "HEARTBEAT")):
            assert not is_telemetry(message.id), message.msgname


def test_streams_are_telemetry_on_the_way_to_the_ground():
    for name in ("ATTITUDE", "ODOMETRY", "GIMBAL_DEVICE_ATTITUDE_STATUS", "NAMED_VALUE_FLOAT", "BATTERY_STATUS"):
        assert is_telemetry(NUMBERS[name])
    assert not is_telemetry(0xABCDEF), "an unknown id may be anything"


# All together.


def test_without_a_budget_nothing_is_thinned():
    traffic = Traffic(LinkLimiter({})).run(0.0, 5.0, **HEAVY)
    assert traffic.hz("HIGHRES_IMU", 0.0, 5.0) == 50.0
    assert not traffic.limiter.limits(NUMBERS["ATTITUDE"], AUTOPILOT)


@pytest.mark.parametrize("seed", range(5))
def test_telemetry_is_thinned_to_the_budget_fast_streams_first(seed):
    traffic = Traffic(LinkLimiter({}, max_bytes_per_s=2000.0), seed).run(0.0, 20.0, **HEAVY)
    assert traffic.bytes_per_s(3.0, 20.0) == pytest.approx(1900.0, rel=0.06)
    assert traffic.hz("SYS_STATUS", 3.0, 20.0) == pytest.approx(1.0, abs=0.1), "a slow stream keeps every sample"
    assert traffic.hz("VFR_HUD", 3.0, 20.0) == pytest.approx(10.0, abs=0.7)
    fast = [traffic.hz(name, 3.0, 20.0) for name in ("ATTITUDE", "HIGHRES_IMU")]
    assert fast == pytest.approx([(1900.0 - 43 - 320) / 115] * 2, rel=0.1)
    reasons = {row.message: row.why for row in traffic.limiter.status().messages}
    assert reasons["ATTITUDE"] == "max_bytes_per_s"


@pytest.mark.parametrize("seed", range(5))
def test_a_line_that_drains_faster_than_the_budget_never_fills(seed):
    """57 600 baud drain 5760 bytes/s; 70 % of that may leave."""
    traffic = Traffic(LinkLimiter({}, max_bytes_per_s=0.7 * 5760), seed)
    bursts = {"ODOMETRY": (100.0, 245), "ATTITUDE": (100.0, 40), "HEARTBEAT": (2.0, 21), "COMMAND_ACK": (5.0, 22)}
    traffic.run(0.0, 10.0, **bursts).run(14.0, 20.0, **bursts, PARAM_VALUE=(50.0, 37))
    assert traffic.largest_backlog(5760.0) <= DEPTH_S * 0.7 * 5760 + LONGEST_FRAME + 21 + 22 + 37
    sent = Counter(name for _, name, _ in traffic.left)
    assert (sent["HEARTBEAT"], sent["COMMAND_ACK"], sent["PARAM_VALUE"]) == (32, 80, 300)


def test_what_is_never_thinned_leaves_even_beyond_the_budget_and_telemetry_makes_room():
    traffic = Traffic(LinkLimiter({}, max_bytes_per_s=1000.0))
    traffic.run(0.0, 4.0, ATTITUDE=(20.0, 40)).run(4.0, 12.0, ATTITUDE=(20.0, 40), COMMAND_ACK=(60.0, 22))
    traffic.run(12.0, 18.0, ATTITUDE=(20.0, 40))
    assert traffic.hz("ATTITUDE", 1.0, 4.0) == pytest.approx(20.0, abs=1.0)
    assert traffic.hz("COMMAND_ACK", 4.0, 12.0) == 60.0
    assert traffic.hz("ATTITUDE", 6.0, 12.0) < 2.0
    assert traffic.hz("ATTITUDE", 14.5, 18.0) == pytest.approx(20.0, abs=1.0), "it comes back"


def test_slow_streams_keep_their_samples_while_answers_take_half_of_the_budget():
    traffic = Traffic(LinkLimiter({}, max_bytes_per_s=2000.0))
    slow = {"SYS_STATUS": (1.0, 43), "BATTERY_STATUS": (0.5, 54), "GPS_RAW_INT": (2.0, 42)}
    traffic.run(0.0, 30.0, **slow, COMMAND_ACK=(45.0, 22), ATTITUDE=(50.0, 40), HIGHRES_IMU=(50.0, 75))
    assert [traffic.hz(name, 2.0, 30.0) for name in slow] == pytest.approx([1.0, 0.5, 2.0], abs=0.08)


def test_no_stream_starves_where_all_come_at_the_same_instants():
    """Forty messages of one period, back to back: each loses its turn to none of the others."""
    limiter = LinkLimiter({}, max_bytes_per_s=1000.0)
    names = [message.msgname for message in MESSAGES if is_telemetry(message.id)][:40]
    left: Counter[str] = Counter()
    for period in range(600):
        for name in names:
            if limiter.passes((NUMBERS[name], AUTOPILOT, 0), 60, at(period / 10)) and period >= 100:
                left[name] += 1
    assert min(left[name] for name in names) >= 0.8 * max(left.values())


def test_a_configured_rate_a_cap_and_the_budget_work_together():
    limiter = LinkLimiter({"VFR_HUD": 2}, max_bytes_per_s=5000.0)
    traffic = Traffic(limiter).run(0.0, 10.0, VFR_HUD=(10.0, 32), ATTITUDE=(20.0, 40))
    assert traffic.hz("VFR_HUD", 2.0, 10.0) == pytest.approx(2.0, abs=0.2)
    assert traffic.hz("ATTITUDE", 2.0, 10.0) == 20.0
    rows = {row.message: (row.why, row.at_most_hz) for row in limiter.status().messages}
    assert rows == {"VFR_HUD": ("max_rate_hz", 2.0)}


def test_each_named_value_and_each_aircraft_is_a_stream_of_its_own():
    limiter = LinkLimiter({"NAMED_VALUE_FLOAT": 1})
    key = NUMBERS["NAMED_VALUE_FLOAT"]
    passed = [limiter.passes((key, AUTOPILOT, instance), 30, at(0)) for instance in (7, 8, 7)]
    assert passed == [True, True, False]


def test_the_tables_are_bounded():
    load = LoadMeter()
    for instance in range(3 * MAX_STREAMS):
        load.offer((30, AUTOPILOT, instance), 40, inf)
    assert len(load._counts) <= MAX_STREAMS
    assert load.roll(at(0)) is False
    assert load.roll(at(1)) is True
    assert load.offered == pytest.approx(3 * MAX_STREAMS * 40)


# Transfers.

VEHICLE = ("autopilot", "")
"""The autopilot's link."""


def test_a_parameter_list_faster_than_the_link_arrives_whole_in_order_and_at_its_share():
    limiter = LinkLimiter({}, max_bytes_per_s=4032.0)
    frames = [number.to_bytes(2, "little") + bytes(35) for number in range(1000)]
    arrived: list[tuple[float, bytes]] = []
    now = 0.0
    waiting = list(frames)
    while len(arrived) < len(frames):
        now += 0.002
        arrived += [(now, data) for data in limiter.release(at(now))]
        if waiting and not limiter.holds(NUMBERS["PARAM_VALUE"], waiting[0], VEHICLE, at(now)):
            assert limiter.passes((NUMBERS["PARAM_VALUE"], AUTOPILOT, 0), 37, at(now))
            arrived.append((now, waiting[0]))
        del waiting[:1]
        assert now < 60.0
    assert [data for _, data in arrived] == frames
    assert now == pytest.approx(37_000 / (SHARE * 4032.0), rel=0.1)
    assert not limiter.holds_any


def test_what_is_held_is_released_when_it_says():
    limiter = LinkLimiter({}, max_bytes_per_s=1000.0)
    while not limiter.holds(NUMBERS["LOG_DATA"], bytes(100), VEHICLE, at(0)):
        pass
    due = limiter.release_at(at(0))
    assert limiter.release(HostNs(due - NS_PER_MS)) == []
    assert len(limiter.release(due)) == 1


def test_what_is_held_is_bounded_and_forgotten_with_the_link():
    limiter = LinkLimiter({}, max_bytes_per_s=500.0)
    for _ in range(3000):
        limiter.holds(NUMBERS["LOG_DATA"], bytes(100), VEHICLE, at(0))
    assert limiter._held._queues.total_bytes <= MAX_HELD_BYTES
    limiter.disconnect()
    assert not limiter.holds_any


@pytest.mark.parametrize("strangers", [1, 40])
def test_a_transfer_of_strangers_delays_that_of_the_vehicle_by_its_turns_and_costs_it_no_frame(strangers: int):
    """A stranger's LOG_DATA at 100 times the link's rate kept every parameter from a radio's station."""
    limiter = LinkLimiter({}, max_bytes_per_s=4000.0)
    frames = [number.to_bytes(2, "little") + bytes(35) for number in range(50)]
    arrived: list[bytes] = []
    waiting = list(frames)
    for step in range(5000):
        now = at(step * 0.002)
        for k in range(40):
            limiter.holds(NUMBERS["LOG_DATA"], b"x" * 37, ("ground", f"10.0.0.{k % strangers}"), now)
        if step > 2500 and waiting:
            held = limiter.holds(NUMBERS["PARAM_VALUE"], waiting[0], VEHICLE, now)
            arrived += [] if held else [waiting[0]]
            del waiting[0]
        arrived += [data for data in limiter.release(now) if data in frames]
    least = {1: 50, 40: 17}[strangers]  # at 65 frames/s in turns: one of two, one of seventeen
    assert arrived == frames[: len(arrived)]
    assert len(arrived) >= least


def test_a_link_without_a_budget_holds_nothing():
    assert not LinkLimiter({}).holds(NUMBERS["PARAM_VALUE"], bytes(37), VEHICLE, at(0))


# Reports of the radio itself.


@pytest.mark.parametrize(("txbuf", "factor"), [(0, 0.5), (19, 0.5), (20, 0.85), (49, 0.85), (50, None), (100, None)])
def test_a_full_buffer_halves_a_filling_one_slows(txbuf, factor):
    radio = RadioBackoff()
    radio.on_report(txbuf, 3000.0, 3000.0, at(0))
    assert radio.bytes_per_s == (None if factor is None else pytest.approx(factor * 3000.0))


def test_a_radio_recovers_step_by_step_and_is_free_where_all_fits_again():
    radio = RadioBackoff()
    radio.on_report(10, 3000.0, 3000.0, at(0))
    radio.on_report(70, 1500.0, 3000.0, at(1))
    assert radio.bytes_per_s == pytest.approx(1500.0)
    steps = 0
    while radio.bytes_per_s is not None:
        radio.on_report(95, radio.bytes_per_s, 3000.0, at(2 + steps))
        steps += 1
    assert steps == 8, "1.1 ** 8 > 2"


def test_a_radio_is_never_slowed_to_nothing_and_forgotten_when_silent():
    radio = RadioBackoff()
    for second in range(20):
        radio.on_report(0, 100.0, 3000.0, at(second))
    assert radio.bytes_per_s == SLOWEST_BYTES_PER_S
    radio.expire(HostNs(at(19) + SILENT_NS + 1))
    assert (radio.bytes_per_s, radio.is_heard) == (None, False)


def test_a_link_behind_a_radio_is_thinned_by_its_reports_and_recovers():
    limiter = LinkLimiter({})
    assert limiter.on_radio(100, at(0)), "from now on its frames are counted"
    traffic = Traffic(limiter).run(0.0, 4.0, **HEAVY)
    assert traffic.hz("ATTITUDE", 0.0, 4.0) == 50.0
    limiter.on_radio(10, at(4))
    traffic.run(4.0, 8.0, **HEAVY)
    assert traffic.bytes_per_s(5.5, 8.0) == pytest.approx(0.95 * 6113 / 2, rel=0.1)
    assert traffic.hz("SYS_STATUS", 4.0, 8.0) == pytest.approx(1.0, abs=0.26)
    status = limiter.status()
    assert (status.why, status.txbuf) == ("radio_status", 10)
    for second in range(8, 30):
        limiter.on_radio(98, at(second))
        traffic.run(second, second + 1, **HEAVY)
    assert traffic.hz("ATTITUDE", 27.0, 30.0) == pytest.approx(50.0, abs=1.0)
    assert limiter.status().max_bytes_per_s is None
