"""A sighting as a measurement of two pixels, predicted from a target and from what self-calibration estimates.

The prediction is exact geometry, the residual is told in pixels through the lens's own derivatives, and every row is
d(predicted pixel)/d(unknown). Working with rays instead of ground points keeps the noise where it arises: a pixel of a
shallow ray is as good as any other, only its point on the ground is not.
"""

from __future__ import annotations

from enum import IntEnum
from functools import lru_cache
from math import cos, sin

import msgspec

from fwav_companion.geometry.rotations import Quaternion, conjugate, exp, matrix_from_quaternion, multiply, rotate
from fwav_companion.geometry.vectors import (
    Matrix3,
    Vector3,
    add,
    cross,
    dot,
    norm,
    scale,
    subtract,
    transform,
    transpose,
)
from fwav_companion.self_calibration.delayed_poses import DelayedPoses, VehiclePose
from fwav_companion.types import ErrorPriors, GroundFix


class SharedParameter(IntEnum):
    """What all targets share, in the order of every vector of the joint estimate."""

    DELAY = 0
    """Of the camera's stamps beyond the configured time offset, s."""
    MOUNT_X = 1
    """Rotation vector c of the mount's correction, body axes: the true mount is Exp(c) times the configured one."""
    MOUNT_Y = 2
    MOUNT_Z = 3
    HEADING = 4
    """Told minus true, rad."""
    HEIGHT = 5
    """Camera above ground, told minus true, m."""
    READOUT = 6
    """True minus configured, s."""
    NORTH = 7
    """Vehicle's position, told minus true, m."""
    EAST = 8


COMMON_COUNT = len(SharedParameter)


class PixelMeasurement(msgspec.Struct, frozen=True, gc=False):
    """What is kept of one sighting."""

    track: int
    host_ns: int
    boot_ns: int
    ray: Vector3
    """Unit, in the body as the configuration mounts the camera; so are the next two."""
    by_u: Vector3
    """Dual to the lens's derivatives: by_u . (change of the ray) is the change of u."""
    by_v: Vector3
    pixel_sigma: tuple[float, float]
    attitude_sigma: float
    """What interpolation adds, rad."""
    attitude_spacing_s: float
    """Between the attitudes that it was interpolated from."""
    time_noise_s: float
    row_fraction: float
    lever: Vector3
    """Camera in the body, m."""
    drop_m: float
    """Height of the camera above the target's ground, as told."""
    camera_down: float
    course: DelayedPoses
    since_s: float
    """Since the glimpse of this track before; what shares its telemetry averages with the telemetry only."""


class PredictedPixel(msgspec.Struct, frozen=True, gc=False):
    """The pixel residual, measured minus predicted, and the rows of its prediction."""

    residual: tuple[float, float]
    rows: tuple[tuple[float, ...], tuple[float, ...]]
    """Of u and v: by each of Common, then by north and east of the target."""

    @property
    def by_common(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The first part of the rows."""
        return (self.rows[0][:COMMON_COUNT], self.rows[1][:COMMON_COUNT])

    @property
    def by_target(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The second part."""
        return (self.rows[0][COMMON_COUNT:], self.rows[1][COMMON_COUNT:])


def pixel_measurement(track: int, fix: GroundFix, course: DelayedPoses, since_s: float) -> PixelMeasurement:
    """What is kept of a fix."""
    sighting = fix.sighting
    state, mount = sighting.state, sighting.body_from_camera
    by_u, by_v = _dual(sighting.ray.d_du, sighting.ray.d_dv)
    arm = subtract(sighting.camera_ned, state.position_ned) if state.position_ned is not None else sighting.camera_ned
    return PixelMeasurement(
        track,
        sighting.frame_host_ns,
        sighting.boot_ns,
        transform(mount, sighting.ray.direction),
        transform(mount, by_u),
        transform(mount, by_v),
        sighting.pixel_sigma,
        state.carrier_sigma,
        state.spacing_s,
        sighting.time_noise_s,
        sighting.row_fraction,
        rotate(conjugate(state.ned_from_carrier), arm),
        fix.position_ned[2] - sighting.camera_ned[2],
        sighting.camera_ned[2],
        course,
        since_s,
    )


LEAST_COSINE = 0.01
"""Between a ray and its prediction, 89.4 degrees. Rows grow with the square of its inverse: nearer to a right angle
they exceed the pixel's own noise by more than a double resolves, and covariances are no longer any."""


class CameraPose(msgspec.Struct, frozen=True, gc=False):
    """How the camera stood at a glimpse, by some values of the common unknowns."""

    moment: VehiclePose
    """The vehicle."""
    correction: Quaternion
    """Of the mount."""
    ned_from_mounted: Matrix3
    """By the told heading."""
    heading: tuple[float, float]
    """Cosine and sine of the heading's error."""
    camera: Vector3
    """North, east, and height above the target's ground, m."""

    def ground_point(self, ray: Vector3) -> tuple[float, float] | None:
        """North and east where a ray of the mounted camera meets the ground; None where it does not."""
        x, y, z = transform(self.ned_from_mounted, ray)
        if z <= 0.02:
            return None
        (c, s), (north, east, below) = self.heading, self.camera
        reach = below / z
        return (north + reach * (c * x + s * y), east + reach * (c * y - s * x))


def predict(
    glimpse: PixelMeasurement, target: tuple[float, float], common: tuple[float, ...], stance: CameraPose | None = None
) -> PredictedPixel | None:
    """The residual and rows at one point of linearization; None where the target would lie too far beside the ray.

    ``stance``: of this glimpse by these common values, where it is at hand.
    """
    stance = stance or camera_pose(glimpse, common)
    moment, correction, ned_from_mounted = stance.moment, stance.correction, stance.ned_from_mounted
    rn, re, rd = ned_from_mounted  # the told axes of the world, as the mounted camera has them
    (c, s), camera = stance.heading, stance.camera
    north, east, below = target[0] - camera[0], target[1] - camera[1], camera[2]
    told_n, told_e = c * north - s * east, s * north + c * east  # as the told heading would have it
    seen = transform(transpose(ned_from_mounted), (told_n, told_e, below))
    depth = dot(seen, glimpse.ray)
    if depth <= LEAST_COSINE * norm(seen):
        return None
    # How what is seen changes with each unknown; the mount's correction is left to the rows.
    by_north, by_east, by_heading = _mixed(c, rn, s, re), _mixed(c, re, -s, rn), _mixed(told_n, re, -told_e, rn)
    vn, ve, vd = moment.velocity_ned
    turning = cross(rotate(conjugate(correction), moment.rates), seen)
    by_delay = add(add(turning, _mixed(vn, by_north, ve, by_east)), scale(rd, vd))
    mount_vector = (common[SharedParameter.MOUNT_X], common[SharedParameter.MOUNT_Y], common[SharedParameter.MOUNT_Z])
    rows = []
    residual = []
    for dual in (glimpse.by_u, glimpse.by_v):
        offset = dot(dual, seen) / depth
        residual.append(-offset)
        by_seen = _mixed(1.0 / depth, dual, -offset / depth, glimpse.ray)
        turn = cross(by_seen, seen)
        # a step of the rotation vector is not quite a rotation: to first order in the correction itself
        mx, my, mz = subtract(turn, scale(cross(turn, mount_vector), 0.5))
        delay, n, e = dot(by_seen, by_delay), dot(by_seen, by_north), dot(by_seen, by_east)
        readout = -glimpse.row_fraction * delay
        rows.append((delay, mx, my, mz, dot(by_seen, by_heading), -dot(by_seen, rd), readout, n, e, n, e))
    return PredictedPixel((residual[0], residual[1]), (rows[0], rows[1]))


def camera_pose(glimpse: PixelMeasurement, common: tuple[float, ...]) -> CameraPose:
    """How the camera stood by these common values."""
    moment = glimpse.course.at(common[SharedParameter.DELAY] - common[SharedParameter.READOUT] * glimpse.row_fraction)
    correction = _correction(common[SharedParameter.MOUNT_X : SharedParameter.HEADING])
    north, east, down = add(moment.position_ned, rotate(moment.ned_from_body, glimpse.lever))
    below = glimpse.drop_m - (down - glimpse.camera_down) - common[SharedParameter.HEIGHT]
    return CameraPose(
        moment,
        correction,
        matrix_from_quaternion(multiply(moment.ned_from_body, correction)),
        (cos(common[SharedParameter.HEADING]), sin(common[SharedParameter.HEADING])),
        (north - common[SharedParameter.NORTH], east - common[SharedParameter.EAST], below),
    )


@lru_cache(maxsize=64)
def _correction(mount: Vector3) -> Quaternion:
    """Asked over and over about one point of linearization."""
    return exp(mount)


def _mixed(a: float, x: Vector3, b: float, y: Vector3) -> Vector3:
    """A x + b y."""
    return (a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2])


TELEMETRY_STEP_S = 0.1
"""Height and position arrive at 10 Hz and are interpolated: frames that come faster share their noise, and that of the
attitudes where those come no faster."""


def pixel_noise(
    glimpse: PixelMeasurement, prediction: PredictedPixel, priors: ErrorPriors
) -> tuple[float, float, float]:
    """Covariance of the residual by everything fresh in this glimpse, px^2: uu, uv, vv."""
    repeated, turned = _repeated(TELEMETRY_STEP_S, glimpse), _repeated(glimpse.attitude_spacing_s, glimpse)
    attitude = priors.attitude_noise**2 * turned + glimpse.attitude_sigma**2
    height, place = priors.height_noise_m**2 * repeated, priors.position_noise_m**2 * repeated
    (u_sigma, v_sigma), time = glimpse.pixel_sigma, glimpse.time_noise_s**2
    (ut, ux, uy, uz, _, uh, _, un, ue, *_), (vt, vx, vy, vz, _, vh, _, vn, ve, *_) = prediction.rows
    uu = attitude * (ux * ux + uy * uy + uz * uz) + height * uh * uh + place * (un * un + ue * ue)
    uv = attitude * (ux * vx + uy * vy + uz * vz) + height * uh * vh + place * (un * vn + ue * ve)
    vv = attitude * (vx * vx + vy * vy + vz * vz) + height * vh * vh + place * (vn * vn + ve * ve)
    return (uu + time * ut * ut + u_sigma * u_sigma, uv + time * ut * vt, vv + time * vt * vt + v_sigma * v_sigma)


def _repeated(step_s: float, glimpse: PixelMeasurement) -> float:
    """How many glimpses share one sample of telemetry that comes at such steps."""
    return max(1.0, step_s / max(glimpse.since_s, 1e-3)) if glimpse.since_s > 0.0 else 1.0


def _dual(a: Vector3, b: Vector3) -> tuple[Vector3, Vector3]:
    """Two vectors in the plane of a and b with a* . a = 1, a* . b = 0, and so on."""
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    s = 1.0 / (aa * bb - ab * ab)
    return (
        subtract(scale(a, bb * s), scale(b, ab * s)),
        subtract(scale(b, aa * s), scale(a, ab * s)),
    )
