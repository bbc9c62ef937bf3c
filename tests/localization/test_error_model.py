"""Coverage of the error model: dropping any one of its terms lowers coverage below its bound.

Each draw is one flight with one fix, its biases and noise drawn from the priors. In each case one source of error is
made the largest. The 95 % ellipse of the full model must contain the truth within two-sided 99.9 % bounds; the ellipse
of the model without this source must fall below the lower bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import msgspec
import numpy as np
import pytest
from draws import slow_of
from scipy.stats import binom, chi2
from true_flights import PRIORS, Scene

from fwav_companion.localization import Datum, HomeGround, Localizer, RangefinderGround, TerrainGround
from fwav_companion.types import BIAS_COUNT, Bias, ErrorPriors, GroundFix, Sighting

LARGEST_M = 0.3
"""Horizontal error by the source in question, one sigma, metres: three times all others together. All errors are small
enough to be linear: 1 m by the mount's rotation about the optical axis would be 10 degrees, which is not."""
SMALL = 0.03
"""Factor of the usual sigmas for the other sources."""
LEVEL = 0.95
SQUARE = chi2.ppf(LEVEL, 2)
SCENE = Scene(
    pixel_sigma=(0.1, 0.15),
    bridging_sigma=6e-5,
    time_noise_s=6e-5,
    position_sigma_m=0.0015,
    beam=(0.0, 0.0, 1.0),
    rises=(0.8, 0.1),
)
RANGE_NOISE_M = 0.006
TERRAIN_M = 0.03


@dataclass
class Errors:
    """One sigma of each source; the truth is drawn with one of these, the model claims another."""

    priors: ErrorPriors
    scene: Scene = field(default_factory=lambda: SCENE)
    range_m: float = RANGE_NOISE_M
    terrain_m: float = TERRAIN_M

    def of_bias(self, bias: Bias, sigma: float) -> Errors:
        sigmas = tuple(sigma if each is bias else old for each, old in zip(Bias, self.priors.bias_sigmas, strict=True))
        return replace(self, priors=msgspec.structs.replace(self.priors, bias_sigmas=sigmas))

    def of_prior(self, **sigmas: float) -> Errors:
        return replace(self, priors=msgspec.structs.replace(self.priors, **sigmas))

    def of_scene(self, **sigmas: Any) -> Errors:
        return replace(self, scene=replace(self.scene, **sigmas))


USUAL = Errors(
    msgspec.structs.replace(
        PRIORS,
        attitude_noise=SMALL * PRIORS.attitude_noise,
        position_noise_m=SMALL * PRIORS.position_noise_m,
        height_noise_m=SMALL * PRIORS.height_noise_m,
        bias_sigmas=tuple(0.0 if bias is Bias.TERRAIN else SMALL * PRIORS.sigma(bias) for bias in Bias),
    )
)


def home(errors: Errors) -> Localizer:
    return Localizer(HomeGround(), errors.priors, min_height_m=0.5)


def rangefinder(errors: Errors) -> Localizer:
    return Localizer(RangefinderGround(errors.range_m), errors.priors, min_height_m=0.5)


def terrain(errors: Errors) -> Localizer:
    """A localizer on the terrain that the autopilot reports."""
    priors = errors.of_bias(Bias.TERRAIN, errors.terrain_m).priors
    return Localizer(TerrainGround(None, Datum.EGM96), priors, min_height_m=0.5)


@dataclass
class Source:
    """A source of error: ``of(errors, sigma)`` sets its sigma, ``ground`` makes the localizer."""

    of: Callable[[Errors, float], Errors]
    ground: Callable[[Errors], Localizer] = home


SOURCES = {
    **{
        bias.name.lower(): Source(lambda errors, sigma, bias=bias: errors.of_bias(bias, sigma))
        for bias in Bias
        if bias is not Bias.TERRAIN
    },
    "terrain": Source(lambda errors, sigma: replace(errors, terrain_m=sigma), terrain),
    "pixel u": Source(lambda errors, sigma: errors.of_scene(pixel_sigma=(sigma, errors.scene.pixel_sigma[1]))),
    "pixel v": Source(lambda errors, sigma: errors.of_scene(pixel_sigma=(errors.scene.pixel_sigma[0], sigma))),
    "attitude noise": Source(lambda errors, sigma: errors.of_prior(attitude_noise=sigma)),
    "bridging": Source(lambda errors, sigma: errors.of_scene(bridging_sigma=sigma)),
    "time noise": Source(lambda errors, sigma: errors.of_scene(time_noise_s=sigma)),
    "position noise": Source(lambda errors, sigma: errors.of_prior(position_noise_m=sigma)),
    "age of the position": Source(lambda errors, sigma: errors.of_scene(position_sigma_m=sigma)),
    "height noise": Source(lambda errors, sigma: errors.of_prior(height_noise_m=sigma)),
    "range noise": Source(lambda errors, sigma: replace(errors, range_m=sigma), rangefinder),
    "roll, by a beam": Source(lambda errors, sigma: errors.of_bias(Bias.ROLL, sigma), rangefinder),
    "mount, by a beam": Source(lambda errors, sigma: errors.of_bias(Bias.MOUNT_X, sigma), rangefinder),
}


def drawn(errors: Errors, rng: np.random.Generator) -> Sighting:
    """The sighting of one flight."""
    sighting = errors.scene.sighting(*errors.scene.draw(rng, errors.priors))
    reading = sighting.state.range
    off_m = rng.normal() * errors.range_m
    state = msgspec.structs.replace(
        sighting.state,
        range=msgspec.structs.replace(reading, distance_m=reading.distance_m + off_m),
        terrain_height_m=errors.scene.height_m - rng.normal() * errors.terrain_m,
    )
    return msgspec.structs.replace(sighting, state=state)


def claimed_by(errors: Errors, sighting: Sighting) -> Sighting:
    """The same sighting with the sigmas of the claim."""
    scene = errors.scene
    state = msgspec.structs.replace(
        sighting.state, attitude_sigma=scene.bridging_sigma, position_sigma_m=scene.position_sigma_m
    )
    return msgspec.structs.replace(
        sighting, state=state, pixel_sigma=scene.pixel_sigma, time_noise_s=scene.time_noise_s
    )


def largest(source: Source) -> Errors:
    """The usual errors with this source scaled to a horizontal error of LARGEST_M."""
    nothing = Errors(
        msgspec.structs.replace(
            PRIORS, attitude_noise=0.0, position_noise_m=0.0, height_noise_m=0.0, bias_sigmas=(0.0,) * BIAS_COUNT
        ),
        replace(SCENE, pixel_sigma=(0.0, 0.0), bridging_sigma=0.0, time_noise_s=0.0, position_sigma_m=0.0),
        range_m=0.0,
        terrain_m=0.0,
    )
    sigma, truth = 1e-5, SCENE.truth()[:2]
    rng = np.random.default_rng(5)
    errors = source.of(nothing, sigma)
    off = [np.subtract(source.ground(nothing).locate(drawn(errors, rng)).position_ned[:2], truth) for _ in range(100)]
    return source.of(USUAL, sigma * LARGEST_M / float(np.sqrt(np.mean(np.square(off).sum(axis=1)))))


def held(source: Source, flights: int) -> tuple[int, int]:
    """The number of truths in the 95 % ellipse of the full model, and of the model without the source."""
    errors, rng = largest(source), np.random.default_rng(17)
    less = source.of(errors, 0.0)
    full, lean = source.ground(errors), source.ground(less)
    inside = [0, 0]
    for _ in range(flights):
        sighting = drawn(errors, rng)
        for index, (localizer, knows) in enumerate(((full, errors), (lean, less))):
            fix = localizer.locate(claimed_by(knows, sighting))
            assert isinstance(fix, GroundFix)
            error = np.subtract(fix.position_ned, SCENE.truth())[:2]
            inside[index] += error @ np.linalg.solve(np.array(fix.cov)[:2, :2], error) < SQUARE
    return inside[0], inside[1]


def check(source: Source, flights: int) -> None:
    low, high = binom.ppf([0.0005, 0.9995], flights, LEVEL)
    full, lean = held(source, flights)
    assert low <= full <= high
    assert lean < low


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_dropping_any_one_term_lowers_coverage_below_its_bound(source):
    check(source, 150)


@pytest.mark.parametrize("flights", slow_of(500, 2000, few=1))
@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_dropping_any_one_term_lowers_coverage_below_its_bound_over_many_flights(source, flights):
    """Of 150 claims of twice the error the truth may be in all, as in 150 honest ones; of 500 honest ones it is not."""
    check(source, flights)
