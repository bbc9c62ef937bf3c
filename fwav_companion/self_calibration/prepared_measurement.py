"""One glimpse compared with many targets of the joint estimate.

What a glimpse shares with every comparison is worked out once: where its ray meets the ground, its rows there, and what
they carry of the covariance. The ground is level, so the image is a homography of it, and how far off a target lies is
little more than two divisions: where frames show ten targets a hundred pairs are asked about. How far off it may lie is
by the rows at the ray's own point: within a hand's breadth those are the target's, and two metres off, seen from ten,
wrong by a fifth, where nobody asks so closely.
"""

from __future__ import annotations

from math import log

import msgspec

from fwav_companion.geometry.small_matrices import inner
from fwav_companion.self_calibration.joint_filter import JointFilter, carried
from fwav_companion.self_calibration.pixel_measurement import (
    COMMON_COUNT,
    PixelMeasurement,
    camera_pose,
    pixel_noise,
    predict,
)
from fwav_companion.types.tracks import GateResult


class PreparedMeasurement(msgspec.Struct, frozen=True):
    """A glimpse as the joint estimate sees it, of no target yet."""

    joint: JointFilter
    point: tuple[float, float]
    """North and east where it meets the ground."""
    receding: tuple[float, float]
    """How the depth along its ray grows with north and east, of its own depth, 1/m."""
    rows: tuple[tuple[float, ...], tuple[float, ...]]
    """d(pixel)/d(north, east) of what is seen there, px/m: of u, of v."""
    carried: tuple[tuple[float, ...], tuple[float, ...]]
    """P h', h being u's and v's rows by what is common: a column each, over all of the estimate."""
    cov: tuple[float, float, float]
    """Of the pixel by its noise and what is common: uu, uv, vv, px^2."""
    noise_determinant: float
    """Of the noise alone, px^4."""

    def gate(self, track: int) -> GateResult | None:
        """How little this was expected of a target; None where that is not in the estimate, or behind the camera."""
        place = self.joint.place_of(track)
        if place is None:
            return None
        mean, cov, (carried_u, carried_v) = self.joint.mean, self.joint.cov, self.carried
        (un, ue), (vn, ve), (uu, uv, vv) = *self.rows, self.cov
        n, e = mean[place] - self.point[0], mean[place + 1] - self.point[1]
        depth = 1.0 + self.receding[0] * n + self.receding[1] * e
        if not depth > 0.0:
            return None
        du, dv = (un * n + ue * e) / depth, (vn * n + ve * e) / depth
        cu_n, cu_e, cv_n, cv_e = carried_u[place], carried_u[place + 1], carried_v[place], carried_v[place + 1]
        (nn, ne), (_, ee) = cov[place][place : place + 2], cov[place + 1][place : place + 2]
        own_un, own_ue, own_vn, own_ve = un * nn + ue * ne, un * ne + ue * ee, vn * nn + ve * ne, vn * ne + ve * ee
        uu += 2.0 * (un * cu_n + ue * cu_e) + own_un * un + own_ue * ue
        uv += vn * cu_n + ve * cu_e + un * cv_n + ue * cv_e + own_un * vn + own_ue * ve
        vv += 2.0 * (vn * cv_n + ve * cv_e) + own_vn * vn + own_ve * ve
        determinant = uu * vv - uv * uv
        if not determinant > 0.0:
            return None
        distance2 = (vv * du * du - 2.0 * uv * du * dv + uu * dv * dv) / determinant
        return GateResult(distance2, log(determinant / self.noise_determinant))


def compared(joint: JointFilter, glimpse: PixelMeasurement) -> PreparedMeasurement | None:
    """A glimpse by what the joint estimate has found; None where its ray does not meet the ground by that, or where
    there is no target to compare it with.
    """
    if not joint.tracks:
        return None
    common = joint.mean[:COMMON_COUNT]
    stance = camera_pose(glimpse, common)
    point = stance.ground_point(glimpse.ray)
    prediction = None if point is None else predict(glimpse, point, common, stance)
    if point is None or prediction is None:
        return None
    row_u, row_v = prediction.by_common
    by_common_alone = ((*row_u, 0.0, 0.0), (*row_v, 0.0, 0.0))
    carried_u, carried_v = carried(by_common_alone, joint.cov[: COMMON_COUNT + 2])
    uu, uv, vv = pixel_noise(glimpse, prediction, joint.priors)
    north, east, below = stance.camera
    toward_n, toward_e = point[0] - north, point[1] - east
    slant2 = toward_n**2 + toward_e**2 + below**2
    return PreparedMeasurement(
        joint,
        point,
        (toward_n / slant2, toward_e / slant2),
        prediction.by_target,
        (carried_u, carried_v),
        (uu + inner(row_u, carried_u), uv + inner(row_u, carried_v), vv + inner(row_v, carried_v)),
        uu * vv - uv * uv,
    )
