"""Pose of a pad by the corners that a picture shows: Gauss-Newton on all of them together.

Unknowns: the rotation ned_from_pad (forward, right, down of a pad that lies face up) and the pad's origin about the
reference camera, in NED axes. A point x of the pad is seen in the direction of

    v = R x + t - c,    d = v / |v|

with c the camera at the instant of the point's row. With P = d(pixel)/d(ray), the residual is P (ray - d) over the
corner's sigma, and, for a rotation error e (NED axes) and an origin error s,

    d(pixel) = P (I - d d^T) / |v| (e x R x + s).

Pads lie level but for TILT_SIGMA: two more residuals, the horizontal parts of the pad's normal. They decide where one
small tag far away fits two tilts (Collins and Bartoli 2014), and barely count where the corners show the tilt.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

TILT_SIGMA: Final = radians(5.0)
"""One sigma of a pad's tilt about north and east, radians: decks, ramps and lawns."""
LAYOUT_SIGMA_M: Final = 0.002
"""One sigma of a corner's place on the pad, metres: tags are glued, and measured with a ruler."""
LEAST_DOWN: Final = 0.05
"""Least down component of a unit ray to a corner: a pad nearer to the horizon is seen edge-on."""
ITERATIONS: Final = 12
LAST_STEP2: Final = 1e-12
"""Squared step in radians and in shares of the range at which the iteration ends."""
FLIPPED_TILT: Final = radians(3.0)
"""Tilt beyond which the mirrored tilt is tried, radians: below, both are one minimum."""
_FORWARD_RIGHT: Final = slice(0, 2)


@dataclass(frozen=True)
class SeenPoints:
    """M points of a pad as a picture shows them; NED axes about the reference camera."""

    at: Array
    """(M, 3) places on the pad: forward, right, down, metres."""
    rays: Array
    """(M, 3) unit rays, NED."""
    pixel_from_ray: Array
    """(M, 2, 3) d(pixel)/d(ray), NED."""
    camera: Array
    """(M, 3) camera at the instant of the point's row, minus the reference camera, metres."""
    sigma_px: Array
    """(M,) one sigma, each axis, pixels."""
    tag: NDArray[np.int64]
    """(M,) number of the point's tag."""

    def __len__(self) -> int:
        return len(self.at)

    def only(self, chosen: NDArray[np.bool_]) -> SeenPoints:
        """The chosen points."""
        return SeenPoints(
            self.at[chosen], self.rays[chosen], self.pixel_from_ray[chosen], self.camera[chosen],
            self.sigma_px[chosen], self.tag[chosen],
        )  # fmt: skip


@dataclass(frozen=True)
class PadPose:
    """A pad's pose about the reference camera."""

    ned_from_pad: Array
    """(3, 3) rotation."""
    origin: Array
    """(3,) the pad's origin minus the reference camera, NED, metres."""
    cov: Array
    """(6, 6) covariance of the rotation about NED axes, rad^2, and of the origin, m^2."""
    squares: Array
    """(M,) squared residual of each point over its variance; 2 expected of a point alone."""
    prior_square: float
    """Squared tilt over its variance."""

    @property
    def cost(self) -> float:
        """Sum of all squares."""
        return float(self.squares.sum()) + self.prior_square

    @property
    def heading(self) -> float:
        """Direction of the pad's forward axis from north, radians."""
        return float(np.arctan2(self.ned_from_pad[1, 0], self.ned_from_pad[0, 0]))

    @property
    def heading_sigma(self) -> float:
        """One sigma of the heading, radians."""
        return float(np.sqrt(self.cov[2, 2]))

    def place(self, at: Array) -> Array:
        """(3,) a point of the pad minus the reference camera, NED, metres."""
        place: Array = self.ned_from_pad @ at + self.origin
        return place

    def level_place(self, at: Array, middle: Array) -> tuple[Array, Array]:
        """(3,) a point level with the middle of the seen corners, as :meth:`place`, and its (3, 3) covariance, m^2.

        Beyond its tags a pad is ground, and level. By the tilt of one small tag a point 2 m beside it would rise and
        fall by decimetres. The heading's error times the distance is in the covariance.
        """
        beyond = self._level_rotation @ (at - middle)
        lever = self.ned_from_pad @ middle
        jacobian = np.hstack([-_skew(lever), np.eye(3)])  # (3, 6)
        jacobian[:, 2] += (-beyond[1], beyond[0], 0.0)  # a turn about down
        cov: Array = jacobian @ self.cov @ jacobian.T
        return lever + self.origin + beyond, cov

    @property
    def _level_rotation(self) -> Array:
        """(3, 3) rotation about down by the heading."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def level_pose(points: SeenPoints) -> tuple[Array, Array] | None:
    """Rotation and origin of a level pad, in closed form; None where a ray is too shallow, or all points are one.

    On a level pad at depth z, n + i e of a ray over its down component is a similarity of forward + i right: its slope
    is exp(i heading) / z.
    """
    down = points.rays[:, 2]
    if not len(points) or down.min() < LEAST_DOWN:
        return None
    seen = (points.rays[:, 0] + 1j * points.rays[:, 1]) / down
    at = points.at[:, 0] + 1j * points.at[:, 1]
    spread = at - at.mean()
    extent2 = float((spread * spread.conj()).real.sum())
    if extent2 <= 0.0:
        return None
    slope = complex((spread.conj() * seen).sum() / extent2)
    if slope == 0.0:
        return None
    depth, turn = 1.0 / abs(slope), slope / abs(slope)
    place = depth * (complex(seen.mean()) - slope * complex(at.mean()))
    rotation = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
    return rotation, np.array([place.real, place.imag, depth])


def pad_pose(points: SeenPoints) -> PadPose | None:
    """The pose that fits all points best; None where they do not determine one.

    Of two tilts that fit alike the one nearer to level is the answer: both have their tilt in the cost.
    """
    start = level_pose(points)
    if start is None:
        return None
    points = _with_layout_error(points, start[1])
    found = _minimum(points, *start)
    if found is None or found.ned_from_pad[2, 2] > np.cos(FLIPPED_TILT):
        return found
    other = _minimum(points, _mirrored(found) @ found.ned_from_pad, found.origin)
    return found if other is None or other.cost >= found.cost else other


def _minimum(points: SeenPoints, rotation: Array, origin: Array) -> PadPose | None:
    for _ in range(ITERATIONS):
        jacobian, residual = _linearized(points, rotation, origin)
        try:
            step = np.asarray(np.linalg.solve(jacobian.T @ jacobian, jacobian.T @ residual), np.float64)
        except np.linalg.LinAlgError:
            return None
        rotation, origin = _exp(step[:3]) @ rotation, origin + step[3:]
        range2 = float(origin @ origin)
        if not (np.isfinite(step).all() and range2 > 0.0):
            return None
        if float(step[:3] @ step[:3]) + float(step[3:] @ step[3:]) / range2 < LAST_STEP2:
            break
    jacobian, residual = _linearized(points, rotation, origin)
    try:
        cov = np.asarray(np.linalg.inv(jacobian.T @ jacobian), np.float64)
    except np.linalg.LinAlgError:
        return None
    faces_up, below = rotation[2, 2] > 0.0, origin[2] > 0.0
    if not (faces_up and below and np.isfinite(cov).all()):
        return None
    squares = (residual[:-2] ** 2).reshape(-1, 2).sum(axis=1)
    return PadPose(rotation, origin, cov, squares, float((residual[-2:] ** 2).sum()))


def _linearized(points: SeenPoints, rotation: Array, origin: Array) -> tuple[Array, Array]:
    """Jacobian (2 M + 2, 6) and residuals (2 M + 2,), each over its sigma; the last two are those of the tilt."""
    levers = points.at @ rotation.T  # (M, 3)
    to_point = levers + origin - points.camera
    ranges = np.linalg.norm(to_point, axis=1)
    directions = to_point / ranges[:, None]
    weight = 1.0 / points.sigma_px[:, None]
    residual = np.einsum("mij,mj->mi", points.pixel_from_ray, points.rays - directions) * weight  # (M, 2)
    along = np.einsum("mij,mj->mi", points.pixel_from_ray, directions)  # (M, 2)
    by_place = points.pixel_from_ray - along[..., None] * directions[:, None, :]  # (M, 2, 3)
    by_place = by_place * (weight / ranges[:, None])[..., None]
    (lx, ly, lz), (ax, ay, az) = levers.T[..., None], by_place.transpose(2, 0, 1)
    # a . (e x l) = e . (l x a); np.cross costs as much as all else here
    by_turn = np.stack([ly * az - lz * ay, lz * ax - lx * az, lx * ay - ly * ax], axis=-1)  # (M, 2, 3)
    normal = rotation[:, 2]
    tilt = np.zeros((2, 6))
    tilt[0, :3] = (0.0, normal[2], -normal[1])
    tilt[1, :3] = (-normal[2], 0.0, normal[0])
    jacobian = np.vstack([np.concatenate([by_turn, by_place], axis=2).reshape(-1, 6), tilt / TILT_SIGMA])
    return jacobian, np.concatenate([residual.ravel(), -normal[_FORWARD_RIGHT] / TILT_SIGMA])


def _with_layout_error(points: SeenPoints, origin: Array) -> SeenPoints:
    """The points with the error of their places on the pad in their sigmas, at this range."""
    px_per_rad = np.sqrt(0.5 * (points.pixel_from_ray**2).sum(axis=(1, 2)))  # (M,)
    by_layout = px_per_rad * LAYOUT_SIGMA_M / float(np.linalg.norm(origin))
    sigma_px = np.hypot(points.sigma_px, by_layout)
    return SeenPoints(points.at, points.rays, points.pixel_from_ray, points.camera, sigma_px, points.tag)


def _mirrored(pose: PadPose) -> Array:
    """The rotation of the pad's normal to its mirror image about the line of sight: the other tilt that fits."""
    sight, normal = pose.origin / np.linalg.norm(pose.origin), pose.ned_from_pad[:, 2]
    other = 2.0 * float(sight @ normal) * sight - normal
    axis = np.cross(normal, other)
    sine = float(np.linalg.norm(axis))
    if sine == 0.0:
        return np.eye(3)
    return _exp(axis / sine * np.arctan2(sine, float(normal @ other)))


def _exp(turn: Array) -> Array:
    """(3, 3) rotation of a rotation vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return np.eye(3) + _skew(turn)
    axis = _skew(turn / angle)
    rotation: Array = np.eye(3) + np.sin(angle) * axis + (1.0 - np.cos(angle)) * axis @ axis
    return rotation


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
