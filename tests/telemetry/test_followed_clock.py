"""A clock that slips or runs at another rate than a crystal: truth first, then exchanges over a wire."""

import random
from math import sqrt

import pytest
from draws import first_of
from wires import Wire, constant, exponential

from fwav_companion.telemetry.clock.clock_news import ClockRate, ClockSlipped
from fwav_companion.types import ClockStatus

LOOPBACK = exponential(0.0003, base_s=0.0002)
RADIO = exponential(0.008, base_s=0.004)


def as_needed(wire: Wire):
    """Ten requests a second while the clock is in doubt, else two: as the service asks."""
    return lambda _t: 10.0 if wire.clock.in_doubt else 2.0


def flown(wire: Wire, until_s: float, from_s: float = 0.0) -> list:
    """Exchanges as needed; returns the news, and notes errors four times a second without judging them."""
    news, t, noted = [], from_s, from_s
    while t < until_s:
        found = wire.exchange(t)
        news += [] if found is None else [found]
        t += 1.0 / (10.0 if wire.clock.in_doubt else 2.0)
        while noted < t - 0.25:
            noted += 0.25
            wire.errors.append((noted, *wire.error_s(noted)))
    return news


@pytest.mark.parametrize("delay", [LOOPBACK, RADIO])
@pytest.mark.parametrize("slip_s", first_of(0.015, -0.06, 19.0, 0.077, 0.17, few=3))
def test_a_slip_is_followed_and_reported_once(slip_s, delay):
    wire = Wire(up=delay, down=delay, drift=lambda t: slip_s if t > 40.0 else 0.0)
    news = flown(wire, 90.0)
    if abs(slip_s) > 0.03 or delay is LOOPBACK:  # else the radio's delays hide it for a while
        assert len(news) == 1
        assert isinstance(news[0], ClockSlipped)
        assert news[0].by_s == pytest.approx(slip_s, abs=1e-3 if delay is LOOPBACK else 0.012)
    after = [(error, estimate) for t, error, estimate in wire.errors if t > 44.0]
    assert all(abs(error) <= estimate.bound_s for error, estimate in after)
    assert all(abs(error) < 5.0 * estimate.sigma_s for error, estimate in after)
    assert wire.errors[-1][2].status is ClockStatus.SETTLED


@pytest.mark.parametrize("slip_s", [0.08, -0.3, 0.9])
def test_the_claim_covers_a_slip_from_the_first_exchange_that_shows_it(slip_s):
    """Three exchanges decide that the clock slipped; until then the line is wrong by the slip."""
    wire = Wire(up=LOOPBACK, down=LOOPBACK, drift=lambda t: slip_s if t > 40.35 else 0.0).run(39.95)
    for k in range(1, 6):
        wire.exchange(40.3 + 0.1 * k)
        error_s, estimate = wire.error_s(40.35 + 0.1 * k)
        assert abs(error_s) < 2.0 * estimate.sigma_s
        assert abs(error_s) <= estimate.bound_s
        assert wire.clock.sigma_s_at(estimate.at_ns) == estimate.sigma_s
    assert abs(error_s) < 1e-3


def test_one_answer_that_disagrees_widens_the_claim_until_the_next():
    wire = Wire(up=LOOPBACK, down=LOOPBACK).run(40.0)
    before = wire.error_s(40.0)[1]
    wire.boot_start_s += 0.5
    wire.exchange(40.0)
    wire.boot_start_s -= 0.5
    suspected = wire.error_s(40.1)[1]
    assert suspected.sigma_s == pytest.approx(0.5, abs=1e-3)
    assert suspected.bound_s > 0.5
    assert suspected.host_from_autopilot_ns == pytest.approx(before.host_from_autopilot_ns, abs=1e4)
    wire.exchange(40.1)
    assert wire.error_s(40.2)[1].sigma_s < 2.0 * before.sigma_s


def test_an_instant_before_the_slip_keeps_its_offset():
    wire = Wire(up=LOOPBACK, down=LOOPBACK, drift=lambda t: 0.077 if t > 40.0 else 0.0, requests_hz=lambda t: 10.0)
    for k in range(405):
        wire.exchange(0.1 * k)
    for t, sigmas in ((39.5, 5.0), (39.85, 5.0), (40.15, 5.0), (40.3, 5.0)):
        error_s, estimate = wire.error_s(t)
        assert abs(error_s) < 1e-3
        assert abs(error_s) < sigmas * estimate.sigma_s
    boot_ns = wire.boot(39.85)
    assert abs(wire.clock.host_from_boot(boot_ns) - wire.host(39.85)) < 1e6
    assert wire.error_s(39.95)[1].sigma_s > 0.02  # somewhere in this tenth of a second it slipped


@pytest.mark.parametrize("rate", [0.2, 0.5, 0.8, 0.985, 1.01, 1.3, 2.0, 3.0])
def test_any_constant_rate_is_followed_inside_its_bound(rate):
    wire = Wire(up=LOOPBACK, down=LOOPBACK, drift=lambda t: (1.0 - rate) * t).run(40.0)  # the bound is judged in it
    errors = [(error, estimate) for t, error, estimate in wire.errors if t > 5.0]
    assert all(abs(error) < 2e-3 for error, _ in errors)
    assert all(abs(error) < 4.0 * estimate.sigma_s for error, estimate in errors)
    assert errors[-1][1].rate == pytest.approx(rate, abs=3e-3)
    assert errors[-1][1].bound_s < 0.02
    boot_ns = wire.boot(39.0)
    assert abs(wire.clock.host_from_boot(boot_ns) - wire.host(39.0)) < 1e6


@pytest.mark.parametrize("rate", [0.5, 0.985, 1.2, 2.0])
def test_the_rate_is_reported_once(rate):
    wire = Wire(up=LOOPBACK, down=LOOPBACK, drift=lambda t: (1.0 - rate) * t)
    news = flown(wire, 60.0)
    assert len(news) == 1
    assert isinstance(news[0], ClockRate)
    assert news[0].rate == pytest.approx(rate, abs=2e-3)


def test_a_rate_that_is_over_is_reported_and_the_clock_settles():
    wire = Wire(up=LOOPBACK, down=LOOPBACK, drift=lambda t: 0.02 * min(t, 30.0))
    news = flown(wire, 80.0)
    assert [type(each) for each in news] == [ClockRate, ClockRate]
    assert news[1].rate == 1.0
    assert wire.errors[-1][2].status is ClockStatus.SETTLED
    assert abs(wire.errors[-1][1]) < 5e-4


def slipping(seed: int, *, mean_s: float, every_s: float):
    """Slips at random, of random length: what a simulator under load does."""
    rng, slips, t = random.Random(seed), [], 0.0
    while t < 200.0:
        t += rng.expovariate(1.0 / every_s)
        slips.append((t, rng.expovariate(1.0 / mean_s)))
    return lambda t: sum(by for at, by in slips if at < t)


@pytest.mark.parametrize(("mean_s", "every_s"), [(0.005, 0.5), (0.03, 3.0)])
def test_a_clock_that_slips_all_the_time_is_honest(mean_s, every_s):
    """Instants that lie 0.2 s back, as frames do; 12 flights of a minute."""
    squares, worst = [], 0.0
    for seed in range(12):
        wire = Wire(up=LOOPBACK, down=LOOPBACK, drift=slipping(seed, mean_s=mean_s, every_s=every_s), seed=seed)
        for k in range(600):
            wire.exchange(0.1 * k)
            if k > 100 and k % 3 == 0:
                error_s, estimate = wire.error_s(0.1 * k - 0.2)
                squares.append((error_s / estimate.sigma_s) ** 2)
                worst = max(worst, abs(error_s))
    assert 0.25 < sum(squares) / len(squares) < 2.0
    assert worst < 0.25
    inside = sum(square < 1.96**2 for square in squares) / len(squares)
    assert inside > 0.9


@pytest.mark.parametrize("rate", [0.985, 1.0])
def test_the_claim_of_a_followed_clock_holds_behind_a_radio(rate):
    """A slip at 20 s, and two rates; 30 flights, judged at one instant each second after."""
    squares = []
    for seed in range(30):
        wire = Wire(
            up=RADIO,
            down=RADIO,
            drift=lambda t: (1.0 - rate) * t + (0.1 if t > 20.0 else 0.0),
            seed=seed,
        )
        for k in range(350):
            wire.exchange(0.1 * k)
            if k > 240 and k % 20 == 0:
                error_s, estimate = wire.error_s(0.1 * k)
                squares.append(error_s**2 / (estimate.sigma_s**2 - estimate.asymmetry_s**2))
    assert 0.3 < sum(squares) / len(squares) < 1.7
    assert sqrt(sorted(squares)[-3]) < 4.0


def test_single_answers_of_another_clock_change_nothing_while_it_is_followed():
    ours, spoiled = (Wire(up=constant(4e-4), down=constant(6e-4), drift=lambda t: 0.015 * t) for _ in range(2))
    for k in range(200):
        for wire in (ours, spoiled):
            wire.exchange(0.1 * k)
        if k % 5 == 3 and k > 20:
            before, spoiled.boot_start_s = spoiled.boot_start_s, spoiled.boot_start_s + 40.0 * (-1) ** k
            spoiled.exchange(0.1 * k + 0.05)
            spoiled.boot_start_s = before
    assert spoiled.error_s(20.0) == ours.error_s(20.0)
