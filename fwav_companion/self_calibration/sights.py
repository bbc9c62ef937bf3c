"""Single sights of static targets, and how closely their rays meet in one place under any mount of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, exp, log, sqrt
from statistics import median

import msgspec
import numpy as np

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, subtract
from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.filter_pass import median_of
from fwav_companion.types import Bias, ErrorPriors, GroundFix, VehicleState

DISPLACING = (Bias.HEIGHT, Bias.POSITION_DELAY, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z, Bias.TARGET_HEIGHT)
"""Biases that displace a ground point by metres, whatever the camera's distance; where the camera is near, other mounts
have the same effect."""
MEDIAN = sqrt(2.0 * log(2.0))
"""Median distance of a point with a sigma of 1 along each of two axes (Rayleigh distribution)."""
LEAST_DOWN = 0.05
"""Least down component of a unit ray, 3 degrees below the horizon: a flatter ray meets the ground anywhere."""


class SingleSight(msgspec.Struct, frozen=True, gc=False):
    """One sighting of a target with the vehicle's pose, independent of the mount of the camera."""

    host_ns: HostNs
    label: str
    ray: Vector3
    """Unit ray, camera axes."""
    body_from_camera: Matrix3
    """Mount as configured; for a camera on a gimbal, in the gimbal's axes."""
    ned_from_body: Matrix3
    """Attitude of the body; for a camera on a gimbal, of the gimbal."""
    camera_ned: Vector3
    """Camera position, NED, m."""
    drop_m: float
    """Height of the camera above the target's ground, m."""
    range_m: float
    """Distance from the camera to the point on the ground, m."""
    displaced_m2: float
    """Variance of the ground point by noise and by DISPLACING, mean of both axes, m^2."""
    position_m2: float
    """Variance of the point by the vehicle's position bias, mean of both axes, m^2."""


class CommonPoint(msgspec.Struct, frozen=True):
    """The point where sights meet under one mount, and their spread about it."""

    body_from_camera: Array
    """(3, 3), the mount; possibly one that mirrors."""
    spread: float
    """Median angle between a sight and the direction of the point, rad; about 3e2 and more where half of the sights
    miss the ground."""
    point: Array
    """(2), north and east, m."""


MISSED = 1e3
"""Value of ``CommonPoint.spread`` where half of the sights miss the ground."""


def sight_of(fix: GroundFix, state: VehicleState, priors: ErrorPriors) -> SingleSight:
    """The sight of a fix. ``state``: the vehicle at its capture, corrected by the known delay."""
    sighting = fix.sighting
    displaced_m2 = 0.5 * (fix.noise_cov[0][0] + fix.noise_cov[1][1]) + _variance(fix, DISPLACING, priors)
    nominal = sighting.state
    both = state.position_ned is not None and nominal.position_ned is not None
    moved = subtract(state.position_ned, nominal.position_ned) if both else ZERO3  # type: ignore[arg-type]
    north, east, down = sighting.camera_ned
    return SingleSight(
        sighting.frame_host_ns,
        sighting.detection.label,
        sighting.ray.direction,
        sighting.body_from_camera,
        matrix_from_quaternion(state.ned_from_carrier),
        (north + moved[0], east + moved[1], down + moved[2]),
        fix.height_above_target_m - moved[2],
        range_m=dist(fix.position_ned, sighting.camera_ned),
        displaced_m2=displaced_m2,
        position_m2=_variance(fix, (Bias.POSITION_NORTH, Bias.POSITION_EAST), priors),
    )


def _variance(fix: GroundFix, biases: Sequence[Bias], priors: ErrorPriors) -> float:
    columns = [(*fix.bias_jacobian[bias][:2], priors.sigma(bias)) for bias in biases]
    return 0.5 * sum((north * north + east * east) * sigma * sigma for north, east, sigma in columns)


def expected_spread(sights: Sequence[SingleSight], priors: ErrorPriors) -> float:
    """Expected median angle between sights and their common point under a right mount, rad: by noise, by biases of
    metres, and by the wander of the vehicle's position over these sights.

    The position's error has its whole sigma, but is nearly constant over the sights. A random walk over a time t
    spreads about its own mean by its variance over t / 6, and a first-order process of time constant T moves like a
    random walk within T: its variance over an interval is 2 sigma^2 (1 - exp(-interval / T)).
    """
    sixth_s = s_from_ns(sights[-1].host_ns - sights[0].host_ns) / 6.0
    times_s = priors.position_times_s
    moved = sum(2.0 - 2.0 * exp(-sixth_s / time_s) for time_s in times_s if time_s > 0.0) / len(times_s)
    return MEDIAN * median(sqrt(each.displaced_m2 + moved * each.position_m2) / each.range_m for each in sights)


class Sights(msgspec.Struct, frozen=True):
    """K sights as arrays, and their common points under M mounts (M, 3, 3)."""

    rays: Array
    """(K, 3), unit, camera axes."""
    ned_from_body: Array
    """(K, 3, 3)."""
    camera: Array
    """(K, 2), north and east of the camera, m."""
    drop_m: Array
    """(K), height of the camera above the target's ground, m."""

    def directions(self, mounts: Array) -> Array:
        """(M, K, 3) directions of the sights in NED."""
        return np.asarray(np.einsum("kab,mbc,kc->mka", self.ned_from_body, mounts, self.rays))

    def ground_points(self, directions: Array) -> tuple[Array, Mask]:
        """(M, K, 2) points on the ground, and whether the rays meet it."""
        below = directions[..., 2] > LEAST_DOWN
        reach = self.drop_m / np.where(below, directions[..., 2], 1.0)
        return self.camera + directions[..., :2] * reach[..., None], below

    def meeting(self, mounts: Array) -> list[CommonPoint]:
        """Common point under each mount. Spreads are angles: seen from afar, or steeply, all points lie close."""
        directions = self.directions(mounts)
        points, below = self.ground_points(directions)
        enough = 2 * below.sum(1) >= len(self.drop_m)
        middle = np.where(enough[:, None], median_of(points.swapaxes(1, 2), below[:, None, :]), 0.0)
        spreads = np.where(enough, self._apart(directions, middle), MISSED).tolist()
        return [CommonPoint(*each) for each in zip(mounts, spreads, middle, strict=True)]

    def missed(self, common: CommonPoint) -> float:
        """Median angle between these sights and the point where others met under the same mount, rad."""
        return float(self._apart(self.directions(common.body_from_camera[None]), common.point[None])[0])

    def _apart(self, directions: Array, points: Array) -> Array:
        to = points[:, None] - self.camera
        toward = np.concatenate((to, np.broadcast_to(self.drop_m[:, None], (*to.shape[:2], 1))), -1)
        toward /= np.sqrt((toward**2).sum(-1, keepdims=True))
        return np.asarray(np.sqrt(np.median(((directions - toward) ** 2).sum(-1), axis=1)))

    def misplaced_m(self, common: CommonPoint, configured: Array) -> float:
        """Median distance of the sights' points under the ``configured`` mount from a common point, metres."""
        points, below = self.ground_points(self.directions(configured[None]))
        apart = np.hypot(*(points[0] - common.point).T)[below[0]]
        return float(np.median(apart)) if len(apart) else 0.0


def sights_of(sights: Sequence[SingleSight]) -> Sights:
    """The sights as arrays."""
    return Sights(
        np.array([s.ray for s in sights]),
        np.array([s.ned_from_body for s in sights]),
        np.array([s.camera_ned[:2] for s in sights]),
        np.array([s.drop_m for s in sights]),
    )
