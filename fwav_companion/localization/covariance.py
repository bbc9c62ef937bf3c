"""From columns of derivatives and the configured sigmas to covariances and the error budget.

What is vertical needs a word. On a level ground the target's ``down`` is the ground's own level: an error of the
camera's height moves the point along the ground, not up or down. What the level itself is worth, nothing tells but the
height's own sigmas: the ground may be uneven by the noise and lie wrong by the bias. So ``down`` gets both variances,
uncorrelated with north and east, the second one never averaged (:attr:`GroundFix.level_sigma_m`). An elevation model
has its own bias for that.
"""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add_matrices
from fwav_companion.localization.ground import Intersection
from fwav_companion.localization.propagation import ALONG, Propagation
from fwav_companion.types import Bias, ErrorBudget, ErrorPriors, Sighting

Terms: TypeAlias = tuple[tuple[Vector3, float], ...]
"""Columns with the variance of their error."""


class BiasVariances(msgspec.Struct, frozen=True, gc=False):
    """Squares of [uncertainty]'s biases, by name: a name is found three times as fast as a place by an enumeration."""

    roll: float
    pitch: float
    heading: float
    mount_x: float
    mount_y: float
    mount_z: float
    time_offset: float
    readout: float
    height: float
    north: float
    east: float
    terrain: float


def bias_variances(priors: ErrorPriors) -> BiasVariances:
    """Of the configuration."""
    return BiasVariances(*(priors.sigma(bias) ** 2 for bias in Bias))


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
    readout_share: float
    """Square of d(capture)/d(readout): of the readout's variance, how much is the capture's."""


class Weights(msgspec.Struct, frozen=True, gc=False):
    """The covariances of a fix, m^2, NED, and its budget."""

    noise_cov: Matrix3
    cov: Matrix3
    relative_cov: Matrix3
    budget: ErrorBudget
    level_sigma_m: float


def noise_variances(sighting: Sighting, meeting: Intersection, priors: ErrorPriors) -> NoiseVariances:
    """What the configuration and the sighting itself say."""
    state, (sigma_u, sigma_v) = sighting.state, sighting.pixel_sigma
    age_variance = state.position_sigma_m**2
    height_noise_m = priors.height_noise_m if meeting.height_noise_m is None else meeting.height_noise_m
    return NoiseVariances(
        sigma_u * sigma_u,
        sigma_v * sigma_v,
        priors.attitude_noise**2,
        state.carrier_sigma**2,
        height_noise_m**2 + (0.0 if meeting.carried else age_variance),
        priors.height_noise_m**2,
        sighting.time_noise_s**2,
        priors.position_noise_m**2 + age_variance,
        sighting.row_fraction**2,
    )


def fix_covariance(
    propagation: Propagation, noise: NoiseVariances, bias: BiasVariances, meeting: Intersection
) -> Weights:
    """Everything that is claimed about one fix."""
    covariance = _covariance if meeting.surveyed or meeting.carried else _level_covariance
    of_noise, of_biases = _terms(propagation, noise, bias, meeting)
    place_noise, place_bias = _of_place(propagation, noise, bias)
    fresh = _raised(covariance(of_noise), noise.level)
    level_variance = 0.0 if meeting.surveyed else bias.height
    relative_cov = _raised(add_matrices(fresh, covariance(of_biases)), level_variance)
    return Weights(
        add_matrices(fresh, place_noise),
        add_matrices(relative_cov, add_matrices(place_noise, place_bias)),
        relative_cov,
        _budget(propagation, noise, bias, (place_noise, place_bias)),
        sqrt(level_variance),
    )


def _terms(
    propagation: Propagation, noise: NoiseVariances, bias: BiasVariances, meeting: Intersection
) -> tuple[Terms, Terms]:
    """Of noise and of biases, all but the vehicle's place. What moves the point alike is one term."""
    roll, pitch, heading, mount_x, mount_y, mount_z, time, _, height, _, _, terrain = propagation.biases
    attitude = noise.attitude + noise.bridging
    of_noise = (
        (propagation.pixel_u, noise.pixel_u),
        (propagation.pixel_v, noise.pixel_v),
        (roll, attitude),
        (pitch, attitude),
        (mount_z, noise.bridging),
        (heading, noise.attitude),
        (height, noise.height),
        (time, noise.time),
    )
    of_biases: Terms = (
        (mount_x, bias.mount_x + bias.roll),
        (mount_y, bias.mount_y + bias.pitch),
        (mount_z, bias.mount_z),
        (heading, bias.heading),
        (time, bias.time_offset + noise.readout_share * bias.readout),
        (height, bias.height),
    )
    if meeting.height_by_rotation is not ZERO3:  # the vehicle's turn moves the point otherwise than the mount's
        turns = ((mount_x, bias.mount_x), (mount_y, bias.mount_y), (roll, bias.roll), (pitch, bias.pitch))
        of_biases = (*turns, *of_biases[2:])
    if meeting.surveyed:
        of_biases = (*of_biases, (terrain, bias.terrain))
    return of_noise, of_biases


def _of_place(propagation: Propagation, noise: NoiseVariances, bias: BiasVariances) -> tuple[Matrix3, Matrix3]:
    """Noise and bias of the vehicle's place; on level ground the point moves as the vehicle does."""
    *_, north, east, _ = propagation.biases
    if (north, east) == ALONG:
        return _diagonal(noise.place, noise.place), _diagonal(bias.north, bias.east)
    return (
        _covariance(((north, noise.place), (east, noise.place))),
        _covariance(((north, bias.north), (east, bias.east))),
    )


def _diagonal(nn: float, ee: float) -> Matrix3:
    return ((nn, 0.0, 0.0), (0.0, ee, 0.0), ZERO3)


def _covariance(terms: Terms) -> Matrix3:
    """The sum of variance times column column^T."""
    nn = ne = nd = ee = ed = dd = 0.0
    for (n, e, d), variance in terms:
        wn, we = variance * n, variance * e
        nn += wn * n
        ne += wn * e
        nd += wn * d
        ee += we * e
        ed += we * d
        dd += variance * d * d
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def _level_covariance(terms: Terms) -> Matrix3:
    """The same where nothing moves the point up or down: twice as fast, and the way of nearly every fix."""
    nn = ne = ee = 0.0
    for (n, e, _), variance in terms:
        w = variance * n
        nn += w * n
        ne += w * e
        ee += variance * e * e
    return ((nn, ne, 0.0), (ne, ee, 0.0), ZERO3)


def _raised(cov: Matrix3, variance: float) -> Matrix3:
    """With more variance of down."""
    north, east, (dn, de, dd) = cov
    return (north, east, (dn, de, dd + variance))


def _budget(
    propagation: Propagation, noise: NoiseVariances, bias: BiasVariances, places: tuple[Matrix3, Matrix3]
) -> ErrorBudget:
    roll, pitch, heading, mount_x, mount_y, mount_z, time, _, height, _, _, terrain = propagation.biases
    attitude = noise.attitude + noise.bridging
    return ErrorBudget(
        pixel=sqrt(_flat(propagation.pixel_u) * noise.pixel_u + _flat(propagation.pixel_v) * noise.pixel_v),
        attitude=sqrt(
            _flat(roll) * (bias.roll + attitude)
            + _flat(pitch) * (bias.pitch + attitude)
            + _flat(mount_z) * noise.bridging
        ),
        heading=sqrt(_flat(heading) * (bias.heading + noise.attitude)),
        height=sqrt(_flat(height) * (bias.height + noise.height)),
        time=sqrt(_flat(time) * (bias.time_offset + noise.readout_share * bias.readout + noise.time)),
        mount=sqrt(_flat(mount_x) * bias.mount_x + _flat(mount_y) * bias.mount_y + _flat(mount_z) * bias.mount_z),
        position=sqrt(sum(cov[0][0] + cov[1][1] for cov in places)),
        terrain=sqrt(_flat(terrain) * bias.terrain),
    )


def _flat(column: Vector3) -> float:
    """The square of a column's horizontal length."""
    return column[0] * column[0] + column[1] * column[1]
