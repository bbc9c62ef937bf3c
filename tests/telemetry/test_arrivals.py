"""The arrival envelope alone: it must tolerate the arrival delays of a busy machine."""

import random
from math import sin

import pytest

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.arrivals import ARRIVALS_TO_BEGIN, BUCKET_NS, TRUNCATION_NS, ArrivalEnvelope
from fwav_companion.telemetry.clock.clock import Clock


def test_messages_of_two_seconds_that_came_in_one_datagram_have_one_instant_and_no_slope():
    envelope = ArrivalEnvelope()
    arrival = HostNs(900 * BUCKET_NS)
    for _ in range(ARRIVALS_TO_BEGIN):
        envelope.insert(BootNs(BUCKET_NS - 1), arrival)
    envelope.insert(BootNs(BUCKET_NS + 1), arrival)
    assert envelope.line is not None
    assert abs(envelope.line.offset_ns - (arrival - BUCKET_NS - TRUNCATION_NS)) <= 2
    envelope.insert(BootNs(3 * BUCKET_NS), HostNs(arrival + 2 * BUCKET_NS))
    assert abs(envelope.line.skew) <= 1e-3


def test_a_link_whose_least_delay_wanders_bounds_nothing_closer_than_its_sigma():
    """From a real ground station's log: a radio that sends collected data up to seconds late."""
    clock = Clock()
    for second, late_ms in enumerate((20, 1000, 700, 5, 300, 1400, 600, 90, 400, 800, 1200, 30)):
        for k in range(4):
            stamp = BootNs((100 + second) * BUCKET_NS + k * 250_000_000)
            clock.on_arrival(stamp, HostNs(stamp + 500 * BUCKET_NS + late_ms * 1_000_000))
    reported = clock.estimate(HostNs(612 * BUCKET_NS))
    assert reported.sigma_s > 0.2
    assert reported.bound_s >= 3.0 * reported.sigma_s


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.98, 1.0, 1.02, 3.0])
def test_a_simulators_clock_is_followed_by_arrivals_alone_where_its_rate_is_known(rate):
    """Even where the rate itself varies by a twentieth of its departure from real time."""
    clock, rng = Clock(rate), random.Random(5)
    host_s, boot_s, errors = 0.0, 50.0, []
    while host_s < 90.0:
        host_s += 0.1
        boot_s += 0.1 * (rate + 0.05 * sin(host_s / 5.0) * (rate - 1.0))
        arrival = HostNs(round((900.0 + host_s + 0.001 + rng.expovariate(500.0)) * 1e9))
        clock.on_arrival(BootNs(int(boot_s * 1e3) * 1_000_000), arrival)
        placed = clock.host_from_boot(BootNs(round(boot_s * 1e9)))
        if not isinstance(placed, int):
            continue  # too few arrivals yet
        reported = clock.estimate(HostNs(placed))
        errors.append((abs(placed * 1e-9 - 900.0 - host_s), reported.sigma_s, reported.bound_s))
    assert all(error < 4.0 * sigma and error < bound for error, sigma, bound in errors[50:])
    assert clock.rate_at(HostNs(round((900.0 + host_s) * 1e9))) == pytest.approx(rate, rel=0.15)


@pytest.mark.parametrize("rate", [0.3, 0.5])
def test_a_simulator_that_pauses_is_not_taken_for_a_clock_at_rest(rate):
    """It repeats its stamp for a while. A line with the slope of that pause would have no inverse."""
    clock, boot_s = Clock(rate), 50.0
    for tenth in range(600):
        if not 200 <= tenth < 300:
            boot_s += 0.1 * rate
        arrival = HostNs(100_000_000 * tenth + 900_000_000_000)
        clock.on_arrival(BootNs(int(boot_s * 1e3) * 1_000_000), arrival)
        clock.host_from_boot(BootNs(int(boot_s * 1e9)))
        assert clock.rate_at(arrival) > 0.4 * rate


def test_without_its_rate_a_slow_clock_is_not_followed():
    """A queue that grows looks alike: only a whole recording shows which of the two it is."""
    clock = Clock()
    for tenth in range(300):
        clock.on_arrival(BootNs(98_000_000 * tenth), HostNs(100_000_000 * tenth))
    placed = clock.host_from_boot(BootNs(98_000_000 * 299))
    assert isinstance(placed, int)
    assert placed < 29.8e9  # late by the growth within ten seconds


def paused(seed: int, *, mean_s: float, every_s: float) -> list[tuple[float, float]]:
    """Beginning and length of each pause of a simulator, seconds, after the first ten."""
    rng, pauses, t = random.Random(seed), [], 10.0
    while t < 80.0:
        t += rng.expovariate(1.0 / every_s)
        pauses.append((t, rng.expovariate(1.0 / mean_s)))
        t += pauses[-1][1]
    return pauses


@pytest.mark.parametrize(("rate", "mean_s", "every_s"), [(0.98, 0.1, 5.0), (0.8, 0.3, 10.0), (0.5, 1.0, 15.0)])
def test_the_claim_holds_while_a_simulator_pauses_now_and_then(rate, mean_s, every_s):
    """Judged at each message, 0.2 s back, as frames are; four flights, in which pauses are a fiftieth and more."""
    outside = []
    for seed in range(4):
        clock, rng, pauses = Clock(rate), random.Random(seed), paused(seed, mean_s=mean_s, every_s=every_s)

        def boot_s(t):
            return 50.0 + rate * (t - sum(min(max(t - at, 0.0), long) for at, long in pauses))  # noqa: B023

        for k in range(1600):
            t = 0.05 * k
            if any(at <= t < at + long for at, long in pauses):
                continue
            arrival = HostNs(round((900.001 + t + rng.expovariate(500.0)) * 1e9))
            clock.on_arrival(BootNs(int(boot_s(t) * 1e3) * 1_000_000), arrival)
            if t > 15.0:
                then = HostNs(round((899.8 + t) * 1e9))
                error_s = clock.boot_from_host(then) * 1e-9 - boot_s(t - 0.2)
                outside.append(abs(error_s) > 1.96 * clock.sigma_s_at(then))
    assert sum(outside) / len(outside) < 0.02


def test_a_claim_that_a_pause_widened_is_narrow_again_when_the_line_has_followed():
    clock = Clock(0.8)
    for tenth in range(400):
        boot_s = 50.0 + 0.08 * (tenth - 20 * (tenth > 220))
        if not 200 < tenth <= 220:
            clock.on_arrival(BootNs(int(boot_s * 1e3) * 1_000_000), HostNs((9000 + tenth) * 100_000_000))
        if tenth == 225:
            assert clock.sigma_s_at(HostNs(922_400_000_000)) > 0.8  # the line is 1.6 s off
    assert clock.sigma_s_at(HostNs(939_000_000_000)) < 0.015


def test_one_late_message_and_another_widen_nothing():
    clock = Clock()
    for tenth in range(300):
        late_ns = 300_000_000 if tenth % 3 else 0
        clock.on_arrival(BootNs(100_000_000 * tenth), HostNs(100_000_000 * tenth + late_ns + 10**12))
        if tenth > 30 and tenth % 10 > 2:  # each second begins with what came first in it
            assert clock.sigma_s_at(HostNs(100_000_000 * tenth + 10**12)) < 0.006
