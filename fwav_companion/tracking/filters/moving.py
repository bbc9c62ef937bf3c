"""Schmidt-Kalman filter of a target that moves at nearly constant velocity.

The state is position and velocity. Both carry their covariance with the biases (``schmidt_kalman``), so the covariance
of the velocity, too, includes a constant time offset and a wandering position. The gain is computed from the noise.
"""

from __future__ import annotations

from typing import TypeAlias

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import add_diagonal, inner, minus, scaled, symmetric_inverse, symmetrized
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import (
    ZERO3,
    ZERO33,
    Matrix3,
    Vector3,
    add,
    add_matrices,
    multiply,
    scale,
    subtract,
    transform,
    transpose,
)
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases, Measurement, Rows
from fwav_companion.tracking.filters.gate_results import gate_results
from fwav_companion.tracking.filters.maneuver import LAGS, TURNED, ManeuverLag
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, scattered
from fwav_companion.types import ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult

START_SPEED_M_S = 3.0
"""One sigma of each horizontal axis of an unknown velocity, m/s: people, animals, vehicles on a field."""
START_CLIMB_M_S = 0.3
"""One sigma of an unknown vertical velocity, m/s: targets are on the ground."""

ACCELERATION_DENSITY = 0.03
"""Spectral density of the white horizontal acceleration, m^2/s^3: at 30 fixes/s of 0.1 m the velocity settles at
0.13 m/s one sigma, and the estimate lags by 0.1 m behind a walker who turns around within two seconds."""
UNSEEN_DENSITY = 0.5
"""The same for a target without a fix for UNSEEN_S, which may have turned around: one sigma is 13 m after ten
seconds. A walker who turned is 30 m from the predicted place by then."""
UNSEEN_S = 1.0
LEAST_TURN_S = 0.02
"""Least duration of a turn: one frame of a fast camera."""
CLIMB_DENSITY = 0.0003
"""Spectral density of the vertical acceleration, m^2/s^3."""


class MovingTargetState(msgspec.Struct, frozen=True, kw_only=True):
    """Position and velocity, the covariances of their noise, and their covariances with the biases."""

    errors: ConsiderBiases
    position_ned: Vector3
    velocity_ned: Vector3
    noise: Matrix3
    """Covariance of the position by noise and unknown acceleration, m^2."""
    cross: Matrix3
    """Covariance of position and velocity, m^2/s."""
    velocity_noise: Matrix3
    shared: Rows
    """cov(position error, b / sigma), metres."""
    velocity_shared: Rows
    scatter: AdaptiveNoise = AdaptiveNoise()
    """Scatter of single fixes beyond their noise."""
    lag: ManeuverLag = ManeuverLag()
    """Running mean of the innovations, which shows a turn."""
    host_ns: HostNs
    fixed_ns: HostNs

    @property
    def cov(self) -> Matrix3:
        """Covariance of the position by all errors, NED, m^2. Older errors of the vehicle's position are not kept."""
        return _with_biases(self._lagging, self.shared, self.errors.count)

    @property
    def apparent_ned(self) -> Vector3:
        """The position itself: the present error of the vehicle's position is not estimated."""
        return self.position_ned

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the position without the error of the vehicle's position, NED, m^2."""
        return _with_biases(self._lagging, self.shared, self.errors.wandering)

    @property
    def _lagging(self) -> Matrix3:
        """Covariance of the position by noise, and by a turn that is not detected yet, m^2."""
        return add_matrices(self.noise, scaled(self.lag.position_cov, LAGS))

    @property
    def velocity_cov(self) -> Matrix3:
        """Covariance of the velocity, NED, (m/s)^2."""
        return _with_biases(self.velocity_noise, self.velocity_shared, self.errors.count)

    def predict(self, host_ns: HostNs) -> MovingTargetState:
        """The state at a later instant: moved by its velocity, with process noise of the unknown acceleration."""
        dt = s_from_ns(host_ns - self.host_ns)
        if dt <= 0.0:
            return self
        density = ACCELERATION_DENSITY if s_from_ns(host_ns - self.fixed_ns) < UNSEEN_S else UNSEEN_DENSITY
        cross = add_matrices(self.cross, scaled(self.velocity_noise, dt))
        noise = add_matrices(self.noise, scaled(add_matrices(cross, transpose(self.cross)), dt))
        return replace(
            self,
            position_ned=add(self.position_ned, scale(self.velocity_ned, dt)),
            noise=_accelerated(noise, density, dt**3 / 3.0),
            cross=_accelerated(cross, density, dt * dt / 2.0),
            velocity_noise=_accelerated(self.velocity_noise, density, dt),
            shared=_plus(self.shared, self.velocity_shared, dt),
            host_ns=host_ns,
        )

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant, horizontal; the gate is wider where the target lags."""
        place = self._place(add_matrices(self.noise, self.lag.position_cov))
        return gate_results(place, self.scatter, (self.errors.prepared(fix),), self.errors.timed)[0]

    def update(self, fix: GroundFix) -> MovingTargetState:
        """The state after a fix, by the gain of least noise and observed scatter; a turn inflates the covariance."""
        host_ns = fix.sighting.frame_host_ns
        since_s = s_from_ns(host_ns - self.fixed_ns)
        measurement = self.errors.decorrelated(fix, since_s, self.position_ned)
        north_m, east_m, _ = subtract(measurement.position, self.position_ned)
        (nn, ne, _), (_, ee, _), _ = self._expected(measurement.noise)
        lag = self.lag.with_clipped(north_m, east_m, since_s, (nn, ne, ee))
        if lag.is_turn((nn, ne, ee), TURNED):
            return self._turned(lag)._updated(measurement, ManeuverLag(), host_ns)
        return self._updated(measurement, lag, host_ns)

    def _expected(self, noise: Matrix3) -> Matrix3:
        """Covariance of the innovation of a fix with this noise."""
        return add_diagonal(add_matrices(self.noise, noise), self.scatter.variance, 0.0)

    def _turned(self, lag: ManeuverLag) -> MovingTargetState:
        """The state with the covariance of a target that turned ``lag.back_s`` ago."""
        off, per_s = lag.position_cov, 1.0 / max(lag.back_s, LEAST_TURN_S)
        return replace(
            self,
            noise=add_matrices(self.noise, off),
            cross=add_matrices(self.cross, scaled(off, per_s)),
            velocity_noise=add_matrices(self.velocity_noise, scaled(off, per_s * per_s)),
        )

    def _updated(self, measurement: Measurement, lag: ManeuverLag, host_ns: HostNs) -> MovingTargetState:
        """The state after a measurement: gains K = P inv(S) and L = C' inv(S), with the observed scatter in S.

        C is ``cross``. The covariances are updated in Joseph form by blocks, which holds for any gain.
        """
        inverse = symmetric_inverse(self._expected(measurement.noise))
        gain, velocity_gain = multiply(self.noise, inverse), multiply(transpose(self.cross), inverse)
        seen = add_matrices(self.noise, measurement.noise)
        difference = subtract(measurement.position, self.position_ned)
        off = _plus(measurement.shared, self.shared, -1.0)
        of_place, of_velocity = (gain, self.noise), (velocity_gain, self.cross)
        return replace(
            self,
            position_ned=add(self.position_ned, transform(gain, difference)),
            velocity_ned=add(self.velocity_ned, transform(velocity_gain, difference)),
            noise=symmetrized(_blended(self.noise, of_place, of_place, seen)),
            cross=_blended(self.cross, of_place, of_velocity, seen),
            velocity_noise=symmetrized(_blended(self.velocity_noise, of_velocity, of_velocity, seen)),
            shared=_corrected(self.shared, gain, off),
            velocity_shared=_corrected(self.velocity_shared, velocity_gain, off),
            scatter=scattered(self._place(self.noise), self.scatter, measurement, self.errors.timed),
            lag=lag,
            fixed_ns=host_ns,
        )

    def _place(self, noise: Matrix3) -> PointEstimate:
        (nn, ne, _), (_, ee, _), _ = noise
        return PointEstimate(self.position_ned[0], self.position_ned[1], (nn, ne, ee), self.shared[:2])


class MovingKalman:
    """Initiates moving targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = ConsiderBiases(priors)

    def initiate(self, fix: GroundFix) -> MovingTargetState:
        """The state after the first fix: at its position, with any walking or driving speed in the covariance."""
        host_ns, measurement = fix.sighting.frame_host_ns, self._errors.prepared(fix)
        nothing = (0.0,) * self._errors.count
        return MovingTargetState(
            errors=self._errors,
            position_ned=measurement.position,
            velocity_ned=ZERO3,
            noise=measurement.noise,
            cross=ZERO33,
            velocity_noise=add_diagonal(ZERO33, START_SPEED_M_S**2, START_CLIMB_M_S**2),
            shared=measurement.shared,
            velocity_shared=(nothing, nothing, nothing),
            host_ns=host_ns,
            fixed_ns=host_ns,
        )


def _accelerated(m: Matrix3, density: float, factor: float) -> Matrix3:
    return add_diagonal(m, density * factor, CLIMB_DENSITY * factor)


def _with_biases(noise: Matrix3, shared: Rows, count: int) -> Matrix3:
    n, e, d = (row[:count] for row in shared)
    ne, nd, ed = inner(n, e), inner(n, d), inner(e, d)
    return add_matrices(noise, ((inner(n, n), ne, nd), (ne, inner(e, e), ed), (nd, ed, inner(d, d))))


Blend: TypeAlias = tuple[Matrix3, Matrix3]
"""The gain of a block of the state, and the covariance of the position with that block."""


def _blended(cov: Matrix3, one: Blend, other: Blend, seen: Matrix3) -> Matrix3:
    """A block of the covariance after a fix: ``X - K P_b - P_a' L' + K (P + R) L'``. ``seen``: P + R."""
    (gain, with_one), (other_gain, with_other) = one, other
    rest = minus(multiply(gain, seen), transpose(with_one))
    return add_matrices(minus(cov, multiply(gain, with_other)), multiply(rest, transpose(other_gain)))


def _plus(rows: Rows, others: Rows, factor: float) -> Rows:
    """Rows + factor * others."""
    n, e, d = (
        tuple([a + factor * b for a, b in zip(row, other, strict=True)])
        for row, other in zip(rows, others, strict=True)
    )
    return (n, e, d)


def _corrected(rows: Rows, gain: Matrix3, off: Rows) -> Rows:
    """C + K (J - C_position). ``off``: J - C_position."""
    n, e, d = (
        tuple([c + k_n * x + k_e * y + k_d * z for c, x, y, z in zip(row, *off, strict=True)])
        for row, (k_n, k_e, k_d) in zip(rows, gain, strict=True)
    )
    return (n, e, d)
