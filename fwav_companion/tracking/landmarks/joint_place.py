"""The place of one standing target together with the errors that all targets share: a Kalman filter in numpy.

Each target has its own copy of the shared errors. Sights of landmarks update every copy, and a fix of the target its
own: the target is seen from many sides, and shows the vehicle's height and heading as landmarks do. What other targets
show is left out: their places would be in the state, too. Some errors are considered and not estimated (Schmidt 1966).

The state is the place, then the shared errors. With the rows H, the noise R and the gain K of the estimated states::

    S = H @ P @ H.T + R
    K = mask * (P @ H.T @ inv(S));  x += K @ (z - H @ x);  P += K @ S @ K.T - K @ H @ P - P @ H.T @ K.T
"""

from __future__ import annotations

from typing import TypeAlias

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.self_calibration.arrays import Array


class Transition(msgspec.Struct, frozen=True):
    """The shared errors some time later: s = A s + fresh noise."""

    matrix: Array
    noise: Array
    """Covariance of the fresh noise."""


class Correction(msgspec.Struct, frozen=True):
    """A linear measurement."""

    measured: Array
    rows: Array
    """H."""
    noise: Array
    """Covariance R of the noise."""


UNKNOWN_M = 100.0
"""One sigma of a place that is not known: hardly any information, and no loss by rounding."""
Step: TypeAlias = Transition | Correction


def updated(state: tuple[Array, Array], measurement: Correction, estimated: Array) -> tuple[Array, Array]:
    """Mean and covariance after a measurement that moves the estimated states alone, in Joseph's form.

    ``estimated``: 0 for what is considered and not estimated, else 1.
    """
    mean, cov = state
    rows = measurement.rows
    crossed = rows @ cov
    innovation_cov = crossed @ rows.T + measurement.noise
    gain = estimated[:, None] * np.linalg.solve(innovation_cov, crossed).T
    moved = gain @ crossed
    cov = cov + gain @ innovation_cov @ gain.T - moved - moved.T
    return mean + gain @ (measurement.measured - rows @ mean), np.asarray(0.5 * (cov + cov.T))


class JointPlace(msgspec.Struct, frozen=True):
    """North and east of a target, and the shared errors, with their covariance."""

    mean: Array
    """(2 + n)"""
    cov: Array
    """(2 + n, 2 + n)"""
    estimated: Array
    """(2 + n) 0 for what is considered and not estimated, else 1."""

    @property
    def place(self) -> Array:
        """(2), metres."""
        return self.mean[:2]

    @property
    def shared(self) -> tuple[Array, Array]:
        """Mean and covariance of this target's copy of the shared errors."""
        return self.mean[2:], self.cov[2:, 2:]

    @property
    def horizontal(self) -> Symmetric2:
        """The covariance of the place by every source, m^2."""
        return float(self.cov[0, 0]), float(self.cov[0, 1]), float(self.cov[1, 1])

    def after(self, step: Step) -> JointPlace:
        """The place after a step of the shared errors."""
        if isinstance(step, Transition):
            return self._later(step)
        rows = np.hstack((np.zeros((len(step.rows), 2)), step.rows))
        return self._updated(Correction(step.measured, rows, step.noise))

    def update(self, fix: Correction) -> JointPlace:
        """The place after a fix, whose rows are those of the place, then of the shared errors."""
        return self._updated(fix)

    def _later(self, step: Transition) -> JointPlace:
        mean, cov = self.mean.copy(), self.cov.copy()
        mean[2:] = step.matrix @ mean[2:]
        cov[:2, 2:] = cov[:2, 2:] @ step.matrix.T
        cov[2:, :2] = cov[:2, 2:].T
        cov[2:, 2:] = step.matrix @ cov[2:, 2:] @ step.matrix.T + step.noise
        return JointPlace(mean, cov, self.estimated)

    def _updated(self, measurement: Correction) -> JointPlace:
        return JointPlace(*updated((self.mean, self.cov), measurement, self.estimated), self.estimated)


def first_joint_place(fix: Correction, shared: tuple[Array, Array], estimated: Array) -> JointPlace:
    """The place by one fix: the place plus rows times the shared errors."""
    mean, cov = shared
    rows = fix.rows[:, 2:]
    crossed = rows @ cov
    place_cov = fix.noise + crossed @ rows.T
    return JointPlace(
        np.concatenate((fix.measured - rows @ mean, mean)),
        np.block([[0.5 * (place_cov + place_cov.T), -crossed], [-crossed.T, cov]]),
        np.concatenate((np.ones(2), estimated)),
    )


def unknown_place(joint: JointPlace, shared: tuple[Array, Array]) -> JointPlace:
    """The same place with hardly any information, before its first fix."""
    mean, cov = joint.mean.copy(), np.zeros_like(joint.cov)
    mean[2:], cov[2:, 2:] = shared
    cov[0, 0] = cov[1, 1] = UNKNOWN_M**2
    return JointPlace(mean, cov, joint.estimated)
