"""The errors that many fixes share, scaled for filters: a fix weighed with its biases, not only with its noise.

A fix is ``truth + noise + J b`` with biases b that stand (or wander slowly) through a flight. An estimate blended from
fixes has an error that shares those biases: filters here carry ``shared = cov(error, b / sigma)`` beside the covariance
of their noise. Biases are considered, never estimated, and a covariance cannot shrink below what averaging leaves.
"""

from __future__ import annotations

from math import exp
from operator import mul
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.nouns import Bias, ErrorPriors, GroundFix
from fwav_companion.tracking.linear import add_diagonal

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
    noise: Matrix3
    """Fresh in this fix, m^2."""
    shared: Rows
    """J sigma: metres per sigma of each bias in use."""


class SharedErrors:
    """The biases that have a prior at all, their scales, and how the wandering ones fade."""

    __slots__ = (
        "_height_noise2",
        "_indices",
        "_newest",
        "_position_noise2",
        "_sigmas",
        "_wander_s",
        "count",
        "timed",
        "wandering",
    )

    def __init__(self, priors: ErrorPriors) -> None:
        # The wandering ones come last, so that standing and wandering parts of a row are two slices.
        last = (Bias.POSITION_NORTH, Bias.POSITION_EAST)
        used = [bias for bias in Bias if priors.sigma(bias) > 0.0 and bias not in last]
        self.wandering = len(used)
        """Where the wandering biases begin."""
        used += [bias for bias in last if priors.sigma(bias) > 0.0]
        self.count = len(used)
        self.timed = used.index(Bias.TIME_OFFSET) if Bias.TIME_OFFSET in used else None
        """Where the time offset stands."""
        self._indices = tuple(int(bias) for bias in used)
        self._sigmas = tuple(priors.sigma(bias) for bias in used)
        self._wander_s = priors.position_bias_time_s
        self._newest: tuple[GroundFix, Weighed] | None = None
        self._height_noise2 = priors.height_noise_m**2
        self._position_noise2 = priors.position_noise_m**2

    def weighed(self, fix: GroundFix, since_s: float | None) -> Weighed:
        """The fix with its scaled Jacobian; ``since_s`` is the time since the fix before, None for a first.

        Association asks many tracks about one fix in a row: the newest is remembered.
        """
        if since_s is None:
            if self._newest is None or self._newest[0] is not fix:
                self._newest = (fix, self._weigh(fix, None))
            return self._newest[1]
        return self._weigh(fix, since_s)

    def _weigh(self, fix: GroundFix, since_s: float | None) -> Weighed:
        jacobian, sigmas = fix.bias_jacobian, self._sigmas
        north, east, down = zip(*[jacobian[i] for i in self._indices], strict=True) if sigmas else ((), (), ())
        noise = add_diagonal(fix.noise_cov, 0.0, DOWN_FLOOR_M2)
        if since_s is not None and since_s < TELEMETRY_STEP_S:
            noise = self._with_repeats(noise, jacobian[Bias.HEIGHT], TELEMETRY_STEP_S / max(since_s, 1e-3) - 1.0)
        shared = (tuple(map(mul, north, sigmas)), tuple(map(mul, east, sigmas)), tuple(map(mul, down, sigmas)))
        return Weighed(fix.position_ned, noise, shared)

    def _with_repeats(self, noise: Matrix3, by_height: Vector3, repeated: float) -> Matrix3:
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = noise
        n, e, d = by_height
        height, position = repeated * self._height_noise2, repeated * self._position_noise2
        nn, ne, ee = nn + height * n * n + position, ne + height * n * e, ee + height * e * e + position
        nd, ed, dd = nd + height * n * d, ed + height * e * d, dd + height * d * d
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))

    def faded(self, rows: Rows, from_ns: HostNs, to_ns: HostNs) -> Rows:
        """Covariances with the biases as they will be: the vehicle's position error wanders and is forgotten."""
        first = self.wandering
        if first == self.count or to_ns == from_ns or not self._wander_s > 0.0:
            return rows
        kept = exp(-s_from_ns(to_ns - from_ns) / self._wander_s)
        n, e, d = ((*row[:first], *[c * kept for c in row[first:]]) for row in rows)
        return (n, e, d)
