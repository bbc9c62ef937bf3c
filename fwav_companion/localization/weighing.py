"""From columns of derivatives and the configured sigmas to covariances and the error budget.

What is vertical needs a word. On a level ground the target's ``down`` is the ground's own level: an error of the
camera's height moves the point along the ground, not up or down. What the level itself is worth, nothing tells but the
height's own sigmas: the ground may be uneven by the noise and lie wrong by the bias. So ``down`` gets both variances,
uncorrelated with north and east, the second one never averaged (:attr:`GroundFix.level_sigma_m`). An elevation model
has its own bias for that.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import sqrt

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3, add_matrices
from fwav_companion.localization.ground import Meeting
from fwav_companion.localization.propagation import Propagation
from fwav_companion.nouns import Bias, ErrorBudget, ErrorPriors, Sighting

NORTH, EAST = Bias.POSITION_NORTH, Bias.POSITION_EAST


class NoiseVariances(msgspec.Struct, frozen=True, gc=False):
    """Of one sighting, fresh in it."""

    pixel_u: float
    pixel_v: float
    attitude: float
    """Of roll, pitch and heading, by the configuration, rad^2."""
    bridging: float
    """Of rotation about any axis, by interpolation, rad^2."""
    height: float
    level: float
    time: float
    place: float


class Weights(msgspec.Struct, frozen=True, gc=False):
    """The covariances of a fix, m^2, NED, and its budget."""

    noise_cov: Matrix3
    cov: Matrix3
    relative_cov: Matrix3
    budget: ErrorBudget
    level_sigma_m: float


def noise_variances(sighting: Sighting, meeting: Meeting, priors: ErrorPriors) -> NoiseVariances:
    """What the configuration and the sighting itself say."""
    state, (sigma_u, sigma_v) = sighting.state, sighting.pixel_sigma
    age_variance = state.position_sigma_m**2
    height_noise_m = priors.height_noise_m if meeting.height_noise_m is None else meeting.height_noise_m
    return NoiseVariances(
        sigma_u * sigma_u,
        sigma_v * sigma_v,
        priors.attitude_noise**2,
        state.attitude_sigma**2,
        height_noise_m**2 + (0.0 if meeting.carried else age_variance),
        priors.height_noise_m**2,
        sighting.time_noise_s**2,
        priors.position_noise_m**2 + age_variance,
    )


def weigh(
    propagation: Propagation, noise: NoiseVariances, bias_variances: tuple[float, ...], surveyed: bool
) -> Weights:
    """Everything that is claimed about one fix."""
    biases = propagation.biases
    level_variance = 0.0 if surveyed else bias_variances[Bias.HEIGHT]
    of_place = _covariance(((biases[NORTH], noise.place), (biases[EAST], noise.place)))
    other_noise = _raised(
        _covariance(
            (
                (propagation.pixel_u, noise.pixel_u),
                (propagation.pixel_v, noise.pixel_v),
                (biases[Bias.ROLL], noise.attitude + noise.bridging),
                (biases[Bias.PITCH], noise.attitude + noise.bridging),
                (biases[Bias.MOUNT_Z], noise.bridging),
                (biases[Bias.HEADING], noise.attitude),
                (biases[Bias.HEIGHT], noise.height),
                (biases[Bias.TIME_OFFSET], noise.time),
            )
        ),
        noise.level,
    )
    place_bias = _covariance(((biases[NORTH], bias_variances[NORTH]), (biases[EAST], bias_variances[EAST])))
    other_bias = _covariance(
        (column, variance)
        for i, (column, variance) in enumerate(zip(biases, bias_variances, strict=True))
        if i not in (NORTH, EAST)
    )
    relative_cov = _raised(add_matrices(other_noise, other_bias), level_variance)
    return Weights(
        add_matrices(other_noise, of_place),
        add_matrices(relative_cov, add_matrices(of_place, place_bias)),
        relative_cov,
        _budget(propagation, noise, bias_variances),
        sqrt(level_variance),
    )


def _covariance(terms: Iterable[tuple[Vector3, float]]) -> Matrix3:
    """The sum of variance times column column^T."""
    nn = ne = nd = ee = ed = dd = 0.0
    for (n, e, d), variance in terms:
        if variance:
            wn, we = variance * n, variance * e
            nn += wn * n
            ne += wn * e
            nd += wn * d
            ee += we * e
            ed += we * d
            dd += variance * d * d
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def _raised(cov: Matrix3, variance: float) -> Matrix3:
    """With more variance of down."""
    north, east, (dn, de, dd) = cov
    return (north, east, (dn, de, dd + variance))


def _budget(propagation: Propagation, noise: NoiseVariances, bias: tuple[float, ...]) -> ErrorBudget:
    roll, pitch, heading, mount_x, mount_y, mount_z, time, readout, height, north, east, terrain = (
        n * n + e * e for n, e, _ in propagation.biases
    )
    (un, ue, _), (vn, ve, _) = propagation.pixel_u, propagation.pixel_v
    attitude = noise.attitude + noise.bridging
    return ErrorBudget(
        pixel=sqrt((un * un + ue * ue) * noise.pixel_u + (vn * vn + ve * ve) * noise.pixel_v),
        attitude=sqrt(
            roll * (bias[Bias.ROLL] + attitude) + pitch * (bias[Bias.PITCH] + attitude) + mount_z * noise.bridging
        ),
        heading=sqrt(heading * (bias[Bias.HEADING] + noise.attitude)),
        height=sqrt(height * (bias[Bias.HEIGHT] + noise.height)),
        time=sqrt(time * (bias[Bias.TIME_OFFSET] + noise.time) + readout * bias[Bias.READOUT]),
        mount=sqrt(mount_x * bias[Bias.MOUNT_X] + mount_y * bias[Bias.MOUNT_Y] + mount_z * bias[Bias.MOUNT_Z]),
        position=sqrt(north * (bias[NORTH] + noise.place) + east * (bias[EAST] + noise.place)),
        terrain=sqrt(terrain * bias[Bias.TERRAIN]),
    )
