"""A sighting as a measurement of two pixels, predicted from a target and from what self-calibration estimates.

The prediction is exact geometry, the residual is told in pixels through the lens's own derivatives, and every row is
d(predicted pixel)/d(unknown). Working with rays instead of ground points keeps the noise where it arises: a pixel of a
shallow ray is as good as any other, only its point on the ground is not.
"""

from __future__ import annotations

from enum import IntEnum
from math import cos, sin

import msgspec

from fwav_companion.geometry.rotations import conjugate, exp, matrix_from_quaternion, rotate
from fwav_companion.geometry.vectors import Matrix3, Vector3, cross, dot, norm, scale, subtract, transform, transpose
from fwav_companion.nouns import ErrorPriors, GroundFix
from fwav_companion.tracking.course import Course


class Common(IntEnum):
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


COMMON_COUNT = len(Common)


class Glimpse(msgspec.Struct, frozen=True, gc=False):
    """What is kept of one sighting."""

    track: int
    host_ns: int
    boot_ns: int
    ray: Vector3
    """Unit, camera frame."""
    by_u: Vector3
    """Dual to the lens's derivatives: by_u . (change of the ray) is the change of u."""
    by_v: Vector3
    pixel_sigma: tuple[float, float]
    attitude_sigma: float
    """What interpolation adds, rad."""
    time_noise_s: float
    row_fraction: float
    body_from_camera: Matrix3
    lever: Vector3
    """Camera in the body, m."""
    drop_m: float
    """Height of the camera above the target's ground, as told."""
    camera_down: float
    course: Course
    since_s: float
    """Since the glimpse of this track before; what shares its telemetry averages with the telemetry only."""


class Prediction(msgspec.Struct, frozen=True, gc=False):
    """The pixel residual, measured minus predicted, and the rows of its prediction."""

    residual: tuple[float, float]
    by_common: tuple[tuple[float, ...], tuple[float, ...]]
    by_target: tuple[tuple[float, float], tuple[float, float]]
    """By north and east of the target."""


def glimpse_of(track: int, fix: GroundFix, course: Course, since_s: float) -> Glimpse:
    """What is kept of a fix."""
    sighting = fix.sighting
    ray, by_u, by_v = sighting.ray.direction, *_dual(sighting.ray.d_du, sighting.ray.d_dv)
    state = sighting.state
    arm = subtract(sighting.camera_ned, state.position_ned) if state.position_ned is not None else sighting.camera_ned
    return Glimpse(
        track,
        sighting.frame_host_ns,
        sighting.boot_ns,
        ray,
        by_u,
        by_v,
        sighting.pixel_sigma,
        state.carrier_sigma,
        sighting.time_noise_s,
        sighting.row_fraction,
        sighting.body_from_camera,
        rotate(conjugate(state.ned_from_carrier), arm),
        fix.position_ned[2] - sighting.camera_ned[2],
        sighting.camera_ned[2],
        course,
        since_s,
    )


LEAST_COSINE = 0.01
"""Between a ray and its prediction, 89.4 degrees. Rows grow with the square of its inverse: nearer to a right angle
they exceed the pixel's own noise by more than a double resolves, and covariances are no longer any."""


def predict(glimpse: Glimpse, target: tuple[float, float], common: tuple[float, ...]) -> Prediction | None:
    """The residual and rows at one point of linearization; None where the target would lie too far beside the ray."""
    moment = glimpse.course.at(common[Common.DELAY] - common[Common.READOUT] * glimpse.row_fraction)
    ned_from_body = matrix_from_quaternion(moment.ned_from_body)
    camera = _camera(glimpse, moment.position_ned, ned_from_body)
    north = target[0] - camera[0] + common[Common.NORTH]
    east = target[1] - camera[1] + common[Common.EAST]
    below = glimpse.drop_m - (camera[2] - glimpse.camera_down) - common[Common.HEIGHT]
    c, s = cos(common[Common.HEADING]), sin(common[Common.HEADING])
    told = (c * north - s * east, s * north + c * east, below)  # as the told heading would have it
    body = transform(transpose(ned_from_body), told)
    mount_vector = (common[1], common[2], common[3])
    correction = matrix_from_quaternion(exp(mount_vector))
    mounted = transform(transpose(correction), body)
    seen = transform(transpose(glimpse.body_from_camera), mounted)
    depth = dot(seen, glimpse.ray)
    if depth <= LEAST_COSINE * norm(seen):
        return None
    rows = []
    residual = []
    for dual in (glimpse.by_u, glimpse.by_v):
        offset = dot(dual, seen) / depth
        residual.append(-offset)
        by_camera = scale(subtract(dual, scale(glimpse.ray, offset)), 1.0 / depth)
        by_mounted = transform(glimpse.body_from_camera, by_camera)
        by_body = transform(correction, by_mounted)
        by_told = transform(ned_from_body, by_body)
        by_north, by_east = c * by_told[0] + s * by_told[1], c * by_told[1] - s * by_told[0]
        vn, ve, vd = moment.velocity_ned
        by_delay = dot(by_body, cross(moment.rates, body)) + by_north * vn + by_east * ve + by_told[2] * vd
        turn = cross(by_mounted, mounted)
        # a step of the rotation vector is not quite a rotation: to first order in the correction itself
        mx, my, mz = subtract(turn, scale(cross(turn, mount_vector), 0.5))
        by_heading = by_told[1] * told[0] - by_told[0] * told[1]
        by_readout = -glimpse.row_fraction * by_delay
        rows.append((by_delay, mx, my, mz, by_heading, -by_told[2], by_readout, by_north, by_east))
    return Prediction(
        (residual[0], residual[1]),
        (rows[0], rows[1]),
        ((rows[0][Common.NORTH], rows[0][Common.EAST]), (rows[1][Common.NORTH], rows[1][Common.EAST])),
    )


def ground_point(glimpse: Glimpse, common: tuple[float, ...]) -> tuple[float, float] | None:
    """North and east where the ray meets the ground under these common values; None where it does not."""
    moment = glimpse.course.at(common[Common.DELAY] - common[Common.READOUT] * glimpse.row_fraction)
    ned_from_body = matrix_from_quaternion(moment.ned_from_body)
    camera = _camera(glimpse, moment.position_ned, ned_from_body)
    mounted = transform(glimpse.body_from_camera, glimpse.ray)
    turned = transform(matrix_from_quaternion(exp((common[1], common[2], common[3]))), mounted)
    x, y, z = transform(ned_from_body, turned)
    if z <= 0.02:
        return None
    c, s = cos(common[Common.HEADING]), sin(common[Common.HEADING])
    below = glimpse.drop_m - (camera[2] - glimpse.camera_down) - common[Common.HEIGHT]
    reach = below / z
    return (
        camera[0] - common[Common.NORTH] + reach * (c * x + s * y),
        camera[1] - common[Common.EAST] + reach * (c * y - s * x),
    )


TELEMETRY_STEP_S = 0.1
"""Height and position arrive at 10 Hz and are interpolated: frames that come faster share their noise."""


def pixel_noise(glimpse: Glimpse, prediction: Prediction, priors: ErrorPriors) -> tuple[float, float, float]:
    """Covariance of the residual by everything fresh in this glimpse, px^2: uu, uv, vv."""
    repeated = max(1.0, TELEMETRY_STEP_S / max(glimpse.since_s, 1e-3)) if glimpse.since_s > 0.0 else 1.0
    attitude = priors.attitude_noise**2 + glimpse.attitude_sigma**2
    height, place = priors.height_noise_m**2 * repeated, priors.position_noise_m**2 * repeated
    time = glimpse.time_noise_s**2
    u, v = prediction.by_common
    weights = (time, attitude, attitude, attitude, 0.0, height, 0.0, place, place)
    uu = uv = vv = 0.0
    for a, b, w in zip(u, v, weights, strict=True):
        if w:
            uu, uv, vv = uu + w * a * a, uv + w * a * b, vv + w * b * b
    su, sv = glimpse.pixel_sigma
    return (uu + su * su, uv, vv + sv * sv)


def _camera(glimpse: Glimpse, position: Vector3, ned_from_body: Matrix3) -> Vector3:
    x, y, z = transform(ned_from_body, glimpse.lever)
    return (position[0] + x, position[1] + y, position[2] + z)


def _dual(a: Vector3, b: Vector3) -> tuple[Vector3, Vector3]:
    """Two vectors in the plane of a and b with a* . a = 1, a* . b = 0, and so on."""
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    s = 1.0 / (aa * bb - ab * ab)
    return (
        subtract(scale(a, bb * s), scale(b, ab * s)),
        subtract(scale(b, aa * s), scale(a, ab * s)),
    )
