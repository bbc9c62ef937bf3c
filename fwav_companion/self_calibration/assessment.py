"""What is believed of a joint estimate: the observable parameters, and the targets by them.

Three estimates are kept apart. The *estimated* one frees all observable parameters. The *fixed* one frees only the
delay: where the flight does not contradict the configuration, the configuration is right, and correcting it by its own
noise would only spread the targets. The estimated one with the *heading held* decides that. A mount is reported with
the heading's error in it, which is nearly inseparable from it while the tilt varies little.
"""

from __future__ import annotations

from collections.abc import Collection

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import (
    CalibrationStatus,
    KeptCalibration,
    PriorInflation,
    SharedParameter,
)
from fwav_companion.self_calibration.innovation_consistency import InnovationConsistency
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.observability import (
    MOUNT_AXES,
    NUISANCE,
    POSITION,
    TIMING,
    ConstrainedEstimate,
    all_but,
    held_at_priors,
    solved,
)
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.prior_inflation import prior_inflations

DELAY_OBSERVABLE = 0.5
MOUNT_OBSERVABLE = 0.35
"""Posterior sigma over prior sigma below which a parameter is estimated: its error is then much below its prior."""
RETAINED = 1.1
"""A parameter that is estimated stays so up to this multiple: innovations that drift widen its sigma, and the places
would jump back and forth at the bound. With 1.25 a heading that wanders by 2 degrees in 20 s is believed too long: of
six figure-eights one ended with a normalised square of 53."""
CONTRADICTION = 13.3
"""Squared Mahalanobis distance of mount and height from the configuration: a right one exceeds it once in 100 flights
(4 degrees of freedom)."""
STEADY = 0.6
"""Share of the stamps' open instant that is the same throughout a flight: a loop that sends at one phase of itself
makes all of it so, one that sends at any phase none, and flights do not show which. A third of the variance claims
neither too much of the one nor twice too little of the other."""


GROUPS = (
    (SharedParameter.DELAY,),
    MOUNT_AXES,
    (SharedParameter.HEADING,),
    (SharedParameter.HEIGHT,),
    (SharedParameter.READOUT,),
    POSITION,
    (SharedParameter.POSITION_DELAY,),
    (SharedParameter.LEVER_X, SharedParameter.LEVER_Y, SharedParameter.LEVER_Z),
)
"""Parameters by cause of error."""


class CalibratedPlace(msgspec.Struct, frozen=True, gc=False):
    """A target by the joint estimate, horizontal."""

    north: float
    east: float
    cov: Symmetric2
    relative_cov: Symmetric2


class Assessment(msgspec.Struct, frozen=True):
    """What is believed of a joint estimate."""

    status: CalibrationStatus
    estimated: ConstrainedEstimate
    fixed: ConstrainedEstimate
    contradicted: bool
    """Whether the flight contradicts the configuration."""
    parameters: dict[int, tuple[float, float]]
    """Mean and one sigma of the estimated parameters; of the mount with the heading's error in it."""
    mount_alone: tuple[tuple[float, float], ...]
    """The mount without that: another flight has another heading error. Empty while it is held."""
    drift: dict[int, Array]
    """(2, 2) covariance to add for each target, by track."""
    denied: tuple[PriorInflation, ...] = ()
    """Priors of the configuration that the flight contradicts."""
    mount_known: float = 1.0
    """Largest sigma of an axis of the mount in units of its prior, as the flight shows it."""

    def about(self, joint: JointFilter, priors: tuple[Array, Array]) -> Assessment:
        """The same assessment with the targets by a newer joint estimate."""
        priors = (priors[0], widened(priors[1], self.denied))
        for each in self.denied:
            joint = joint.inflated(each)
        fixed = held_at_priors(joint, self.fixed.held, priors)
        estimated = fixed if self.estimated is self.fixed else held_at_priors(joint, self.estimated.held, priors)
        return msgspec.structs.replace(self, estimated=estimated, fixed=fixed)

    def places(self) -> dict[int, CalibratedPlace]:
        """The targets, by track; a new one waits for the next assessment."""
        tracks = enumerate(self.estimated.joint.tracks)
        return {track: self._place(SHARED_COUNT + 2 * k, self.drift[track]) for k, track in tracks
                if track in self.drift}  # fmt: skip

    def bias_shares(self, track: int) -> dict[SharedParameter, float]:
        """Horizontal variance of a target that it would lose if a parameter were exactly known, m^2.

        The three angles of the mount count together, as do the position's axes and those of the lever arm: the first of
        them has the share. With the covariance P, target t and group g: trace(P[t, g] inv(P[g, g]) P[g, t]).
        """
        free = self.estimated
        if track not in free.joint.tracks:
            return {}
        place = SHARED_COUNT + 2 * free.joint.tracks.index(track)
        return {group[0]: _explained(free.cov, group, place) for group in GROUPS}

    def _place(self, place: int, drift: Array) -> CalibratedPlace:
        free, own = self.estimated, slice(place, place + 2)
        wandering = [i for i in POSITION if free.joint.cov[0, i, i] > 0.0]
        cov, mean = free.cov[own, own] + drift, free.mean[own]
        by_position = free.cov[own, wandering] / np.sqrt(np.diag(free.cov)[wandering])
        if not self.contradicted and self.fixed is not free:
            # The configuration holds: the fixed answer, which may be off by what separates it from the free one.
            apart = self.fixed.mean[own] - mean
            mean, cov = self.fixed.mean[own], cov + np.outer(apart, apart)
        relative = cov - by_position @ by_position.T
        return CalibratedPlace(float(mean[0]), float(mean[1]), _symmetric(cov), _symmetric(relative))


def assessed(
    joint: JointFilter,
    priors: tuple[Array, Array],
    *,
    various: bool,
    down: Vector3 = (0.0, 0.0, 1.0),
    drift: InnovationConsistency | None = None,
    before: Assessment | None = None,
) -> Assessment:
    """The assessment of a joint estimate. ``priors``: means and one sigma of the shared parameters. ``various``:
    whether targets were seen from different headings or ranges; ``down``: mean down axis in the body; ``before``: the
    previous assessment.
    """
    means, sigmas = priors
    denied = prior_inflations(joint, means, sigmas)
    for each in denied:
        joint = joint.inflated(each)
    sigmas = widened(sigmas, denied)
    priors = (means, sigmas)
    wider = 1.0 if drift is None else drift.factor
    delay: tuple[int, ...] = TIMING
    fixed = held_at_priors(joint, all_but(delay), priors, wider)
    most = DELAY_OBSERVABLE * (RETAINED if before and SharedParameter.DELAY in before.parameters else 1.0)
    if fixed.sigma(SharedParameter.DELAY, known=True) > most * sigmas[SharedParameter.DELAY]:
        delay = ()
        fixed = held_at_priors(joint, all_but(delay), priors, wider)
    # Where a wrong prior bent the estimate its innovations lean as well, and say nothing of what wanders.
    shown = 1.0 if denied or drift is None else drift.shown
    retained = before.parameters if before is not None else {}
    observable = _observable(joint, priors, held=all_but(delay), wider=shown, retained=retained) if various else []
    if not observable:
        status = CalibrationStatus.TIME if delay else CalibrationStatus.WAITING
        return Assessment(
            status=status,
            estimated=fixed,
            fixed=fixed,
            contradicted=False,
            parameters=_parameters(fixed),
            mount_alone=(),
            drift=_drifts(fixed),
            denied=denied,
            mount_known=_mount_known(joint, priors, delay, shown),
        )
    heading = SharedParameter.HEADING
    heading_held = held_at_priors(joint, all_but([*delay, *observable]), priors, wider, trusted=heading)
    free = held_at_priors(joint, all_but([*delay, *observable, *NUISANCE]), priors, wider)
    offset = heading_held.mean[list(observable)] - means[list(observable)]
    distance2 = float(offset @ solved(heading_held.claimed(observable), offset))
    return Assessment(
        status=CalibrationStatus.CALIBRATED,
        estimated=free,
        fixed=fixed,
        contradicted=distance2 > CONTRADICTION,
        parameters=_parameters(free) | _with_heading(free, down),
        mount_alone=tuple((float(free.mean[i]), free.sigma(i)) for i in MOUNT_AXES),
        drift=_drifts(free),
        denied=denied,
    )


def widened(sigmas: Array, denied: Collection[PriorInflation]) -> Array:
    """The sigmas with the contradicted ones widened."""
    sigmas = sigmas.copy()
    for each in denied:
        sigmas[each.parameter] = each.wider_sigma
    return sigmas


def _parameters(free: ConstrainedEstimate) -> dict[int, tuple[float, float]]:
    estimated = [i for i in range(SHARED_COUNT) if i not in free.held and i not in POSITION]
    return {i: (float(free.mean[i]), free.sigma(i)) for i in estimated}


def _with_heading(free: ConstrainedEstimate, down: Vector3) -> dict[int, tuple[float, float]]:
    """The mount with the heading's error in it, a rotation about down.

    R(true) Exp(c) = R(reported) Exp(c - heading down), to first order, with down in the body.
    """
    found: dict[int, tuple[float, float]] = {}
    for axis, share in zip(MOUNT_AXES, down, strict=True):
        by = np.array((1.0, -share))
        pair = (axis, SharedParameter.HEADING)
        variance = float(by @ free.claimed(pair) @ by)
        found[axis] = (float(by @ free.mean[list(pair)]), float(np.sqrt(max(0.0, variance))))
    return found


def _drifts(free: ConstrainedEstimate) -> dict[int, Array]:
    places = ((track, SHARED_COUNT + 2 * k) for k, track in enumerate(free.joint.tracks))
    return {track: free.drift[place : place + 2, place : place + 2] for track, place in places}


def _observable(
    joint: JointFilter,
    priors: tuple[Array, Array],
    *,
    held: Collection[int],
    wider: float,
    retained: Collection[int],
) -> list[int]:
    """The observable ones of mount and height, heading taken as right; those without any prior are not tested."""
    for group in ((*MOUNT_AXES, SharedParameter.HEIGHT), MOUNT_AXES):
        tested = [int(i) for i in group if priors[1][i] > 0.0]
        most = {i: MOUNT_OBSERVABLE * (RETAINED if i in retained else 1.0) for i in tested}
        free = held_at_priors(joint, [i for i in held if i not in tested], priors, wider)
        if tested and all(free.sigma(i, known=True) <= most[i] * priors[1][i] for i in tested):
            return tested
    return []


def _mount_known(joint: JointFilter, priors: tuple[Array, Array], delay: Collection[int], wider: float) -> float:
    held = held_at_priors(joint, all_but([*delay, *MOUNT_AXES]), priors, wider)
    shares = [held.sigma(i, known=True) / priors[1][i] for i in MOUNT_AXES if priors[1][i] > 0.0]
    return min(1.0, max(shares, default=1.0))


def _explained(cov: Array, group: Collection[SharedParameter], place: int) -> float:
    """Horizontal variance of the target at ``place`` that knowing a group of parameters would take away, m^2."""
    known = [int(i) for i in group if cov[i, i] > 0.0]
    if not known:
        return 0.0
    crossed = cov[place : place + 2, known]
    return float(np.trace(crossed @ solved(cov[np.ix_(known, known)], crossed.T)))


def _symmetric(cov: Array) -> Symmetric2:
    return (float(cov[0, 0]), float(cov[0, 1]), float(cov[1, 1]))


def believed(
    assessment: Assessment | None, priors: tuple[Array, Array], stamp_sigma_s: float
) -> tuple[list[float], list[float]]:
    """Mean and one sigma of each shared parameter.

    ``stamp_sigma_s``: open instant of the attitude stamps. Attitudes that are all as late make targets no worse, but
    the camera seem early.
    """
    means, sigmas = priors[0].tolist(), priors[1].tolist()
    if assessment is not None:
        for i, (mean, sigma) in assessment.parameters.items():
            late_s = STEADY * stamp_sigma_s if i == SharedParameter.DELAY else 0.0
            means[i], sigmas[i] = mean, float(np.hypot(sigma, late_s)) if late_s else sigma
    return means, sigmas


def worth_keeping(assessment: Assessment | None, stamp_sigma_s: float = 0.0) -> KeptCalibration | None:
    """The calibration for the next flight, whose attitudes may be stamped otherwise; None while there is none."""
    if assessment is None or assessment.status is not CalibrationStatus.CALIBRATED:
        return None
    found = assessment.parameters
    if not all(i in found for i in (SharedParameter.DELAY, *MOUNT_AXES)):
        return None
    x, y, z = assessment.mount_alone
    delay_s, sigma_s = found[SharedParameter.DELAY]
    return KeptCalibration(
        time_offset_s=delay_s,
        time_offset_sigma_s=float(np.hypot(sigma_s, STEADY * stamp_sigma_s)),
        mount=(x[0], y[0], z[0]),
        mount_sigma=(x[1], y[1], z[1]),
    )
