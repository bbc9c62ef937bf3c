"""One line of the clock's table: the errors and claims of many drawn sequences of one kind."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from statistics import median

from clock_draws import KINDS, Flown, Kind, fly
from one_way_optimum import least_error_s


@dataclass(frozen=True)
class Row:
    """One line of the table over many draws; times in milliseconds but for the healing."""

    name: str
    steady_ms: float
    p99_ms: float
    sigma_ms: float
    bare_share: float
    """Sigma without its asymmetry term, against the rms error."""
    outside_share: float
    healed_s: float
    """Longest time until below the limit, from the third good exchange and from each change's end."""
    start_s: float
    half_ms: float
    beyond_ms: float
    """Largest steady error beyond the half asymmetry (one-way: the least delay)."""
    least_ms: float
    """The same of an estimator that knows how one-way delays are drawn: none is better in the mean. 0 for exchanges."""
    published_ms: float


def limit_s(kind: Kind) -> float:
    """Error below which a clock has healed: 5 ms; one-way three sigmas of arrivals beyond the least delay."""
    return 5e-3 if kind.answered_until_s >= 0.0 else kind.stream_base_s + 3.0 * kind.stream_jitter_s


def tabulated(name: str, draws: int, fly_one: Callable[[Kind, int], Flown] = fly) -> tuple[Row, list[Flown]]:
    kind = KINDS[name]
    flights = [fly_one(kind, seed) for seed in range(draws)]
    steady = [probe for flown in flights for probe in flown.steady()]
    errors = sorted(abs(error) for _, error, *_ in steady)
    healed = [flown.healed_s(limit_s(kind)) for flown in flights]
    outside = [flown.outside() for flown in flights]
    rms = sqrt(sum(e * e for e in errors) / len(errors))
    row = Row(
        name=name,
        steady_ms=1e3 * median(errors),
        p99_ms=1e3 * errors[int(0.99 * len(errors))],
        sigma_ms=1e3 * median(sigma for _, _, sigma, *_ in steady),
        bare_share=sqrt(sum(bare * bare for _, _, _, bare, _ in steady) / len(steady)) / rms,
        outside_share=sum(n for n, _ in outside) / max(1, sum(n for _, n in outside)),
        healed_s=max((max(times[1:]) for times in healed if times[1:]), default=0.0),
        start_s=max(times[0] for times in healed),
        half_ms=1e3
        * median(
            kind.stream_base_s if kind.answered_until_s < 0.0 else abs(flown.world.half_asymmetry_s)
            for flown in flights
        ),
        beyond_ms=1e3 * max(flown.steady_error_s() for flown in flights),
        least_ms=1e3 * max(least_error_s(flown) for flown in flights) if kind.answered_until_s < 0.0 else 0.0,
        published_ms=1e3 * median(abs(error) for *_, error in steady),
    )
    return row, flights
