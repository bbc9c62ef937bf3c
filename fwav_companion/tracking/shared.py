"""The errors that many fixes share, scaled for filters: a fix weighed with its biases, not only with its noise.

A fix is ``truth + noise + J b`` with biases b that stand (or wander slowly) through a flight. An estimate blended from
fixes has an error that shares those biases: filters here carry ``shared = cov(error, b / sigma)`` along with the total
covariance (a Schmidt filter: biases are considered, never estimated), so a covariance cannot shrink below what
averaging leaves.
"""

from __future__ import annotations

from math import exp
from operator import mul
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.nouns import Bias, ErrorPriors, GroundFix
from fwav_companion.tracking.linear import Symmetric2, add_diagonal

Row: TypeAlias = tuple[float, ...]
Rows: TypeAlias = tuple[Row, Row, Row]
"""North, east, down by the biases in use."""

TELEMETRY_STEP_S = 0.1
"""Height and position arrive at 10 Hz ([rates] position) and are interpolated: frames that come faster share their
noise, so it averages as the samples do, not as the frames do."""

DOWN_FLOOR_M2 = 0.02**2
"""No ground is flatter: keeps the algebra regular where a plane leaves the height of a fix without any error."""


class Weighed(msgspec.Struct, frozen=True, gc=False):
    """A fix as a filter takes it."""

    position: Vector3
    cov: Matrix3
    """Total, m^2."""
    shared: Rows
    """J sigma: metres per sigma of each bias in use."""
    own_position_cov: Symmetric2
    """What of cov comes from the vehicle's position: nn, ne, ee."""


class SharedErrors:
    """The biases that have a prior at all, their scales, and how the wandering ones fade."""

    __slots__ = ("_height_noise2", "_position_noise2", "_scaled", "_wander_s", "count", "wandering")

    def __init__(self, priors: ErrorPriors) -> None:
        used = [bias for bias in Bias if priors.sigma(bias) > 0.0]
        self._scaled = tuple((int(bias), priors.sigma(bias)) for bias in used)
        self.count = len(used)
        before = sum(bias < Bias.POSITION_NORTH for bias in used)
        self.wandering = (before, before + sum(bias in (Bias.POSITION_NORTH, Bias.POSITION_EAST) for bias in used))
        self._wander_s = priors.position_bias_time_s
        self._height_noise2 = priors.height_noise_m**2
        self._position_noise2 = priors.position_noise_m**2

    def weighed(self, fix: GroundFix, since_s: float | None) -> Weighed:
        """The fix with its scaled Jacobian; ``since_s`` is the time since the fix before, None for a first."""
        jacobian = fix.bias_jacobian
        columns = [jacobian[i] for i, _ in self._scaled]
        north, east, down = zip(*columns, strict=True) if columns else ((), (), ())
        sigmas = tuple(sigma for _, sigma in self._scaled)
        cov = add_diagonal(fix.cov, 0.0, DOWN_FLOOR_M2)
        repeated = 0.0 if since_s is None or since_s >= TELEMETRY_STEP_S else TELEMETRY_STEP_S / max(since_s, 1e-3) - 1
        total, relative = fix.cov, fix.relative_cov
        own = (total[0][0] - relative[0][0], total[0][1] - relative[0][1], total[1][1] - relative[1][1])
        if repeated > 0.0:
            cov = self._with_repeated_noise(cov, jacobian[Bias.HEIGHT], repeated)
            more = repeated * self._position_noise2
            own = (own[0] + more, own[1], own[2] + more)
        return Weighed(
            position=fix.position_ned,
            cov=cov,
            shared=(tuple(map(mul, north, sigmas)), tuple(map(mul, east, sigmas)), tuple(map(mul, down, sigmas))),
            own_position_cov=own,
        )

    def _with_repeated_noise(self, cov: Matrix3, by_height: Vector3, repeated: float) -> Matrix3:
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = cov
        n, e, d = by_height
        height, position = repeated * self._height_noise2, repeated * self._position_noise2
        nn, ne, ee = nn + height * n * n + position, ne + height * n * e, ee + height * e * e + position
        nd, ed, dd = nd + height * n * d, ed + height * e * d, dd + height * d * d
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))

    def faded(self, rows: Rows, from_ns: HostNs, to_ns: HostNs) -> Rows:
        """Covariances with the biases as they will be: the vehicle's position error wanders and is forgotten."""
        first, last = self.wandering
        if first == last or to_ns == from_ns or not self._wander_s > 0.0:
            return rows
        kept = exp(-s_from_ns(to_ns - from_ns) / self._wander_s)
        n, e, d = ((*row[:first], *[c * kept for c in row[first:last]], *row[last:]) for row in rows)
        return (n, e, d)
