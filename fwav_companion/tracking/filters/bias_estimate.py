"""Kalman filter that estimates the biases from the innovations of many fixes, in units of their prior sigmas.

An innovation is ``D b + noise``, with the sensitivities D to the biases b. In numpy::

    S = D @ P @ D.T + R
    K = P @ D.T @ inv(S);  b += K @ (z - D @ b);  P -= K @ D @ P
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from typing import Self

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import Row, Symmetric2, diagonal, inner, plus_diagonal, products
from fwav_companion.tracking.filters.base import SharedInnovation


class BiasResidual(msgspec.Struct, frozen=True, gc=False):
    """An innovation minus the effect of the estimated biases."""

    north_m: float
    east_m: float
    cov: Symmetric2
    """S, the covariance of the residual, m^2."""
    with_biases: tuple[Row, Row]
    """P D', the covariance of the biases with the residual, north and east, metres."""

    @property
    def area2(self) -> float:
        """Determinant of S, m^4."""
        nn, ne, ee = self.cov
        return nn * ee - ne * ne

    @property
    def nis(self) -> float:
        """Normalised innovation squared, two degrees of freedom."""
        n, e, (nn, ne, ee) = self.north_m, self.east_m, self.cov
        return (ee * n * n - 2.0 * ne * n * e + nn * e * e) / self.area2

    @property
    def log_likelihood(self) -> float:
        """Log-likelihood of the residual, up to a constant."""
        return -0.5 * (log(self.area2) + self.nis)


class BiasEstimate(msgspec.Struct, frozen=True, gc=False):
    """Mean and covariance of the biases. Immutable."""

    mean: Row
    cov: tuple[Row, ...]

    @classmethod
    def prior(cls, count: int) -> Self:
        """The estimate before any innovation: the priors."""
        return cls((0.0,) * count, diagonal((1.0,) * count))

    def decayed(self, left: Sequence[float]) -> Self:
        """The estimate after each bias has decayed towards its prior; ``left``: the share of each that remains."""
        shares = zip(left, self.cov, strict=True)
        cov = [tuple([own * other * c for other, c in zip(left, row, strict=True)]) for own, row in shares]
        mean = tuple([share * bias for share, bias in zip(left, self.mean, strict=True)])
        return replace(self, mean=mean, cov=plus_diagonal(cov, [1.0 - share * share for share in left]))

    def residual(self, innovation: SharedInnovation) -> BiasResidual:
        """The residual of an innovation under the estimated biases."""
        (d_n, d_e), (nn, ne, ee) = innovation.shared, innovation.noise
        by_n, by_e = products(self.cov, d_n, d_e)
        return BiasResidual(
            innovation.north_m - inner(self.mean, d_n),
            innovation.east_m - inner(self.mean, d_e),
            (nn + inner(by_n, d_n), ne + inner(by_n, d_e), ee + inner(by_e, d_e)),
            (by_n, by_e),
        )

    def update(self, seen: BiasResidual) -> Self:
        """The estimate updated with an innovation that has this residual."""
        (by_n, by_e), (nn, ne, ee), scale = seen.with_biases, seen.cov, 1.0 / seen.area2
        gains = [(scale * (a * ee - b * ne), scale * (b * nn - a * ne)) for a, b in zip(by_n, by_e, strict=True)]
        mean = [m + k_n * seen.north_m + k_e * seen.east_m for m, (k_n, k_e) in zip(self.mean, gains, strict=True)]
        cov = [
            tuple([c - k_n * a - k_e * b for c, a, b in zip(row, by_n, by_e, strict=True)])
            for row, (k_n, k_e) in zip(self.cov, gains, strict=True)
        ]
        return replace(self, mean=tuple(mean), cov=tuple(cov))
