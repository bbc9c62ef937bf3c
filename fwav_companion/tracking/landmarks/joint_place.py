"""Kalman filter of the place of one static target together with the errors that all targets share, in numpy.

Each target has its own copy of the shared errors. Sights of landmarks update every copy. A fix of the target updates
its own copy: the target is seen from many sides, and shows the vehicle's height and heading as landmarks do. Fixes of
other targets are not used, because their places would have to be in the state, too. Some errors are considered and not
estimated (Schmidt 1966).

The state is the place, then the shared errors. With the rows H, the noise R and the gain K of the estimated states::

    S = H @ P @ H.T + R
    K = mask * (P @ H.T @ inv(S));  x += K @ (z - H @ x);  P += K @ S @ K.T - K @ H @ P - P @ H.T @ K.T
"""

from __future__ import annotations

from functools import cached_property
from typing import TypeAlias

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration.arrays import Array


class Transition(msgspec.Struct, frozen=True, dict=True):
    """Transition of the shared errors to a later instant: s = A s + fresh noise."""

    matrix: Array
    noise: Array
    """Covariance of the fresh noise."""

    @cached_property
    def beside_place(self) -> Transition:
        """The transition of the joint state: of a constant place, and of the shared errors."""
        still = len(self.matrix) + 2
        matrix, noise = np.eye(still), np.zeros((still, still))
        matrix[2:, 2:], noise[2:, 2:] = self.matrix, self.noise
        return Transition(matrix, noise)


class Correction(msgspec.Struct, frozen=True, dict=True):
    """A linear measurement."""

    measured: Array
    rows: Array
    """Sensitivities H to the state."""
    noise: Array
    """Covariance R of the noise."""

    @cached_property
    def beside_place(self) -> Correction:
        """The measurement of the joint state: of a place, to which it is not sensitive, and of the shared errors."""
        return Correction(self.measured, np.hstack((np.zeros((len(self.rows), 2)), self.rows)), self.noise)


UNKNOWN_M = 100.0
"""One sigma of an unknown place, metres: hardly any information, and no loss by rounding."""
Step: TypeAlias = Transition | Correction


def stepped(state: tuple[Array, Array], step: Step, estimated: Array) -> tuple[Array, Array]:
    """Mean and covariance after a step. A measurement moves only the estimated states, in Joseph's form.

    ``estimated``: 1 for each estimated state, 0 for each considered state.
    """
    mean, cov = state
    if isinstance(step, Transition):
        return step.matrix @ mean, step.matrix @ cov @ step.matrix.T + step.noise
    rows = step.rows
    crossed = rows @ cov
    innovation_cov = crossed @ rows.T + step.noise
    gain = estimated[:, None] * np.linalg.solve(innovation_cov, crossed).T
    moved = gain @ crossed
    cov = cov + gain @ innovation_cov @ gain.T - moved - moved.T
    return mean + gain @ (step.measured - rows @ mean), np.asarray(0.5 * (cov + cov.T))


class JointPlace(msgspec.Struct, frozen=True):
    """Joint state of one target: its north and east and the shared errors, with their covariance."""

    mean: Array
    """(2 + n) North and east, metres, then the shared errors."""
    cov: Array
    """(2 + n, 2 + n)"""
    estimated: Array
    """(2 + n) 1 for each estimated state, 0 for each considered state."""

    @property
    def place(self) -> Array:
        """(2) Place of the target, north and east, metres."""
        return self.mean[:2]

    @property
    def horizontal(self) -> Symmetric2:
        """The covariance of the place by every source, m^2."""
        return float(self.cov[0, 0]), float(self.cov[0, 1]), float(self.cov[1, 1])

    def after(self, step: Step) -> JointPlace:
        """The joint state after a step of the shared errors."""
        return self.update(step.beside_place)

    def update(self, step: Step) -> JointPlace:
        """The joint state after a fix, with rows for the place, then for the shared errors; or after any step."""
        return JointPlace(*stepped((self.mean, self.cov), step, self.estimated), self.estimated)


def unknown_place(position_ned: Vector3, shared: tuple[Array, Array], estimated: Array) -> JointPlace:
    """A place about ``position_ned`` with hardly any information, and the mean and covariance of the shared errors."""
    mean, cov = shared
    joint = np.zeros((len(mean) + 2,) * 2)
    joint[0, 0] = joint[1, 1] = UNKNOWN_M**2
    joint[2:, 2:] = cov
    return JointPlace(np.concatenate((position_ned[:2], mean)), joint, np.concatenate((np.ones(2), estimated)))
