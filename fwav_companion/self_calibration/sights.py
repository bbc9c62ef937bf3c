"""Single sights of static targets, and how well they meet in one place under any mount of the camera."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, subtract
from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.filter_pass import median_of
from fwav_companion.types import GroundFix, VehicleState

LEAST_DOWN = 0.05
"""Down component of a unit ray: 3 degrees below the horizon; a flatter ray meets the ground anywhere."""


class SingleSight(msgspec.Struct, frozen=True, gc=False):
    """A fix without the mount."""

    host_ns: HostNs
    label: str
    ray: Vector3
    """Unit, camera axes."""
    body_from_camera: Matrix3
    """Mount as configured; of a camera on a gimbal in the gimbal's axes, and so is the next."""
    ned_from_body: Matrix3
    camera_ned: Vector3
    drop_m: float
    """From the camera down to the target's ground."""


class CommonPoint(msgspec.Struct, frozen=True):
    """The point where sights meet under a mount, and how well."""

    body_from_camera: Array
    """(3, 3), the mount; also one that mirrors."""
    spread: float
    """Median angle between a sight and the point, rad; about 3e2 and more where half of them miss the ground."""
    point: Array
    """(2), north and east."""


MISSED = 1e3
"""Spread where half of the sights miss the ground."""


def sight_of(fix: GroundFix, state: VehicleState) -> SingleSight:
    """The sight of a fix; ``state``: the vehicle at its capture by the delay that is known."""
    sighting = fix.sighting
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
        fix.drop_m - moved[2],
    )


class Sights(msgspec.Struct, frozen=True):
    """Sights as arrays of K, and their meeting under M mounts (M, 3, 3)."""

    rays: Array
    ned_from_body: Array
    camera: Array
    """(K, 2)."""
    drop_m: Array

    def directions(self, mounts: Array) -> Array:
        """(M, K, 3) directions in NED."""
        return np.asarray(np.einsum("kab,mbc,kc->mka", self.ned_from_body, mounts, self.rays))

    def ground_points(self, directions: Array) -> tuple[Array, Mask]:
        """(M, K, 2) points on the ground, and whether the rays meet it."""
        below = directions[..., 2] > LEAST_DOWN
        reach = self.drop_m / np.where(below, directions[..., 2], 1.0)
        return self.camera + directions[..., :2] * reach[..., None], below

    def meeting(self, mounts: Array) -> list[CommonPoint]:
        """The common points under these mounts. In angles: seen from afar, or steeply, all points lie close."""
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
        """Median distance of the sights as configured from their common point, metres."""
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
