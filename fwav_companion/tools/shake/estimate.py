"""The estimate of ``check --shake``: delay, mount and sign errors from corners and attitudes, and what is not shown.

Steps: rate lag, tag poses, coarse alignment, sign errors, corner fit, and the judgement of its sigmas.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, hypot, radians
from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.mounts import describe_mount
from fwav_companion.geometry.rotations import difference, quaternion_from_matrix, rotate
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tools.shake.corner_fit import CornerFit, FitStart, fit_corners
from fwav_companion.tools.shake.correlation import CoarseAlignment, RateLag, align_coarsely, rate_lag
from fwav_companion.tools.shake.observations import (
    AttitudeAt,
    AttitudeSeries,
    TagObservation,
    TagObservations,
    crossed,
    observations_from_tags,
    square_poses,
)
from fwav_companion.tools.shake.sign_errors import CORNER_ORDER, NEAR, RATES, TURNED, UNNAMED, SignError, sign_error_of
from fwav_companion.types import AttitudeSample, Lens

LEAST_FRAMES: Final = 150
"""Least number of frames: five seconds of a common camera."""
LEAST_SIDE_PX: Final = 24.0
"""Shortest usable side of the tag: three pixels a module of an AprilTag. The noise of the corners hides the tilt of a
smaller square."""
MOST_PIXEL_SIGMA: Final = 2.0
"""Largest sigma of a corner, pixels. Any detector that finds corners is better."""
LEAST_CORRELATION: Final = 0.4
"""Below this the camera's turns and the attitude's are unrelated. Noise alone reaches 0.2."""
AS_GOOD: Final = 0.98
"""A second delay whose correlation is this share of the best one's is as good."""
LEAST_HEADING_CHANGE: Final = radians(60.0)
"""Least change of heading, radians, of the 90 deg that the user was asked to turn."""
LEAST_TURNED: Final = radians(0.5)
"""Least turn between two frames a tenth of a second apart, RMS, radians: less than 5 deg/s is not shaking."""
MOST_DELAY_SIGMA_S: Final = 0.005
MOST_MOUNT_SIGMA: Final = radians(0.5)
"""Estimates with larger sigmas are not reported: the priors of [uncertainty] are 10 ms and 1 deg."""
MOUNT_FLOOR: Final = radians(0.03)
"""One sigma of the corners' places on paper and through the lens, which no number of frames averages away."""


class ShakeData(msgspec.Struct, frozen=True, kw_only=True):
    """Inputs of the estimate."""

    tags: Sequence[TagObservation]
    attitude_at: AttitudeAt
    samples: Sequence[AttitudeSample]
    """Attitudes as received, for the lag of their rates."""
    lens: Lens
    body_from_camera: Matrix3
    """Configured mount."""
    tag_size_m: float
    readout_s: float
    readout_sigma_s: float
    attitude_noise: float
    """[uncertainty] attitude_noise_deg, radians."""
    clock_sigma_s: float
    """One sigma of the autopilot's clock against the host's, constant through the session."""
    stamp_sigma_s: float
    """One sigma of the delay of attitude stamps."""


class WithSigma(msgspec.Struct, frozen=True):
    """A number with its sigma."""

    value: float
    sigma: float


class ShakeEstimate(msgspec.Struct, frozen=True, kw_only=True):
    """Result of the estimate."""

    frames: int = 0
    """Number of frames in which the whole tag was seen."""
    side_px: float = 0.0
    """Shortest side of the tag in the image, median."""
    distance_m: float = 0.0
    """Distance from the camera to the tag by the tag's size, median, metres."""
    heading_change: float = 0.0
    """Largest difference between headings of the session, radians."""
    rates_rms: Vector3 = (0.0, 0.0, 0.0)
    """RMS rates of the body about its axes, rad/s."""
    correlation: float = 0.0
    """Correlation of the camera's turns and the attitude's, 0 to 1."""
    pixel_sigma: float | None = None
    """One sigma of a corner, one axis, pixels."""
    sign_errors: tuple[SignError, ...] = ()
    not_shown: tuple[str, ...] = ()
    """Parameters that could not be estimated, and why."""
    delay: WithSigma | None = None
    """Difference from the configured delay, seconds."""
    mount: tuple[WithSigma, WithSigma, WithSigma] | None = None
    """Correction of the configured mount: a rotation vector in body axes, radians."""
    body_from_camera: Matrix3 | None = None
    """The corrected mount."""
    rate_lag: RateLag | None = None


def estimate(data: ShakeData) -> ShakeEstimate:
    """Everything that the session shows."""
    lag = rate_lag(data.samples)
    result = ShakeEstimate(rate_lag=lag, sign_errors=_reversed_rates(lag))
    if lag is None:
        result = _not_shown(result, "lag of the rates: the autopilot sends none, or the vehicle turned too little")
    observations = observations_from_tags(data.tags, data.lens)
    result = msgspec.structs.replace(result, frames=len(observations))
    if len(observations) < LEAST_FRAMES:
        return _too_few(result, data.tags)
    attitudes = AttitudeSeries(data.attitude_at, data.tags[0].boot_ns)
    result = msgspec.structs.replace(
        result,
        side_px=float(np.median(observations.sides_px)),
        heading_change=_heading_change(observations, attitudes),
        rates_rms=_rates_rms(observations, attitudes),
    )
    if result.side_px < LEAST_SIDE_PX:
        small = f"the tag's side is {result.side_px:.0f} pixels, at least {LEAST_SIDE_PX:.0f} are needed"
        return _not_shown(result, f"camera: {small}: hold it nearer, or print a larger tag")
    return _aligned(data, observations, attitudes, result)


def _too_few(result: ShakeEstimate, tags: Sequence[TagObservation]) -> ShakeEstimate:
    if crossed(tags) > len(tags) / 2:
        return _not_shown(_with_error(result, CORNER_ORDER), "camera: the sides between its corners cross")
    seen = f"the tag was seen whole in {result.frames} frames, at least {LEAST_FRAMES} are needed"
    return _not_shown(result, f"camera: {seen}")


def _aligned(
    data: ShakeData, observations: TagObservations, attitudes: AttitudeSeries, result: ShakeEstimate
) -> ShakeEstimate:
    """The result with coarse alignment, sign errors and, where the signs permit, the corner fit."""
    times_s = observations.times_s + data.readout_s * observations.rows.mean(axis=1)
    camera_from_tag, middles = square_poses(observations.global_shutter_rays(data.readout_s))
    distance_m = data.tag_size_m * float(np.median(np.linalg.norm(middles, axis=1)))
    result = msgspec.structs.replace(result, distance_m=distance_m)
    alignment = align_coarsely(times_s, camera_from_tag, attitudes)
    if alignment is None:
        return _not_shown(result, "camera: attitudes are missing for most of the frames")
    result = msgspec.structs.replace(result, correlation=alignment.correlation)
    refusal = _refusal(alignment)
    if refusal:
        return _not_shown(result, refusal)
    error = sign_error_of(alignment, np.array(data.body_from_camera).T, backward=observations.backward)
    if error is None and _looks_away(alignment, observations, camera_from_tag, attitudes):
        error = UNNAMED
    if error is not None:
        result = _with_error(result, error)
        if not error.fixed_by_mount:
            return _not_shown(result, "delay and mount: correct the signs first")
    start = FitStart(
        delay_s=alignment.delay_s,
        camera_from_body=alignment.camera_from_body,
        readout_s=data.readout_s,
        readout_sigma_s=data.readout_sigma_s,
        attitude_noise=data.attitude_noise,
    )
    found = fit_corners(observations, attitudes, start, data.tag_size_m)
    if found is None or found.pixel_sigma > MOST_PIXEL_SIGMA:
        return _not_shown(result, "delay and mount: the corners do not agree with the attitudes")
    return _with_known_parts(data, found, result)


def _looks_away(
    alignment: CoarseAlignment, observations: TagObservations, camera_from_tag: Rotation, attitudes: AttitudeSeries
) -> bool:
    """Whether the tag would face the ground and not the sky with this mount: no camera could see that."""
    ned_from_body, known = attitudes.at(observations.times_s - alignment.delay_s)
    down_by_attitude = ned_from_body.as_matrix()[known, 2, :] @ alignment.camera_from_body.T
    down_by_tag = camera_from_tag.as_matrix()[known, :, 2]
    return bool((down_by_attitude * down_by_tag).sum(axis=1).mean() < 0.0)


def _refusal(alignment: CoarseAlignment) -> str:
    """Why the turns do not show delay and mount; "" if they do."""
    if np.sort(alignment.turned)[1] < LEAST_TURNED:
        return "delay and mount: too little shaking about two axes"
    if alignment.correlation < LEAST_CORRELATION:
        return "delay and mount: the camera turns otherwise than the autopilot's attitude: is it on this vehicle?"
    if alignment.rival_correlation > AS_GOOD * alignment.correlation:
        return "delay and mount: shaken too evenly, a delay one period later fits as well: shake without a rhythm"
    return ""


def _with_known_parts(data: ShakeData, found: CornerFit, result: ShakeEstimate) -> ShakeEstimate:
    """The result with delay and mount where their sigmas are small enough."""
    result = msgspec.structs.replace(result, frames=found.frames, pixel_sigma=found.pixel_sigma)
    delay_sigma_s = hypot(float(found.sigmas[0]), data.clock_sigma_s, data.stamp_sigma_s)
    if delay_sigma_s <= MOST_DELAY_SIGMA_S:
        result = msgspec.structs.replace(result, delay=WithSigma(found.delay_s, delay_sigma_s))
    else:
        result = _not_shown(result, f"delay: known to {1e3 * delay_sigma_s:.0f} ms only: shake faster")
    sigmas = [hypot(float(sigma), MOUNT_FLOOR) for sigma in found.sigmas[1:4]]
    reasons = _mount_not_shown(sigmas, result.heading_change)
    if reasons:
        return _not_shown(result, *reasons)
    mount = _matrix3(found)
    correction = _correction(mount, data.body_from_camera)
    known = tuple(WithSigma(value, sigma) for value, sigma in zip(correction, sigmas, strict=True))
    result = msgspec.structs.replace(result, mount=known, body_from_camera=mount)
    if not any(error.fixed_by_mount for error in result.sign_errors) and hypot(*correction) > NEAR:
        far = f"mount {degrees(hypot(*correction)):.0f} deg from the configured one: {describe_mount(mount)}"
        result = _with_error(result, SignError(far, TURNED, fixed_by_mount=True))
    return result


def _mount_not_shown(sigmas: Sequence[float], heading_change: float) -> list[str]:
    if heading_change < LEAST_HEADING_CHANGE:
        seen = f"never turned by 90 deg, the heading changed by {degrees(heading_change):.0f} deg"
        return [f"mount: {seen}, so that it cannot be separated from the slope of the ground"]
    return [
        f"mount {axis}: known to {degrees(sigma):.1f} deg only: shake wider, with more light, over a larger print"
        for axis, sigma in zip(("roll", "pitch", "yaw"), sigmas, strict=True)
        if sigma > MOST_MOUNT_SIGMA
    ]


def _heading_change(observations: TagObservations, attitudes: AttitudeSeries) -> float:
    """Difference between the tenth and the ninetieth percentile of the headings, radians."""
    ned_from_body, known = attitudes.at(observations.times_s)
    if not known.any():
        return 0.0
    nose = ned_from_body.as_matrix()[known, :, 0]
    low, high = np.percentile(np.unwrap(np.arctan2(nose[:, 1], nose[:, 0])), [10.0, 90.0])
    return float(high - low)


def _rates_rms(observations: TagObservations, attitudes: AttitudeSeries) -> Vector3:
    rates, known = attitudes.rates(observations.times_s)
    if not known.any():
        return (0.0, 0.0, 0.0)
    roll, pitch, yaw = np.sqrt((rates[known] ** 2).mean(axis=0)).tolist()
    return (roll, pitch, yaw)


def _reversed_rates(lag: RateLag | None) -> tuple[SignError, ...]:
    axes = () if lag is None else lag.reversed_axes
    return tuple(SignError(f"{axis} rate reversed", RATES, fixed_by_mount=False) for axis in axes)


def _correction(mount: Matrix3, configured: Matrix3) -> Vector3:
    """Rotation vector in body axes: mount = Exp(correction) configured."""
    new, old = quaternion_from_matrix(mount), quaternion_from_matrix(configured)
    return rotate(old, difference(new, old))


def _matrix3(found: CornerFit) -> Matrix3:
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in found.body_from_camera)
    return (a, b, c)


def _not_shown(result: ShakeEstimate, *reasons: str) -> ShakeEstimate:
    return msgspec.structs.replace(result, not_shown=(*result.not_shown, *reasons))


def _with_error(result: ShakeEstimate, error: SignError) -> ShakeEstimate:
    return msgspec.structs.replace(result, sign_errors=(*result.sign_errors, error))
