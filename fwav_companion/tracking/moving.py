"""The Kalman filter of a target that moves at nearly constant velocity.

State: position and velocity. Errors shared with the biases are carried for both (``kalman`` says why), so a claimed
velocity, too, knows of a standing time offset or a wandering position.
"""

from __future__ import annotations

from operator import mul

import msgspec

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
    transform,
    transpose,
)
from fwav_companion.nouns import ErrorPriors, GroundFix
from fwav_companion.tracking.estimate import Estimate, blended_shared, common, innovation
from fwav_companion.tracking.linear import (
    add_diagonal,
    horizontal_distance2,
    minus,
    scaled,
    symmetric_inverse,
    symmetrized,
)
from fwav_companion.tracking.shared import Row, Rows, SharedErrors

START_SPEED_M_S = 3.0
"""One sigma an axis of an unknown target's velocity: people, animals, vehicles on a field."""
START_CLIMB_M_S = 0.3
"""Targets stand on the ground."""

ACCELERATION_DENSITY = 0.03
"""m^2/s^3, horizontal, white: at 30 fixes/s of 0.1 m the velocity settles at 0.13 m/s one sigma, and a walker who turns
about within two seconds is lagged by 0.1 m."""
CLIMB_DENSITY = 0.0003
"""m^2/s^3, vertical."""


class MovingBelief(msgspec.Struct, frozen=True):
    """Position and velocity with their covariances, and what their errors share with the biases."""

    errors: SharedErrors
    position_ned: Vector3
    velocity_ned: Vector3
    cov: Matrix3
    """Of the position error, every source."""
    cross: Matrix3
    """cov(position error, velocity error)."""
    velocity_cov: Matrix3
    shared: Rows
    """cov(position error, b / sigma), metres."""
    velocity_shared: Rows
    host_ns: HostNs
    fixed_ns: HostNs

    @property
    def relative_cov(self) -> Matrix3:
        """Without the vehicle's own position: given its present error, for this filter remembers no older one."""
        first, last = self.errors.wandering
        n, e, d = (row[first:last] for row in self.shared)
        nn, ne, nd = _inner(n, n), _inner(n, e), _inner(n, d)
        ee, ed, dd = _inner(e, e), _inner(e, d), _inner(d, d)
        return minus(self.cov, ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd)))

    def predicted(self, host_ns: HostNs) -> MovingBelief:
        """Moved on by its velocity, less certain by what it may have accelerated."""
        dt = s_from_ns(host_ns - self.host_ns)
        if dt <= 0.0:
            return self
        both = add_matrices(self.cross, transpose(self.cross))
        cov = add_matrices(self.cov, add_matrices(scaled(both, dt), scaled(self.velocity_cov, dt * dt)))
        cross = add_matrices(self.cross, scaled(self.velocity_cov, dt))
        return MovingBelief(
            self.errors,
            add(self.position_ned, scale(self.velocity_ned, dt)),
            self.velocity_ned,
            _accelerated(cov, dt**3 / 3.0),
            _accelerated(cross, dt * dt / 2.0),
            _accelerated(self.velocity_cov, dt),
            self.errors.faded(_carried(self.shared, self.velocity_shared, dt), self.host_ns, host_ns),
            self.errors.faded(self.velocity_shared, self.host_ns, host_ns),
            host_ns,
            self.fixed_ns,
        )

    def surprise(self, fix: GroundFix) -> float:
        """Squared Mahalanobis distance of a fix at this instant, horizontal."""
        seen = innovation(self._as_point(), self.errors.weighed(fix, None))
        return horizontal_distance2(seen.difference, seen.cov)

    def updated(self, fix: GroundFix) -> MovingBelief:
        """With the gain of least covariance."""
        host_ns = fix.sighting.frame_host_ns
        weighed = self.errors.weighed(fix, s_from_ns(host_ns - self.fixed_ns))
        seen = innovation(self._as_point(), weighed)
        to_position = minus(self.cov, seen.common)
        to_velocity = minus(transpose(self.cross), common(self.velocity_shared, weighed.shared))
        inverse = symmetric_inverse(seen.cov)
        gain, velocity_gain = multiply(to_position, inverse), multiply(to_velocity, inverse)
        return MovingBelief(
            self.errors,
            add(self.position_ned, transform(gain, seen.difference)),
            add(self.velocity_ned, transform(velocity_gain, seen.difference)),
            symmetrized(minus(self.cov, multiply(gain, transpose(to_position)))),
            minus(self.cross, multiply(gain, transpose(to_velocity))),
            symmetrized(minus(self.velocity_cov, multiply(velocity_gain, transpose(to_velocity)))),
            blended_shared(self.shared, weighed.shared, self.shared, gain),
            blended_shared(self.velocity_shared, weighed.shared, self.shared, velocity_gain),
            self.host_ns,
            host_ns,
        )

    def _as_point(self) -> Estimate:
        return Estimate(self.position_ned, self.cov, self.shared, (0.0, 0.0, 0.0))


class MovingKalman:
    """Starts beliefs about moving targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = SharedErrors(priors)

    def started(self, fix: GroundFix) -> MovingBelief:
        """The belief after the first fix: there, at any walking or driving speed."""
        host_ns = fix.sighting.frame_host_ns
        weighed = self._errors.weighed(fix, None)
        nothing = (0.0,) * self._errors.count
        speed = START_SPEED_M_S**2
        return MovingBelief(
            self._errors,
            weighed.position,
            ZERO3,
            weighed.cov,
            ZERO33,
            ((speed, 0.0, 0.0), (0.0, speed, 0.0), (0.0, 0.0, START_CLIMB_M_S**2)),
            weighed.shared,
            (nothing, nothing, nothing),
            host_ns,
            host_ns,
        )


def _accelerated(m: Matrix3, factor: float) -> Matrix3:
    return add_diagonal(m, ACCELERATION_DENSITY * factor, CLIMB_DENSITY * factor)


def _carried(rows: Rows, velocity_rows: Rows, dt: float) -> Rows:
    n, e, d = (
        tuple([c + dt * v for c, v in zip(row, velocity_row, strict=True)])
        for row, velocity_row in zip(rows, velocity_rows, strict=True)
    )
    return (n, e, d)


def _inner(a: Row, b: Row) -> float:
    return sum(map(mul, a, b), 0.0)
