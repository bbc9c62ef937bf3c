"""Claimed covariances of single fixes against the truth of many flights whose biases are drawn from the configured
priors.

One fix a flight is used, since a flight's biases are one draw. The bounds are the 99.9 % limits of this number of
draws: a claim too small and a claim too large both fail.
"""

from functools import partial
from math import cos, degrees, sin, tau
from random import Random

import pytest
from draws import draws_of, slow_of
from flying import Companion
from kept import kept
from scipy.stats import binom, chi2

from fwav_companion.types import GroundFix
from sitl_mock import Options, Simulation, TargetOptions, scenario, simulate
from sitl_mock.earth import Place

FEW, SOME, MANY = 5, 32, 80
"""Flights of each of four kinds by default, in the slow part and by night: 20, 128 and 320 draws. Of 32 flights whose
claims are half or twice the error, the sum of squares is outside its limits in all but one case of ten thousand."""
FIRST_SEED = 5000
CLEAR = {"camera.clutter": 0.0, "camera.missed": 0.0}
"""No clutter and no misses: they are tested elsewhere."""


def placed(options: Options, rng: Random) -> Options:
    """The options with the target at or near a place that is in view at a random instant."""
    mock = simulate(options)
    t = rng.uniform(3.5, options.seconds - 0.3)
    state = mock.flight.at(t)
    axis = tuple(row[2] for row in state.ned_from_body)
    if options.gimbal.device_id:
        axis = tuple(row[0] for row in mock.vehicle.belief.gimbal.ned_from_gimbal(t))
    height_m = -state.position[2]
    off_m, course = 0.3 * height_m * rng.random() ** 0.5, rng.uniform(0.0, tau)
    north = state.position[0] + axis[0] / axis[2] * height_m + off_m * cos(course) - options.flight.centre[0]
    east = state.position[1] + axis[1] / axis[2] * height_m + off_m * sin(course) - options.flight.centre[1]
    return options.but({"targets": (TargetOptions(north=north, east=east),)})


def fixes_of(mock: Simulation, settings: list[str]) -> tuple[Companion, list[GroundFix]]:
    """Every fix of a flight."""
    companion = Companion(settings, unix_minus_host_s=mock.unix_minus_host_s)
    localizer = companion.pipeline._components.camera._localizer
    locate, fixes = localizer.locate, []

    def kept(sighting):
        fix = locate(sighting)
        if sighting.frame >= 0 and isinstance(fix, GroundFix):
            fixes.append(fix)
        return fix

    localizer.locate = kept
    for _ in mock.drive(companion):
        pass
    return companion, fixes


def normalised_square(mock: Simulation, companion: Companion, fix: GroundFix) -> float:
    """Normalised square of the horizontal error; the companion fixed the world's origin."""
    origin = companion.pipeline._components.telemetry.world.plane.origin
    shift = mock.world.ned(Place(degrees(origin.lat), degrees(origin.lon), origin.alt_amsl_m))
    true = mock.scene[0].at(mock.flight_s(fix.sighting.host_ns))
    north, east = (fix.position_ned[k] - (true[k] - shift[k]) for k in (0, 1))
    (nn, ne, _), (_, ee, _), _ = fix.cov
    return (ee * north**2 - 2.0 * ne * north * east + nn * east**2) / (nn * ee - ne**2)


def square_of(name: str, seed: int) -> float | None:
    """The normalised square of one random fix; None where the flight had no fix."""
    rng = Random(f"{name}/{seed}")
    options = scenario(name, Options(seed=seed)).but(
        {"seconds": 6.0, "flight.start_phase_deg": rng.uniform(0.0, 360.0), **CLEAR}
    )
    mock = simulate(placed(options, rng))
    companion, fixes = fixes_of(mock, FLOWN[name])
    return normalised_square(mock, companion, rng.choice(fixes)) if fixes else None


def squares_of(name: str, flights: int) -> list[float]:
    """One normalised square a flight."""
    seeds = range(FIRST_SEED, FIRST_SEED + flights)
    squares = [kept(f"honesty/{name}/{seed}", partial(square_of, name, seed)) for seed in seeds]
    return [square for square in squares if square is not None]


FLOWN = {
    "default": [],
    "figure_eight": [],
    "nadir": ["ground.model=rangefinder"],
    "gimbal": ["camera.mount.gimbal_device_id=154", "camera.mount.pitch_deg=0.0"],
}


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("flights", draws_of(FEW, SOME, MANY))
@pytest.mark.parametrize("name", FLOWN)
def test_fixes_are_as_good_as_they_claim(name, flights):
    squares = squares_of(name, flights)
    n, total = len(squares), sum(squares)
    assert n >= 0.9 * flights
    low, high = chi2.ppf([0.0005, 0.9995], 2 * n)
    assert low < total < high, f"mean of {n} squares {total / n:.2f}, of 2 when honest"


def share_inside(flights: int) -> tuple[int, float]:
    """(number of draws, share of them inside the claimed 90 % ellipse)."""
    together = [square for name in FLOWN for square in squares_of(name, flights)]
    return len(together), sum(square < chi2.ppf(0.9, 2) for square in together) / len(together)


def test_a_claimed_ellipse_of_90_percent_holds_as_many_as_few_draws_can_show():
    n, share = share_inside(FEW)
    low, high = binom.ppf([0.0005, 0.9995], n, 0.9) / n
    assert low <= share <= high


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("flights", slow_of(SOME, MANY, few=1))
def test_a_claimed_ellipse_of_90_percent_holds_85_to_95_of_100(flights):
    _, share = share_inside(flights)
    assert 0.85 < share < 0.95
