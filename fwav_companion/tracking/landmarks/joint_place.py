"""The place of one standing target together with the errors that all targets share: a Schmidt-Kalman filter in numpy.

With the errors e of the place and s of the shared errors, P = cov(e), X = cov(e, s) and Q = cov(s), a fix z with rows J
and noise R updates the place alone (Schmidt 1966)::

    S = P + J @ Q @ J.T + X @ J.T + J @ X.T + R
    K = (P + X @ J.T) @ inv(S);  P -= K @ S @ K.T;  X -= K @ (X + J @ Q)

A sight of a landmark updates the shared errors, and through X every place.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.self_calibration.arrays import Array


class Transition(msgspec.Struct, frozen=True):
    """The shared errors some time later: s = A s + fresh noise."""

    matrix: Array


class Correction(msgspec.Struct, frozen=True):
    """An update of the shared errors."""

    rows: Array
    """H."""
    crossed: Array
    """H Q."""
    inverse: Array
    """Inverse covariance of the innovation."""
    innovation: Array


class JointPlace(msgspec.Struct, frozen=True):
    """North and east of a target, and their error."""

    place: Array
    """(2), metres."""
    cov: Array
    """(2, 2), by every source, m^2."""
    cross: Array
    """(2, n), covariance with the shared errors."""

    @property
    def horizontal(self) -> Symmetric2:
        """The covariance, m^2."""
        return float(self.cov[0, 0]), float(self.cov[0, 1]), float(self.cov[1, 1])

    def after(self, step: Transition | Correction) -> JointPlace:
        """The place after a step of the shared errors."""
        if isinstance(step, Transition):
            return JointPlace(self.place, self.cov, self.cross @ step.matrix.T)
        shown = self.cross @ step.rows.T
        gain = shown @ step.inverse
        return JointPlace(
            self.place + gain @ step.innovation,
            _symmetric(self.cov - gain @ shown.T),
            self.cross - gain @ step.crossed,
        )

    def update(self, position: Array, noise: Array, rows: Array, shared: tuple[Array, Array]) -> JointPlace:
        """The place after a fix. ``shared``: mean and covariance of the shared errors."""
        mean, cov = shared
        crossed = rows @ cov
        mixed = self.cross @ rows.T
        innovation_cov = self.cov + crossed @ rows.T + mixed + mixed.T + noise
        gain = np.linalg.solve(innovation_cov, (self.cov + mixed).T).T
        return JointPlace(
            self.place + gain @ (position - rows @ mean - self.place),
            _symmetric(self.cov - gain @ innovation_cov @ gain.T),
            self.cross - gain @ (self.cross + crossed),
        )


def first_joint_place(position: Array, noise: Array, rows: Array, shared: tuple[Array, Array]) -> JointPlace:
    """The place by one fix."""
    mean, cov = shared
    crossed = rows @ cov
    return JointPlace(position - rows @ mean, _symmetric(noise + crossed @ rows.T), -crossed)


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
