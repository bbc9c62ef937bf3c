"""Assessment of a joint estimate: its observable parameters, its status and the places of its targets.

The estimate is the posterior of all parameters: an unobservable one stays at its prior and is included in every
covariance. The places are published once the mount is observable. The reported mount includes the heading error, which
is nearly inseparable from it while the tilt varies little.
"""

from __future__ import annotations

from collections.abc import Collection

import msgspec
import numpy as np

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibrated_fix import KnownParameters, known_parameters
from fwav_companion.self_calibration.calibrated_places import CalibratedPlace, calibrated_places
from fwav_companion.self_calibration.calibration_report import (
    CalibrationStatus,
    KeptCalibration,
    PriorInflation,
    SharedParameter,
)
from fwav_companion.self_calibration.innovation_consistency import InnovationConsistency
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.pixel_measurement import MOUNT
from fwav_companion.self_calibration.posterior import (
    MOUNT_AXES,
    NUISANCE,
    root_given,
    with_drift,
)
from fwav_companion.self_calibration.prior_inflation import is_plausible, prior_inflations

DELAY_OBSERVABLE = 0.5
MOUNT_OBSERVABLE = 0.35
"""Posterior sigma over prior sigma below which a parameter is reported: its error is then much below its prior."""
RETAINED = 1.1
"""Multiple of the bounds up to which a parameter that was reported stays reported: drifting innovations widen its
sigma, and the places would jump back and forth at the bound. With 1.25, the estimate is believed too long where the
heading wanders by 2 degrees in 20 s: one of six figure-eights ended with a normalised squared error of 53."""
MOST_DRIFT = 6.0
"""Factor of drifting innovations beyond which no constant mount explains the flight. Where all errors are constant it
is 1 to 2.8 over descents, circles and eights, and 5 where something walks among the targets; with a heading that
wanders by 2 degrees in 20 s it ends at 9 and 10."""
STEADY = 0.6
"""Share of the attitude stamps' sigma that is one constant error throughout a flight. It is all of it if the sender's
loop sends at one phase of itself, nothing if it sends at any phase, and flights do not show which. A third of the
variance claims neither too much in the one case nor twice too little in the other."""


class Assessment(msgspec.Struct, frozen=True):
    """Assessment of a joint estimate at one instant."""

    status: CalibrationStatus
    parameters: dict[int, tuple[float, float]]
    """Mean and one sigma of each observable parameter; the mount includes the heading error."""
    keep: KeptCalibration | None
    """Calibration for the next flight; its mount excludes the heading error, which differs between flights."""
    denied: tuple[PriorInflation, ...]
    """Priors of the configuration that the flight contradicts."""
    constant: bool
    """Whether a constant mount explains the flight: the innovations drift no more than with constant errors."""
    mount_known: float
    """Largest posterior sigma of the mount across the line of sight, in units of its prior sigma."""
    position_delay_share: float
    """Posterior mean square of the position delay over the variance of its configured prior; 1 without a prior."""
    known: KnownParameters
    """Shared parameters of the posterior, by which fixes are corrected."""
    places: dict[int, CalibratedPlace]
    """Places of the targets, by track."""


def assessed(
    joint: JointFilter,
    priors: tuple[Array, Array],
    *,
    axes: tuple[Vector3, Vector3] = ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
    drift: InnovationConsistency | None = None,
    before: Assessment | None = None,
    stamp_sigma_s: float = 0.0,
    photographs: bool = False,
) -> Assessment:
    """The assessment of a joint estimate.

    ``priors``: means and one sigma of the shared parameters. ``axes``: mean directions in the body, down and toward the
    targets. ``before``: the previous assessment. ``stamp_sigma_s``: one sigma of the attitude stamps, s.
    ``photographs``: whether no shaking shows the delay, only motion as slow as the errors that wander.
    """
    means, sigmas = priors
    denied = prior_inflations(joint, means, sigmas)
    for each in denied:
        joint = joint.inflated(each)
    sigmas = widened(sigmas, denied)
    factor, shown = (1.0, 1.0) if drift is None else (drift.factor, drift.shown)
    # Where a wrong prior biased the estimate, the innovations are biased as well and do not show what wanders.
    mount_known = _mount_known(joint, sigmas, 1.0 if denied else shown, axes[1])
    mean, cov = joint.mean[0], with_drift(joint, sigmas, factor)
    delay_s, delay_sigma_s = float(mean[0]), float(np.sqrt((cov if photographs else joint.cov[0])[0, 0]))
    status, parameters, keep = CalibrationStatus.WAITING, dict[int, tuple[float, float]](), None
    if delay_sigma_s <= DELAY_OBSERVABLE * _retained(before, SharedParameter.DELAY) * sigmas[SharedParameter.DELAY]:
        status, parameters[SharedParameter.DELAY] = CalibrationStatus.TIME, (delay_s, delay_sigma_s)
    mount_retained = _retained(before, SharedParameter.MOUNT_X)
    plausible = is_plausible(joint, means, sigmas)
    drifts_little = bool(denied) or shown <= MOST_DRIFT * mount_retained
    drifted_little = before is not None and before.constant and shown <= MOST_DRIFT * RETAINED
    if plausible and drifts_little and mount_known <= MOUNT_OBSERVABLE * mount_retained:
        status, keep = CalibrationStatus.CALIBRATED, _kept(mean, cov, delay_sigma_s, stamp_sigma_s)
        parameters |= {SharedParameter.HEIGHT: _estimate(mean, cov, SharedParameter.HEIGHT)}
        parameters |= _with_heading(mean, cov, axes[0])
    return Assessment(
        status=status,
        parameters=parameters,
        keep=keep,
        denied=denied,
        constant=plausible and (drifts_little or drifted_little),
        mount_known=mount_known,
        position_delay_share=_position_delay_share(mean, cov, float(priors[1][SharedParameter.POSITION_DELAY])),
        known=known_parameters(mean, cov, joint.priors),
        places=calibrated_places(joint, (mean, cov), (means, sigmas)),
    )


def _retained(before: Assessment | None, parameter: int) -> float:
    """Factor on the bound of a parameter: wider if the previous assessment reported the parameter."""
    return RETAINED if before is not None and parameter in before.parameters else 1.0


def widened(sigmas: Array, denied: Collection[PriorInflation]) -> Array:
    """The prior sigmas with those of contradicted priors widened."""
    sigmas = sigmas.copy()
    for each in denied:
        sigmas[each.parameter] = each.wider_sigma
    return sigmas


def _estimate(mean: Array, cov: Array, i: int) -> tuple[float, float]:
    return float(mean[i]), float(np.sqrt(max(0.0, cov[i, i])))


def _position_delay_share(mean: Array, cov: Array, sigma_s: float) -> float:
    """Posterior mean square of the position delay over the variance of its prior; 1 without a prior."""
    i = SharedParameter.POSITION_DELAY
    return 1.0 if sigma_s == 0.0 else float(mean[i] ** 2 + cov[i, i]) / sigma_s**2


def _mount_known(joint: JointFilter, sigmas: Array, factor: float, sight: Vector3) -> float:
    """Largest sigma of the mount across the mean line of sight, in units of its prior, if the parameters that no flight
    separates from it were known. A rotation about that line hardly moves the targets in the image.
    """
    prior = sigmas[MOUNT]
    if not prior.all():
        return 1.0
    root = root_given(with_drift(joint, sigmas, factor), NUISANCE, MOUNT_AXES)
    along = np.array(sight)
    shares = (np.eye(3) - along[:, None] * along / (along @ along)) @ (root / prior[:, None])
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(shares @ shares.T)[-1])))


def _with_heading(mean: Array, cov: Array, down: Vector3) -> dict[int, tuple[float, float]]:
    """Mean and one sigma of each axis of the mount, including the heading error, a rotation about down.

    R(true) Exp(c) = R(reported) Exp(c - heading down), to first order, with down in the body.
    """
    found: dict[int, tuple[float, float]] = {}
    for axis, share in zip(MOUNT_AXES, down, strict=True):
        by, pair = np.array((1.0, -share)), [axis, SharedParameter.HEADING]
        variance = float(by @ cov[np.ix_(pair, pair)] @ by)
        found[axis] = (float(by @ mean[pair]), float(np.sqrt(max(0.0, variance))))
    return found


def _kept(mean: Array, cov: Array, delay_sigma_s: float, stamp_sigma_s: float) -> KeptCalibration:
    x, y, z = (_estimate(mean, cov, i) for i in MOUNT_AXES)
    return KeptCalibration(
        time_offset_s=float(mean[SharedParameter.DELAY]),
        time_offset_sigma_s=float(np.hypot(delay_sigma_s, STEADY * stamp_sigma_s)),
        mount=(x[0], y[0], z[0]),
        mount_sigma=(x[1], y[1], z[1]),
    )


def believed(
    assessment: Assessment | None, priors: tuple[Array, Array], stamp_sigma_s: float
) -> tuple[list[float], list[float]]:
    """Means and one sigma of the shared parameters: as assessed if observable, otherwise their priors.

    ``stamp_sigma_s``: one sigma of the attitude stamps, s. Attitudes that are all equally late do not displace the
    targets, but make the camera seem early.
    """
    means, sigmas = priors[0].tolist(), priors[1].tolist()
    if assessment is not None:
        for i, (mean, sigma) in assessment.parameters.items():
            late_s = STEADY * stamp_sigma_s if i == SharedParameter.DELAY else 0.0
            means[i], sigmas[i] = mean, float(np.hypot(sigma, late_s)) if late_s else sigma
    return means, sigmas
