"""Averages of the fixes of one target, with their covariance due to noise and due to the biases that fixes share."""

from __future__ import annotations

from math import dist, log

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, gram, inner
from fwav_companion.tracking.filters.base import GATE
from fwav_companion.tracking.filters.fix_sample import FixSample
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

SCATTER_SHARE = 0.02
"""Forgetting factor: time constant of 50 fixes (8 wing beats of 5 Hz at 30 frames/s)."""
FIXES_TO_LEARN = 20
"""Number of fixes that show the effect of a time offset on a target: three wing beats of 5 Hz at 30 frames/s."""
MOST_SCATTER = 4.0
"""Limit of the observed variance, as a multiple of the variance by one sigma of the time offset: two sigma."""
LEAST_PRIOR_SHARE = 0.1
"""Smallest share of the time offset's prior that is kept: a glide does not show the next wing beat."""


class FixScatter(msgspec.Struct, frozen=True, gc=False):
    """Observed variance of the fixes about the average beyond their noise (adaptive noise; Mehra 1970).

    A constant time offset causes it on a flapping wing: the offset displaces single fixes much farther than their mean,
    and not in proportion to the present rate. So a new target uses the variance that the prior of the offset allows,
    and an old target the observed variance.
    """

    variance: float = 0.0
    """Observed variance of each axis, m^2. ``allowed`` limits it: clutter must not widen a gate that lets in more."""
    allowed: float = 0.0
    """Variance of each axis due to the prior of the time offset, running mean over the fixes, m^2."""
    count: int = 1
    """Number of fixes."""

    def with_fix(self, distance2: float, expected2: float, displacement2: float) -> FixScatter:
        """The scatter after one more fix. All squares are sums of both axes, m^2.

        ``distance2``: squared distance of the fix from the average; ``expected2``: its expectation by noise alone;
        ``displacement2``: squared displacement by one sigma of the time offset.
        """
        share = max(SCATTER_SHARE, 1.0 / (self.count + 1))
        allowed = self.allowed + share * (0.5 * displacement2 - self.allowed)
        variance = self.variance + share * (0.5 * (distance2 - expected2) - self.variance)
        return FixScatter(min(max(0.0, variance), MOST_SCATTER * allowed), allowed, self.count + 1)

    @property
    def prior_share(self) -> float:
        """Share of the time offset's prior variance that a gate still includes."""
        return max(LEAST_PRIOR_SHARE, 1.0 - self.count / FIXES_TO_LEARN)


class PlaceAverage(msgspec.Struct, frozen=True, gc=False):
    """Horizontal average of fixes."""

    north_m: float
    east_m: float
    noise: Symmetric2
    """P, the covariance due to noise, m^2."""
    shared: tuple[Row, Row]
    """C: cov(error, b / sigma), north and east, metres."""

    @property
    def cov(self) -> Symmetric2:
        """Covariance P + C C', all sources of error included, m^2."""
        (nn, ne, ee), (by_nn, by_ne, by_ee) = self.noise, gram(*self.shared)
        return (nn + by_nn, ne + by_ne, ee + by_ee)

    def with_noise(self, more: Symmetric2) -> PlaceAverage:
        """The average with the noise covariance increased by ``more``, m^2."""
        (nn, ne, ee), (more_nn, more_ne, more_ee) = self.noise, more
        return PlaceAverage(self.north_m, self.east_m, (nn + more_nn, ne + more_ne, ee + more_ee), self.shared)

    def along(self, row: Row) -> tuple[float, float]:
        """Covariance with another error due to the biases, north and east, m^2: C times the ``row`` of that error."""
        if not any(row):  # on level ground no bias moves a point up or down
            return 0.0, 0.0
        return inner(self.shared[0], row), inner(self.shared[1], row)

    def with_sample(self, sample: FixSample, share: float) -> PlaceAverage:
        """The average after one more sample with the gain ``share`` along either axis."""
        (nn, ne, ee), ((r_nn, r_ne, _), (_, r_ee, _), _) = self.noise, sample.noise
        kept2, share2, north, east = (1.0 - share) ** 2, share * share, [], []
        for x, y, j_x, j_y in zip(*self.shared, *sample.shared[:2], strict=True):
            north.append(x + share * (j_x - x))
            east.append(y + share * (j_y - y))
        return PlaceAverage(
            self.north_m + share * (sample.position[0] - self.north_m),
            self.east_m + share * (sample.position[1] - self.east_m),
            (kept2 * nn + share2 * r_nn, kept2 * ne + share2 * r_ne, kept2 * ee + share2 * r_ee),
            (tuple(north), tuple(east)),
        )

    def gate(self, sample: FixSample, scatter: FixScatter, time_offset: int | None) -> GateResult:
        """Gating statistics of a sample; errors that it shares with the average cancel.

        ``time_offset``: index of the camera's time offset in every row.
        """
        (own_n, own_e), (p_nn, p_ne, p_ee) = self.shared, self.noise
        (fix_n, fix_e, _), ((f_nn, f_ne, _), (_, f_ee, _), _) = sample.shared, sample.noise
        p_nn, p_ee = p_nn + scatter.variance, p_ee + scatter.variance
        n, e, nn = (
            sample.position[0] - self.north_m,
            sample.position[1] - self.east_m,
            p_nn + f_nn + dist(fix_n, own_n) ** 2,
        )
        if n * n > GATE * nn:  # the distance along either axis is a lower bound
            return OUTSIDE_GATE
        ee = p_ee + f_ee + dist(fix_e, own_e) ** 2
        if e * e > GATE * ee:
            return OUTSIDE_GATE
        # The inner product of the differences, by the distances of their ends.
        by_ne = dist(fix_n, own_e) ** 2 + dist(fix_e, own_n) ** 2 - dist(fix_n, fix_e) ** 2 - dist(own_n, own_e) ** 2
        ne = p_ne + f_ne + 0.5 * by_ne
        if time_offset is not None:
            certain = 1.0 - scatter.prior_share
            north, east = fix_n[time_offset] - own_n[time_offset], fix_e[time_offset] - own_e[time_offset]
            nn, ne, ee = nn - certain * north * north, ne - certain * north * east, ee - certain * east * east
        area2 = nn * ee - ne * ne
        nis = (ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2
        return GateResult(nis, log(area2 / (f_nn * f_ee - f_ne * f_ne)))

    def scatter_after(self, sample: FixSample, scatter: FixScatter, time_offset: int | None) -> FixScatter:
        """The scatter of the fixes about this average after one more."""
        north_m, east_m = sample.position[0] - self.north_m, sample.position[1] - self.east_m
        (p_nn, _, p_ee), ((r_nn, _, _), (_, r_ee, _), _) = self.noise, sample.noise
        i, (north, east, _) = time_offset, sample.shared
        displacement2 = 0.0 if i is None else north[i] ** 2 + east[i] ** 2
        return scatter.with_fix(north_m * north_m + east_m * east_m, p_nn + p_ee + r_nn + r_ee, displacement2)


class HeightAverage(msgspec.Struct, frozen=True, gc=False):
    """Average of the target's height."""

    down_m: float
    variance: float
    """Variance by noise, m^2."""
    shared: Row
    """cov(error, b / sigma), metres."""

    def with_sample(self, sample: FixSample, share: float) -> HeightAverage:
        """The average after one more sample."""
        shared = self.shared
        if any(shared) or any(sample.shared[2]):
            shared = tuple([c + share * (j - c) for c, j in zip(shared, sample.shared[2], strict=True)])
        down_m = self.down_m + share * (sample.position[2] - self.down_m)
        variance = (1.0 - share) ** 2 * self.variance + share * share * sample.noise[2][2]
        return HeightAverage(down_m, variance, shared)
