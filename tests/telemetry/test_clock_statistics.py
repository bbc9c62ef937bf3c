"""The clock's claims, tested from both sides: over many seeds its 95 % interval holds the truth 90 to 98 times in
100.
"""

from math import inf, sqrt

import pytest
from draws import first_rows_of
from wires import Delay, Wire, constant, exponential


def gaussian(rng) -> float:
    return max(0.001, rng.gauss(0.020, 0.003))


def final_errors(delay: Delay, *, seconds: float, seeds: int, hz: float = 10.0) -> list[tuple[float, float, float]]:
    """(error, claimed sigma, its part for an asymmetry of the delays) after this number of seconds, by seed."""
    ends = []
    for seed in range(seeds):
        wire = Wire(up=delay, down=delay, drift=lambda t: 20e-6 * t, seed=seed)
        for k in range(int(seconds * hz)):
            wire.exchange(k / hz)
        error_s, estimate = wire.error_s(seconds + 0.1)
        assert abs(error_s) <= estimate.bound_s
        ends.append((error_s, estimate.sigma_s, estimate.asymmetry_s))
    return ends


def coverage(ends: list[tuple[float, float, float]]) -> float:
    return sum(abs(error) <= 1.96 * sigma for error, sigma, _ in ends) / len(ends)


def claimed_share(ends: list[tuple[float, float, float]]) -> float:
    """Claim for errors that exchanges can show, in root mean square errors: the wires here are symmetric."""
    rms2 = sum(error**2 for error, _, _ in ends)
    return sqrt(sum(sigma**2 - unseen**2 for _, sigma, unseen in ends) / rms2)


@pytest.mark.parametrize(
    ("seeds", "low", "high"), [(100, 0.80, 1.0), pytest.param(300, 0.90, 0.98, marks=pytest.mark.slow)]
)
def test_ten_milliseconds_of_exponential_jitter(seeds, low, high):
    """Of 100 draws: the 99.9 % limits where the probability is 0.90 to 0.98."""
    ends = final_errors(exponential(0.010), seconds=20.0, seeds=seeds)
    assert max(abs(error) for error, *_ in ends) < 1e-3
    assert low <= coverage(ends) <= high


@pytest.mark.parametrize(
    ("delay", "seconds", "hz"),
    first_rows_of(
        (exponential(0.001, base_s=0.001), 10.0, 10.0),
        (lambda rng: 0.001 + rng.gammavariate(2.0, 0.005), 20.0, 4.0),
        (exponential(0.010, base_s=0.005), 10.0, 10.0),
        (gaussian, 10.0, 10.0),
        (lambda rng: rng.uniform(0.0, 0.02), 20.0, 4.0),
        few=2,
    ),
    ids=["short exponential", "gamma", "exponential on a base", "gaussian", "uniform"],
)
def test_the_claim_holds_for_other_symmetric_delays(delay, seconds, hz):
    ends = final_errors(delay, seconds=seconds, seeds=100, hz=hz)
    # 99.9 % limits of 100 draws whose probability is 0.90 to 0.98
    assert 0.80 <= coverage(ends) <= 1.0
    assert 0.75 < claimed_share(ends) < 1.4


def test_without_jitter_it_is_exact_and_the_bound_stays_half_the_round_trip():
    wire = Wire(up=constant(0.004), down=constant(0.004), drift=lambda t: 30e-6 * t)
    wire.run(20.0)
    error_s, estimate = wire.error_s(20.0)
    assert abs(error_s) < 5e-6
    assert estimate.sigma_s**2 - estimate.asymmetry_s**2 < 50e-6**2
    assert estimate.asymmetry_s == pytest.approx(0.004 / sqrt(3.0), rel=1e-3)
    assert estimate.round_trip_s == pytest.approx(0.008, abs=2e-6)
    assert estimate.bound_s == pytest.approx(0.004 + 0.1 * 600e-6, abs=1e-4)
    assert estimate.skew == pytest.approx(30e-6, abs=2e-6)


@pytest.mark.parametrize("count", [3, 5, 8])
def test_the_first_exchanges_claim_what_their_round_trips_allow(count):
    """Some flights have no three exchanges that agree yet: those make no claim."""
    ends = [end for end in final_errors(exponential(0.010), seconds=count / 10.0, seeds=100) if end[1] < inf]
    assert len(ends) > 20
    assert coverage(ends) >= 0.80
    assert 0.7 < claimed_share(ends) < 2.0


@pytest.mark.parametrize("count", [1, 2])
def test_before_three_exchanges_agree_nothing_is_claimed(count):
    assert all(sigma == inf for _, sigma, _ in final_errors(exponential(0.010), seconds=count / 10.0, seeds=10))
