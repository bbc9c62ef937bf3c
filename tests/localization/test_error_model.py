"""Every term of the error model is needed: a claim without it holds fewer truths than it says.

One flight a draw: biases and noise from the priors, one fix, its error against its claim. In each case one source of
error is made the largest; the claim that knows of all sources holds 95 % of the truths within two-sided bounds of
99.9 %, and the claim that leaves out this one falls below the lower bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.stats import binom, chi2
from true_flights import PRIORS, Scene

from fwav_companion.localization import Datum, HomeGround, Localizer, RangefinderGround, TerrainGround
from fwav_companion.types import BIAS_COUNT, Bias, ErrorPriors, GroundFix, Sighting

LARGEST_M = 0.3
"""Horizontal error by the source in question, one sigma: three times all others together. All errors are small enough
to be linear: 1 m by the mount's turn about the optical axis would be 10 degrees here, and curved."""
SMALL = 0.03
"""Of the usual sigmas: the other sources."""
LEVEL = 0.95
SQUARE = chi2.ppf(LEVEL, 2)
SCENE = Scene(
    pixel_sigma=(0.1, 0.15), bridging_sigma=6e-5, time_noise_s=6e-5, position_sigma_m=0.0015, beam=(0.0, 0.0, 1.0)
)
RANGE_NOISE_M = 0.006
TERRAIN_M = 0.03


@dataclass
class Errors:
    """One sigma of everything that errs; the truth is drawn by one of these, a claim is made by another."""

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
    """By the autopilot's report of the terrain."""
    priors = errors.of_bias(Bias.TERRAIN, errors.terrain_m).priors
    return Localizer(TerrainGround(None, Datum.EGM96), priors, min_height_m=0.5)


@dataclass
class Source:
    """A source of error: ``of(errors, sigma)`` gives it this sigma; ``ground`` is what it errs over."""

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
    """What reaches the localizer on one flight."""
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
    """The same sighting with the sigmas that the claim knows of."""
    scene = errors.scene
    state = msgspec.structs.replace(
        sighting.state, attitude_sigma=scene.bridging_sigma, position_sigma_m=scene.position_sigma_m
    )
    return msgspec.structs.replace(
        sighting, state=state, pixel_sigma=scene.pixel_sigma, time_noise_s=scene.time_noise_s
    )


def largest(source: Source) -> Errors:
    """The usual errors with this source raised until its own horizontal error is what it should be."""
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
    """How many truths lie within the 95 % ellipse of the full claim, and of the one that leaves out the source."""
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
def test_without_any_one_term_fewer_truths_are_held_than_claimed(source):
    check(source, 300)


@pytest.mark.slow
@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_over_many_flights_every_claim_holds_as_many_truths_as_it_says(source):
    check(source, 2000)
