"""The Kalman filter of a target that moves at nearly constant velocity.

State: position and velocity. Errors shared with the biases are carried for both (``kalman`` says why), so a claimed
velocity, too, knows of a standing time offset or a wandering position.
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
from fwav_companion.tracking.filters.maneuver import ManeuverLag
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, gate_result, scattered
from fwav_companion.types import ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult

START_SPEED_M_S = 3.0
"""One sigma an axis of an unknown target's velocity: people, animals, vehicles on a field."""
START_CLIMB_M_S = 0.3
"""Targets stand on the ground."""

ACCELERATION_DENSITY = 0.03
"""m^2/s^3, horizontal, white: at 30 fixes/s of 0.1 m the velocity settles at 0.13 m/s one sigma, and a walker who turns
about within two seconds is lagged by 0.1 m."""
UNSEEN_DENSITY = 0.5
"""The same of a target that was not seen for UNSEEN_S: it may have turned about. One sigma is 13 m after ten seconds,
where a walker who did is 30 m from where he went."""
UNSEEN_S = 1.0
LEAST_TURN_S = 0.02
"""A frame of the fastest camera that is worth the name: a turn in less would be no speed at all."""
CLIMB_DENSITY = 0.0003
"""m^2/s^3, vertical."""


class MovingTargetState(msgspec.Struct, frozen=True):
    """Position and velocity, the covariances of their noise, and what their errors share with the biases."""

    errors: ConsiderBiases
    position_ned: Vector3
    velocity_ned: Vector3
    noise: Matrix3
    """Of the position, by noise and unknown acceleration, m^2."""
    cross: Matrix3
    """The same of position with velocity."""
    velocity_noise: Matrix3
    shared: Rows
    """cov(position error, b / sigma), metres."""
    velocity_shared: Rows
    scatter: AdaptiveNoise
    """How single fixes scatter beyond their noise."""
    lag: ManeuverLag
    """How far it is behind a target that goes another way by now."""
    host_ns: HostNs
    fixed_ns: HostNs

    @property
    def cov(self) -> Matrix3:
        """Every source of error, m^2, NED. This filter remembers no older position error than the present one."""
        return _with_biases(self.noise, self.shared, self.errors.count)

    @property
    def apparent_ned(self) -> Vector3:
        """The position itself: the present error of the vehicle's position is not estimated."""
        return self.position_ned

    @property
    def relative_cov(self) -> Matrix3:
        """Without the vehicle's own position, m^2, NED."""
        return _with_biases(self.noise, self.shared, self.errors.wandering)

    @property
    def velocity_cov(self) -> Matrix3:
        """(m/s)^2, NED."""
        return _with_biases(self.velocity_noise, self.velocity_shared, self.errors.count)

    def predict(self, host_ns: HostNs) -> MovingTargetState:
        """Moved on by its velocity, less certain by what it may have accelerated."""
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
        return gate_result(place, self.scatter, self.errors.prepared(fix), self.errors.timed)

    def update(self, fix: GroundFix) -> MovingTargetState:
        """With the gain of least noise, the scatter that was seen counted as noise; a target that turned may have."""
        since_s = s_from_ns(fix.sighting.frame_host_ns - self.fixed_ns)
        weighed = self.errors.decorrelated(fix, since_s, self.position_ned)
        north_m, east_m, _ = subtract(weighed.position, self.position_ned)
        lag = self.lag.with_fix(north_m, east_m, since_s)
        (nn, ne, _), (_, ee, _), _ = self._expected(weighed.noise)
        if lag.is_turn((nn, ne, ee)):
            return self._turned(lag)._blended(weighed, ManeuverLag(), fix.sighting.frame_host_ns)
        return self._blended(weighed, lag, fix.sighting.frame_host_ns)

    def _expected(self, noise: Matrix3) -> Matrix3:
        """Covariance of how far a fix with this noise lies off."""
        return add_diagonal(add_matrices(self.noise, noise), self.scatter.variance, 0.0)

    def _turned(self, lag: ManeuverLag) -> MovingTargetState:
        """As uncertain as it is that the target has gone another way for so long."""
        off, per_s = lag.position_cov, 1.0 / max(lag.back_s, LEAST_TURN_S)
        return replace(
            self,
            noise=add_matrices(self.noise, off),
            cross=add_matrices(self.cross, scaled(off, per_s)),
            velocity_noise=add_matrices(self.velocity_noise, scaled(off, per_s * per_s)),
        )

    def _blended(self, weighed: Measurement, lag: ManeuverLag, host_ns: HostNs) -> MovingTargetState:
        inverse = symmetric_inverse(self._expected(weighed.noise))
        gain, velocity_gain = multiply(self.noise, inverse), multiply(transpose(self.cross), inverse)
        difference = subtract(weighed.position, self.position_ned)
        noise, cross, velocity_noise = self._blended_noise(weighed.noise, gain, velocity_gain)
        return MovingTargetState(
            self.errors,
            add(self.position_ned, transform(gain, difference)),
            add(self.velocity_ned, transform(velocity_gain, difference)),
            noise,
            cross,
            velocity_noise,
            blended_shared(self.shared, weighed.shared, self.shared, gain),
            blended_shared(self.velocity_shared, weighed.shared, self.shared, velocity_gain),
            scattered(self._place(self.noise), self.scatter, weighed, self.errors.timed),
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
    """Starts beliefs about moving targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = ConsiderBiases(priors)

    def initiate(self, fix: GroundFix) -> MovingTargetState:
        """The belief after the first fix: there, at any walking or driving speed."""
        host_ns = fix.sighting.frame_host_ns
        weighed = self._errors.prepared(fix)
        nothing = (0.0,) * self._errors.count
        speed = START_SPEED_M_S**2
        return MovingTargetState(
            self._errors,
            weighed.position,
            ZERO3,
            weighed.noise,
            ZERO33,
            ((speed, 0.0, 0.0), (0.0, speed, 0.0), (0.0, 0.0, START_CLIMB_M_S**2)),
            weighed.shared,
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
