"""The Kalman filter of a target that moves at nearly constant velocity.

State: position and velocity. Both carry their covariance with the biases (``schmidt_kalman``), so the covariance of the
velocity, too, has a constant time offset and a wandering position in it. The gain is that of the noise.
"""

from __future__ import annotations

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
from fwav_companion.tracking.filters.maneuver import LAGS, TURNED, ManeuverLag
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, gate_results, scattered
from fwav_companion.types import ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult

START_SPEED_M_S = 3.0
"""One sigma of each axis of an unknown velocity: people, animals, vehicles on a field."""
START_CLIMB_M_S = 0.3
"""One sigma of an unknown vertical velocity: targets are on the ground."""

ACCELERATION_DENSITY = 0.03
"""m^2/s^3, horizontal, white: at 30 fixes/s of 0.1 m the velocity settles at 0.13 m/s one sigma, and a walker who turns
about within two seconds is lagged by 0.1 m."""
UNSEEN_DENSITY = 0.5
"""The same for a target without a fix for UNSEEN_S, which may have turned around: one sigma is 13 m after ten
seconds. A walker who turned is 30 m from the predicted place by then."""
UNSEEN_S = 1.0
LEAST_TURN_S = 0.02
"""Least duration of a turn: one frame of a fast camera."""
CLIMB_DENSITY = 0.0003
"""m^2/s^3, vertical."""


class MovingTargetState(msgspec.Struct, frozen=True):
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
    scatter: AdaptiveNoise
    """Scatter of single fixes beyond their noise."""
    lag: ManeuverLag
    """Running mean of the innovations, which shows a turn."""
    host_ns: HostNs
    fixed_ns: HostNs

    @property
    def cov(self) -> Matrix3:
        """Covariance by every source of error, NED, m^2. Older errors of the vehicle's position are not kept."""
        return _with_biases(self._lagging, self.shared, self.errors.count)

    @property
    def apparent_ned(self) -> Vector3:
        """The position itself: the present error of the vehicle's position is not estimated."""
        return self.position_ned

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance without the vehicle's position, NED, m^2."""
        return _with_biases(self._lagging, self.shared, self.errors.wandering)

    @property
    def _lagging(self) -> Matrix3:
        """Covariance of the position by noise, and by a turn that has not shown itself yet, m^2."""
        return add_matrices(self.noise, scaled(self.lag.position_cov, LAGS))

    @property
    def velocity_cov(self) -> Matrix3:
        """(m/s)^2, NED."""
        return _with_biases(self.velocity_noise, self.velocity_shared, self.errors.count)

    def predict(self, host_ns: HostNs) -> MovingTargetState:
        """The state at a later instant: moved by its velocity, less certain by unknown acceleration."""
        dt = s_from_ns(host_ns - self.host_ns)
        if dt <= 0.0:
            return self
        density = ACCELERATION_DENSITY if s_from_ns(host_ns - self.fixed_ns) < UNSEEN_S else UNSEEN_DENSITY
        both = add_matrices(self.cross, transpose(self.cross))
        noise = add_matrices(self.noise, add_matrices(scaled(both, dt), scaled(self.velocity_noise, dt * dt)))
        cross = add_matrices(self.cross, scaled(self.velocity_noise, dt))
        return MovingTargetState(
            self.errors,
            add(self.position_ned, scale(self.velocity_ned, dt)),
            self.velocity_ned,
            _accelerated(noise, density, dt**3 / 3.0),
            _accelerated(cross, density, dt * dt / 2.0),
            _accelerated(self.velocity_noise, density, dt),
            _carried(self.shared, self.velocity_shared, dt),
            self.velocity_shared,
            self.scatter,
            self.lag,
            host_ns,
            self.fixed_ns,
        )

    def gate(self, fix: GroundFix) -> GateResult:
        """How little a fix at this instant was expected, horizontal; one beyond where it lags is expected the more."""
        place = self._place(add_matrices(self.noise, self.lag.position_cov))
        return gate_results(place, self.scatter, (self.errors.prepared(fix),), self.errors.timed)[0]

    def update(self, fix: GroundFix) -> MovingTargetState:
        """The state after a fix by the gain of least noise and observed scatter; a target that turned is freed."""
        since_s = s_from_ns(fix.sighting.frame_host_ns - self.fixed_ns)
        measurement = self.errors.decorrelated(fix, since_s, self.position_ned)
        north_m, east_m, _ = subtract(measurement.position, self.position_ned)
        (nn, ne, _), (_, ee, _), _ = self._expected(measurement.noise)
        lag = self.lag.with_clipped(north_m, east_m, since_s, (nn, ne, ee))
        if lag.is_turn((nn, ne, ee), TURNED):
            return self._turned(lag)._updated(measurement, ManeuverLag(), fix.sighting.frame_host_ns)
        return self._updated(measurement, lag, fix.sighting.frame_host_ns)

    def _expected(self, noise: Matrix3) -> Matrix3:
        """Covariance of the innovation of a fix with this noise."""
        return add_diagonal(add_matrices(self.noise, noise), self.scatter.variance, 0.0)

    def _turned(self, lag: ManeuverLag) -> MovingTargetState:
        """The state with the uncertainty of a target that turned as long ago as the mean looks back."""
        off, per_s = lag.position_cov, 1.0 / max(lag.back_s, LEAST_TURN_S)
        return replace(
            self,
            noise=add_matrices(self.noise, off),
            cross=add_matrices(self.cross, scaled(off, per_s)),
            velocity_noise=add_matrices(self.velocity_noise, scaled(off, per_s * per_s)),
        )

    def _updated(self, measurement: Measurement, lag: ManeuverLag, host_ns: HostNs) -> MovingTargetState:
        inverse = symmetric_inverse(self._expected(measurement.noise))
        gain, velocity_gain = multiply(self.noise, inverse), multiply(transpose(self.cross), inverse)
        difference = subtract(measurement.position, self.position_ned)
        noise, cross, velocity_noise = self._blended_noise(measurement.noise, gain, velocity_gain)
        return MovingTargetState(
            self.errors,
            add(self.position_ned, transform(gain, difference)),
            add(self.velocity_ned, transform(velocity_gain, difference)),
            noise,
            cross,
            velocity_noise,
            blended_shared(self.shared, measurement.shared, self.shared, gain),
            blended_shared(self.velocity_shared, measurement.shared, self.shared, velocity_gain),
            scattered(self._place(self.noise), self.scatter, measurement, self.errors.timed),
            lag,
            self.host_ns,
            host_ns,
        )

    def _place(self, noise: Matrix3) -> PointEstimate:
        (nn, ne, _), (_, ee, _), _ = noise
        return PointEstimate(self.position_ned[0], self.position_ned[1], (nn, ne, ee), self.shared[:2])

    def _blended_noise(self, fix: Matrix3, gain: Matrix3, velocity_gain: Matrix3) -> tuple[Matrix3, Matrix3, Matrix3]:
        """(I - K H) P (I - K H)' + K R K' for any gain, by its blocks."""
        seen = add_matrices(self.noise, fix)
        to_velocity = multiply(velocity_gain, self.cross)
        spread = multiply(multiply(velocity_gain, seen), transpose(velocity_gain))
        velocity_noise = add_matrices(
            minus(self.velocity_noise, add_matrices(to_velocity, transpose(to_velocity))), spread
        )
        cross = minus(self.cross, multiply(gain, self.cross))
        cross = add_matrices(cross, multiply(minus(multiply(gain, seen), self.noise), transpose(velocity_gain)))
        return joseph_update(self.noise, fix, gain), cross, symmetrized(velocity_noise)


class MovingKalman:
    """Initiates moving targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = ConsiderBiases(priors)

    def initiate(self, fix: GroundFix) -> MovingTargetState:
        """The state after the first fix: there, at any walking or driving speed."""
        host_ns = fix.sighting.frame_host_ns
        measurement = self._errors.prepared(fix)
        nothing = (0.0,) * self._errors.count
        speed = START_SPEED_M_S**2
        return MovingTargetState(
            self._errors,
            measurement.position,
            ZERO3,
            measurement.noise,
            ZERO33,
            ((speed, 0.0, 0.0), (0.0, speed, 0.0), (0.0, 0.0, START_CLIMB_M_S**2)),
            measurement.shared,
            (nothing, nothing, nothing),
            AdaptiveNoise(),
            ManeuverLag(),
            host_ns,
            host_ns,
        )


def _accelerated(m: Matrix3, density: float, factor: float) -> Matrix3:
    return add_diagonal(m, density * factor, CLIMB_DENSITY * factor)


def _carried(rows: Rows, velocity_rows: Rows, dt: float) -> Rows:
    n, e, d = (
        tuple([c + dt * v for c, v in zip(row, velocity_row, strict=True)])
        for row, velocity_row in zip(rows, velocity_rows, strict=True)
    )
    return (n, e, d)


def _with_biases(noise: Matrix3, shared: Rows, count: int) -> Matrix3:
    n, e, d = (row[:count] for row in shared)
    ne, nd, ed = inner(n, e), inner(n, d), inner(e, d)
    return add_matrices(noise, ((inner(n, n), ne, nd), (ne, inner(e, e), ed), (nd, ed, inner(d, d))))


def joseph_update(own: Matrix3, fix: Matrix3, gain: Matrix3) -> Matrix3:
    """(I - K) P (I - K)' + K R K', for any gain."""
    (a, b, c), (d, e, f), (g, h, i) = gain
    rest = ((1.0 - a, -b, -c), (-d, 1.0 - e, -f), (-g, -h, 1.0 - i))
    kept, come = multiply(multiply(rest, own), transpose(rest)), multiply(multiply(gain, fix), transpose(gain))
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = kept
    (c_nn, c_ne, c_nd), (_, c_ee, c_ed), (_, _, c_dd) = come
    nn, ne, nd, ee, ed, dd = nn + c_nn, ne + c_ne, nd + c_nd, ee + c_ee, ed + c_ed, dd + c_dd
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def blended_shared(own: Rows, fix: Rows, estimate: Rows, gain: Matrix3) -> Rows:
    """C + K (J - C_estimate), C being what is blended: the estimate's own rows, or its velocity's."""
    (k00, k01, k02), (k10, k11, k12), (k20, k21, k22) = gain
    north, east, down = [], [], []
    for n, e, d, was_n, was_e, was_d, fix_n, fix_e, fix_d in zip(*own, *estimate, *fix, strict=True):
        x, y, z = fix_n - was_n, fix_e - was_e, fix_d - was_d
        north.append(n + k00 * x + k01 * y + k02 * z)
        east.append(e + k10 * x + k11 * y + k12 * z)
        down.append(d + k20 * x + k21 * y + k22 * z)
    return (tuple(north), tuple(east), tuple(down))
