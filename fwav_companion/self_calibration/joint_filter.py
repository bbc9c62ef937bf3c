"""The joint estimate of what all targets share and where each of them stands: an extended Kalman filter on pixels.

Two precautions against inventing knowledge. Every row is taken at a fixed point of linearization, which moves only
when a whole pass over the kept glimpses is begun anew: a point that follows the noise would make directions look
observable that are not. And the vehicle's position error is considered, never estimated: what wanders is no constant.

Immutable: an update returns a new estimate that shares the rows it did not touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from math import exp
from operator import sub
from typing import TypeAlias, TypeVar

import msgspec

from fwav_companion.geometry.small_matrices import inner
from fwav_companion.self_calibration.pixel_measurement import (
    COMMON_COUNT,
    PixelMeasurement,
    PredictedPixel,
    SharedParameter,
    camera_pose,
    pixel_noise,
    predict,
)
from fwav_companion.types import ErrorPriors

Row: TypeAlias = tuple[float, ...]
Rows: TypeAlias = tuple[Row, ...]
T = TypeVar("T")

GATE = 16.0
"""Squared Mahalanobis distance of two pixels: a true one lies beyond once in 3000 times."""


class PixelInnovation(msgspec.Struct, frozen=True, gc=False):
    """What a glimpse says beyond the estimate."""

    difference: tuple[float, float]
    """Pixels, measured minus predicted."""
    carried: tuple[tuple[float, ...], tuple[float, ...]]
    """P H', a column each of u and v."""
    inverse: tuple[float, float, float]
    """Of the innovation's covariance: uu, uv, vv, 1/px^2."""
    determinant: float
    distance2: float
    luck: float
    """Variance of the log-likelihood by which this glimpse may prefer another instant of the same motion: the attitudes
    told for that are as noisy, but not by the same errors."""
    noise: tuple[float, float, float]
    """Covariance of what is fresh in it: uu, uv, vv, px^2."""
    rows: tuple[Row, Row]
    """Of u and v, by each of Common and by the target's north and east."""


class JointFilter(msgspec.Struct, frozen=True):
    """Mean and covariance of (common, north and east of each target), about a point of linearization."""

    priors: ErrorPriors
    mean: tuple[float, ...]
    cov: Rows
    """Symmetric."""
    around: tuple[float, ...]
    """The point of linearization."""
    tracks: tuple[int, ...]
    """Whose targets they are, in order."""
    host_ns: int

    def place_of(self, track: int) -> int | None:
        """Index of the target's north; None where it is not in the estimate."""
        return COMMON_COUNT + 2 * self.tracks.index(track) if track in self.tracks else None

    @property
    def places(self) -> dict[int, tuple[float, float]]:
        """North and east of each target, by track."""
        means = self.mean[COMMON_COUNT:]
        return dict(zip(self.tracks, zip(means[::2], means[1::2], strict=True), strict=True))

    def predict(self, host_ns: int) -> JointFilter:
        """At another instant: the vehicle's position error has wandered."""
        sigma2 = self.priors.bias_sigmas[9] ** 2
        if host_ns <= self.host_ns or sigma2 == 0.0 or not self.priors.position_bias_time_s > 0.0:
            return self
        kept = exp(-(host_ns - self.host_ns) * 1e-9 / self.priors.position_bias_time_s)
        rows = [list(row) for row in self.cov]
        for i in (SharedParameter.NORTH, SharedParameter.EAST):
            rows[i] = [c * kept for c in rows[i]]
            for row in rows:
                row[i] *= kept
            rows[i][i] += (1.0 - kept * kept) * self.priors.bias_sigmas[9 + i - SharedParameter.NORTH] ** 2
        return msgspec.structs.replace(self, cov=tuple(tuple(row) for row in rows), host_ns=host_ns)

    def innovation(self, track: int, glimpse: PixelMeasurement) -> PixelInnovation | None:
        """Of a glimpse, taken for this track's; None where that is not in the estimate, or impossible."""
        place = self.place_of(track)
        if place is None:
            return None
        prediction = predict(glimpse, (self.around[place], self.around[place + 1]), self.around[:COMMON_COUNT])
        return None if prediction is None else self._weighed(glimpse, prediction, place)

    def _weighed(self, glimpse: PixelMeasurement, prediction: PredictedPixel, place: int) -> PixelInnovation | None:
        row_u, row_v = prediction.rows
        off = list(map(sub, _taken(self.mean, place), _taken(self.around, place)))
        du, dv = prediction.residual[0] - inner(row_u, off), prediction.residual[1] - inner(row_v, off)
        columns = carried(prediction.rows, _taken(self.cov, place))
        own_u, own_v = _taken(columns[0], place), _taken(columns[1], place)
        uu, uv, vv = pixel_noise(glimpse, prediction, self.priors)
        noise = (uu, uv, vv)
        su, sv = glimpse.pixel_sigma
        luck = 2.0 - (su * su / uu) ** 2 - (sv * sv / vv) ** 2
        uu, uv, vv = uu + inner(row_u, own_u), uv + inner(row_u, own_v), vv + inner(row_v, own_v)
        determinant = uu * vv - uv * uv
        if not determinant > 0.0:
            return None
        inverse = (vv / determinant, -uv / determinant, uu / determinant)
        distance2 = inverse[0] * du * du + 2.0 * inverse[1] * du * dv + inverse[2] * dv * dv
        return PixelInnovation((du, dv), columns, inverse, determinant, distance2, luck, noise, prediction.rows)

    def updated(self, seen: PixelInnovation) -> JointFilter:
        """With the gain of least covariance, but for the vehicle's position, which is only considered."""
        pu, pv = seen.carried
        iuu, iuv, ivv = seen.inverse
        du, dv = seen.difference
        gain_u = [a * iuu + b * iuv for a, b in zip(pu, pv, strict=True)]
        gain_v = [a * iuv + b * ivv for a, b in zip(pu, pv, strict=True)]
        mean = [m + gu * du + gv * dv for m, gu, gv in zip(self.mean, gain_u, gain_v, strict=True)]
        lower = [  # row i has i + 1 columns
            [p - gu * a - gv * b for p, a, b in zip(row, pu[: i + 1], pv, strict=False)]
            for i, (row, gu, gv) in enumerate(zip(self.cov, gain_u, gain_v, strict=True))
        ]
        mean[SharedParameter.NORTH : SharedParameter.EAST + 1] = self.mean[
            SharedParameter.NORTH : SharedParameter.EAST + 1
        ]
        for i, j in (
            (SharedParameter.NORTH, SharedParameter.NORTH),
            (SharedParameter.EAST, SharedParameter.NORTH),
            (SharedParameter.EAST, SharedParameter.EAST),
        ):
            lower[i][j] = self.cov[i][j]
        return msgspec.structs.replace(self, mean=tuple(mean), cov=_mirrored(lower))

    def with_target(self, glimpse: PixelMeasurement, around: tuple[float, float] | None) -> JointFilter | None:
        """With a target that this glimpse is the first of; ``around``: where to linearize, if that is known better."""
        common = self.around[:COMMON_COUNT]
        stance = camera_pose(glimpse, common)
        point = stance.ground_point(glimpse.ray)
        if point is None:
            return None
        at = around or point
        prediction = predict(glimpse, at, common, stance)
        if prediction is None:
            return None
        (a, b), (c, d) = prediction.by_target
        determinant = a * d - b * c
        if abs(determinant) < 1e-12:
            return None
        inverse = ((d / determinant, -b / determinant), (-c / determinant, a / determinant))
        return self._grown(glimpse, prediction, at, inverse)

    def _grown(
        self,
        glimpse: PixelMeasurement,
        prediction: PredictedPixel,
        at: tuple[float, float],
        inverse: tuple[tuple[float, float], tuple[float, float]],
    ) -> JointFilter:
        rows = prediction.by_common
        jacobian = [[-(i0 * u + i1 * v) for u, v in zip(*rows, strict=True)] for i0, i1 in inverse]
        common_rows = self.cov[:COMMON_COUNT]
        cross = [[sum(j * p for j, p in zip(jac, column, strict=True)) for column in zip(*common_rows, strict=True)]
                 for jac in jacobian]  # fmt: skip
        uu, uv, vv = pixel_noise(glimpse, prediction, self.priors)
        block = [[sum(j * p for j, p in zip(jac, c[:COMMON_COUNT], strict=True)) for c in cross] for jac in jacobian]
        for i, (a, b) in enumerate(inverse):
            for j, (c, d) in enumerate(inverse):
                block[i][j] += a * (uu * c + uv * d) + b * (uv * c + vv * d)
        offset = [m - o for m, o in zip(self.mean[:COMMON_COUNT], self.around[:COMMON_COUNT], strict=True)]
        ru, rv = prediction.residual
        mean = [
            x + i0 * ru + i1 * rv + sum(j * o for j, o in zip(jac, offset, strict=True))
            for x, (i0, i1), jac in zip(at, inverse, jacobian, strict=True)
        ]
        cov = [(*row, n, e) for row, n, e in zip(self.cov, *cross, strict=True)]
        cov += [(*cross[0], block[0][0], block[0][1]), (*cross[1], block[1][0], block[1][1])]
        return msgspec.structs.replace(
            self,
            mean=(*self.mean, *mean),
            cov=tuple(cov),
            around=(*self.around, *at),
            tracks=(*self.tracks, glimpse.track),
        )

    def without(self, track: int) -> JointFilter:
        """With this target forgotten."""
        place = self.place_of(track)
        if place is None:
            return self

        def cut(row: tuple[float, ...]) -> tuple[float, ...]:
            return row[:place] + row[place + 2 :]

        rows = self.cov[:place] + self.cov[place + 2 :]
        return msgspec.structs.replace(
            self,
            mean=cut(self.mean),
            cov=tuple(cut(row) for row in rows),
            around=cut(self.around),
            tracks=tuple(t for t in self.tracks if t != track),
        )


def _taken(values: tuple[T, ...], place: int) -> tuple[T, ...]:
    """Those of the common unknowns and of one target."""
    return values[:COMMON_COUNT] + values[place : place + 2]


def _mirrored(lower: list[list[float]]) -> Rows:
    """The symmetric matrix with this lower triangle, of rows that grow by one."""
    columns = zip_longest(*lower)  # what a row is too short for comes first, and is cut off
    return tuple([(*row, *column[i:]) for i, (row, column) in enumerate(zip(lower, columns, strict=True), 1)])


def carried(rows: tuple[Row, Row], used: Sequence[Row]) -> tuple[Row, Row]:
    """P H', a column each of u and v; ``used``: the rows of P that H' meets.

    The hottest loop of self-calibration: unrolled on purpose.
    """
    u0, u1, u2, u3, u4, u5, u6, u7, u8, u9, u10 = rows[0]
    v0, v1, v2, v3, v4, v5, v6, v7, v8, v9, v10 = rows[1]
    pu, pv = [], []
    for a, b, c, d, e, f, g, h, i, j, k in zip(*used, strict=True):
        pu.append(u0 * a + u1 * b + u2 * c + u3 * d + u4 * e + u5 * f + u6 * g + u7 * h + u8 * i + u9 * j + u10 * k)
        pv.append(v0 * a + v1 * b + v2 * c + v3 * d + v4 * e + v5 * f + v6 * g + v7 * h + v8 * i + v9 * j + v10 * k)
    return tuple(pu), tuple(pv)


def joint_of(
    priors: ErrorPriors, sigmas: tuple[float, ...], means: tuple[float, ...], around: tuple[float, ...]
) -> JointFilter:
    """Before any target: the priors of the common unknowns, about a point of linearization."""
    cov = tuple(tuple(sigmas[i] ** 2 if i == j else 0.0 for j in range(COMMON_COUNT)) for i in range(COMMON_COUNT))
    return JointFilter(priors, means, cov, around, (), 0)
