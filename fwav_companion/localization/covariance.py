"""Covariances and error budget of a fix from the columns of its Jacobian and the configured sigmas.

In numpy, with the columns N and variances q of the noise, and the columns B and variances b of the biases::

    noise_cov    = N @ diag(q) @ N.T + diag(0, 0, level_noise**2)
    cov          = noise_cov + B @ diag(b) @ B.T + diag(0, 0, level_sigma**2)
    relative_cov = cov without the columns of the vehicle's position, noise and bias

tests/benchmarks/naive_fix.py has them in this form, and tests/localization compare them with differences and draws.

Vertical errors: on level ground ``down`` is the level of the ground. An error of the camera's height moves the point
along the ground, not up or down. The only known sigmas of the level itself are those of the height: the ground may be
uneven by the noise and wrong by the bias. So ``down`` gets both variances, uncorrelated with north and east; the second
one does not average out (:attr:`GroundFix.level_sigma_m`). An elevation model has a bias of its own instead.
"""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add_matrices
from fwav_companion.localization.ground import Intersection
from fwav_companion.localization.propagation import Propagation
from fwav_companion.types import Bias, ErrorBudget, ErrorPriors, Sighting

Terms: TypeAlias = tuple[tuple[Vector3, float], ...]
"""Columns of the Jacobian with the variance of their error."""


class BiasVariances(msgspec.Struct, frozen=True, gc=False):
    """Variances of the biases, by name: attribute access is three times as fast as an index by an enumeration."""

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
    position_delay: float
    lever_x: float
    lever_y: float
    lever_z: float
    target_height: float


def bias_variances(priors: ErrorPriors) -> BiasVariances:
    """The variances of the configured biases."""
    return BiasVariances(*(priors.sigma(bias) ** 2 for bias in Bias))


class NoiseVariances(msgspec.Struct, frozen=True, gc=False):
    """Variances of the errors of one sighting that are independent in every sighting."""

    pixel_u: float
    pixel_v: float
    attitude: float
    """Variance of roll, of pitch and of heading by the configuration, rad^2."""
    bridging: float
    """Variance of the rotation about each axis by interpolation, rad^2."""
    height: float
    """Variance of the camera's height, m^2."""
    level: float
    """Variance of the ground's level, m^2."""
    time: float
    """Variance of the capture on the autopilot clock, s^2."""
    place: float
    """Variance of the vehicle's position, each axis, m^2."""
    readout_share: float
    """Square of d(capture)/d(readout): the part of the readout's variance in the capture's."""


def noise_variances(sighting: Sighting, meeting: Intersection, priors: ErrorPriors) -> NoiseVariances:
    """The noise variances by the configuration and by the sighting."""
    state, (sigma_u, sigma_v) = sighting.state, sighting.pixel_sigma
    age_variance = state.position_sigma_m**2
    height_sigma_m = state.position_sigma_m if state.height_sigma_m is None else state.height_sigma_m
    height_noise_m = priors.height_noise_m if meeting.height_noise_m is None else meeting.height_noise_m
    return NoiseVariances(
        pixel_u=sigma_u * sigma_u,
        pixel_v=sigma_v * sigma_v,
        attitude=priors.attitude_noise**2,
        bridging=state.carrier_sigma**2,
        height=height_noise_m**2 + (0.0 if meeting.moves_with_camera else height_sigma_m**2),
        level=priors.height_noise_m**2,
        time=sighting.time_noise_s**2,
        place=priors.position_noise_m**2 + age_variance,
        readout_share=sighting.row_fraction**2,
    )


class ErrorModel:
    """Covariances of one fix, NED, m^2, and its error budget. All but ``noise_cov`` are computed on first access."""

    __slots__ = (
        "_bias",
        "_budget",
        "_cov",
        "_meeting",
        "_noise",
        "_propagation",
        "noise_cov",
    )

    def __init__(
        self, propagation: Propagation, noise: NoiseVariances, bias: BiasVariances, meeting: Intersection
    ) -> None:
        self._propagation, self._noise, self._bias, self._meeting = propagation, noise, bias, meeting
        terms = (*_noise_terms(propagation, noise), *_place_noise_terms(propagation, noise.place))
        self.noise_cov = self._covariance(terms, noise.level)
        """Covariance of the errors that are independent in every fix."""
        self._cov: Matrix3 | None = None
        self._budget: ErrorBudget | None = None

    @property
    def level_sigma_m(self) -> float:
        """One sigma of the ground's level, metres."""
        return sqrt(self._level_variance)

    @property
    def cov(self) -> Matrix3:
        """Total covariance."""
        if self._cov is None:
            self._cov = self._with_biases(_place_bias_terms(self._propagation, self._bias))
        return self._cov

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance without the errors of the vehicle's position: without its biases, and minus its noise."""
        return self._with_biases(_place_noise_terms(self._propagation, -self._noise.place))

    def _with_biases(self, more: Terms) -> Matrix3:
        """Covariance of the noise, of all biases except those of the vehicle's position, and of the terms ``more``."""
        terms = _bias_terms(self._propagation, self._noise, self._bias, self._meeting)
        return add_matrices(self.noise_cov, self._covariance((*terms, *more), self._level_variance))

    @property
    def budget(self) -> ErrorBudget:
        """The error budget."""
        if self._budget is None:
            self._budget = _budget(self._propagation, self._noise, self._bias)
        return self._budget

    def __eq__(self, other: object) -> bool:
        """Whether the covariances are equal."""
        if not isinstance(other, ErrorModel):
            return NotImplemented
        return (self.noise_cov, self.cov, self.relative_cov) == (other.noise_cov, other.cov, other.relative_cov)

    def __hash__(self) -> int:
        """Hash of the noise."""
        return hash(self.noise_cov)

    @property
    def _level_variance(self) -> float:
        return 0.0 if self._meeting.surveyed else self._bias.height

    def _covariance(self, terms: Terms, level_m2: float) -> Matrix3:
        meeting = self._meeting
        level = not (meeting.surveyed or meeting.moves_with_camera or meeting.uneven)
        return _level_covariance(terms, level_m2) if level else _covariance(terms, level_m2)


def _noise_terms(propagation: Propagation, noise: NoiseVariances) -> Terms:
    """The terms of the noise without the vehicle's position; errors with the same column are one term."""
    roll, pitch, heading, _, _, mount_z, time, _, height, *_ = propagation.biases
    attitude = noise.attitude + noise.bridging
    return (
        (propagation.pixel_u, noise.pixel_u),
        (propagation.pixel_v, noise.pixel_v),
        (roll, attitude),
        (pitch, attitude),
        (mount_z, noise.bridging),
        (heading, noise.attitude),
        (height, noise.height),
        (time, noise.time),
    )


def _bias_terms(propagation: Propagation, noise: NoiseVariances, bias: BiasVariances, meeting: Intersection) -> Terms:
    """The terms of the biases without the vehicle's position; errors with the same column are one term."""
    roll, pitch, heading, mount_x, mount_y, mount_z, time, _, height, _, _, terrain, _, *lever = propagation.biases
    *lever, target_height = lever
    of_biases: Terms = (
        (mount_x, bias.mount_x + bias.roll),
        (mount_y, bias.mount_y + bias.pitch),
        (mount_z, bias.mount_z),
        (heading, bias.heading),
        (time, bias.time_offset + noise.readout_share * bias.readout),
        (height, bias.height),
        (lever[0], bias.lever_x),
        (lever[1], bias.lever_y),
        (lever[2], bias.lever_z),
    )
    if meeting.height_by_rotation is not ZERO3:  # attitude and mount then have different columns
        turns = ((mount_x, bias.mount_x), (mount_y, bias.mount_y), (roll, bias.roll), (pitch, bias.pitch))
        of_biases = (*turns, *of_biases[2:])
    if target_height is not ZERO3:
        of_biases = (*of_biases, (target_height, bias.target_height))
    surveyed = meeting.surveyed or meeting.uneven
    return (*of_biases, (terrain, bias.terrain)) if surveyed else of_biases


def _place_noise_terms(propagation: Propagation, variance: float) -> Terms:
    """The terms of the noise of the vehicle's position."""
    _, _, _, _, _, _, _, _, _, north, east, *_ = propagation.biases
    return ((north, variance), (east, variance))


def _place_bias_terms(propagation: Propagation, bias: BiasVariances) -> Terms:
    """The terms of the biases of the vehicle's position and of its age."""
    _, _, _, _, _, _, _, _, _, north, east, _, delay, *_ = propagation.biases
    return ((north, bias.north), (east, bias.east), (delay, bias.position_delay))


def _covariance(terms: Terms, level_m2: float) -> Matrix3:
    """The sum of variance times column column^T over the terms, and the variance of the ground's level."""
    nn = ne = nd = ee = ed = 0.0
    dd = level_m2
    for (n, e, d), variance in terms:
        wn, we = variance * n, variance * e
        nn += wn * n
        ne += wn * e
        nd += wn * d
        ee += we * e
        ed += we * d
        dd += variance * d * d
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def _level_covariance(terms: Terms, level_m2: float) -> Matrix3:
    """``_covariance`` for columns without a down component: twice as fast, and the case of nearly every fix."""
    nn = ne = ee = 0.0
    for (n, e, _), variance in terms:
        w = variance * n
        nn += w * n
        ne += w * e
        ee += variance * e * e
    return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, level_m2))


def _budget(propagation: Propagation, noise: NoiseVariances, bias: BiasVariances) -> ErrorBudget:
    roll, pitch, heading, mount_x, mount_y, mount_z, time, _, height, _, _, terrain, _, *lever = propagation.biases
    *lever, target_height = lever
    attitude = noise.attitude + noise.bridging
    places = (*_place_noise_terms(propagation, noise.place), *_place_bias_terms(propagation, bias))
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
        mount=sqrt(
            _flat(mount_x) * bias.mount_x
            + _flat(mount_y) * bias.mount_y
            + _flat(mount_z) * bias.mount_z
            + _flat(lever[0]) * bias.lever_x
            + _flat(lever[1]) * bias.lever_y
            + _flat(lever[2]) * bias.lever_z
        ),
        position=sqrt(sum(_flat(column) * variance for column, variance in places)),
        terrain=sqrt(_flat(terrain) * bias.terrain),
        target=sqrt(_flat(target_height) * bias.target_height) or None,
    )


def _flat(column: Vector3) -> float:
    """The squared horizontal length of a column."""
    return column[0] * column[0] + column[1] * column[1]
