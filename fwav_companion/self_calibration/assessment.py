"""What of a joint estimate is let go, and what the targets and the report are then told.

Three answers are kept apart. The *free* one lets go all that the flight has shown. The *plain* one lets go only the
delay: where what was shown does not contradict the configuration, the configuration is right, and correcting it by its
own noise would only spread the targets. The free one with the *heading held* judges that. A mount is told with the
heading's error in it, which is nearly inseparable from it while the tilt varies little.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from math import sqrt

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.self_calibration.innovation_consistency import InnovationConsistency
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.observability import (
    CONSIDERED,
    MOUNT,
    TIMING,
    ConstrainedEstimate,
    all_but,
    cholesky,
    holding,
    solved,
)
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, SharedParameter
from fwav_companion.self_calibration.prior_inflation import PriorInflation, prior_inflations

DELAY_SHOWN = 0.5
MOUNT_SHOWN = 0.35
"""Posterior sigma over prior sigma below which an unknown is let go: it then errs much less than its prior."""
CONTRADICTION = 13.3
"""Squared Mahalanobis distance of mount and height from the configuration: a right one exceeds it once in 100 flights
(4 degrees of freedom)."""


NO_DRIFT = InnovationConsistency()
"""What was taught is as sure as it seems."""


class CalibrationStatus(StrEnum):
    """How far self-calibration has come."""

    WAITING = "waiting"
    """Too little was seen yet; everything stands at its prior."""
    AMBIGUOUS = "ambiguous"
    """Several delays explain what was seen alike, as a steady beat repeats itself; everything stands at its prior."""
    UNEXPLAINED = "unexplained"
    """No delay within its prior explains what was seen; everything stands at its prior."""
    TIME = "time"
    """The delay is known; the mount needs other headings or ranges."""
    CALIBRATED = "calibrated"
    """Delay and mount are known."""


class CalibratedPlace(msgspec.Struct, frozen=True, gc=False):
    """A target by the joint estimate, horizontal."""

    north: float
    east: float
    cov: Symmetric2
    relative_cov: Symmetric2


class Assessment(msgspec.Struct, frozen=True):
    """What may be believed of a joint estimate."""

    status: CalibrationStatus
    free: ConstrainedEstimate
    plain: ConstrainedEstimate
    contradicted: bool
    """The configuration, by what was shown."""
    told: dict[int, tuple[float, float]]
    """Mean and one sigma of the common unknowns that are let go; of the mount with the heading's error in it."""
    mount_alone: tuple[tuple[float, float], ...]
    """Of its axes without that: another flight has another heading error. Empty where it is not let go."""
    drifting: dict[int, Symmetric2]
    """What is to be added to each target's covariance, by track, horizontal."""
    denied: tuple[PriorInflation, ...] = ()
    """Priors of the configuration that cannot be right."""

    def about(self, joint: JointFilter, means: tuple[float, ...]) -> Assessment:
        """The same judgement, and the targets by a newer joint estimate. What is told stays as it was judged."""
        for loosening in self.denied:
            joint = loosening.of(joint)
        plain = self.plain.about(joint, means)
        free = plain if self.free is self.plain else self.free.about(joint, means)
        return msgspec.structs.replace(self, free=free, plain=plain)

    def places(self) -> dict[int, CalibratedPlace]:
        """Where each target stands, by track; a new one waits for the next judgement."""
        joint = self.free.joint
        return {track: self._placed(joint.place_of(track) or 0, self.drifting[track])
                for track in joint.tracks if track in self.drifting}  # fmt: skip

    def _placed(self, place: int, drifting: Symmetric2) -> CalibratedPlace:
        free = self.free
        wandering = [i for i in CONSIDERED if free.joint.cov[i][i] > 0.0]
        cov = free.cov((place, place + 1, *wandering))
        nn, ne, ee = cov[0][0] + drifting[0], cov[0][1] + drifting[1], cov[1][1] + drifting[2]
        own_nn = own_ne = own_ee = 0.0
        for i in range(2, 2 + len(wandering)):
            n, e, variance = cov[0][i], cov[1][i], cov[i][i]
            own_nn, own_ne, own_ee = own_nn + n * n / variance, own_ne + n * e / variance, own_ee + e * e / variance
        north, east = free.mean(place), free.mean(place + 1)
        if not self.contradicted and self.plain is not free:
            # The configuration stands: the plain answer, which may be off by what parts it from the free one.
            dn, de = self.plain.mean(place) - north, self.plain.mean(place + 1) - east
            north, east = north + dn, east + de
            nn, ne, ee = nn + dn * dn, ne + dn * de, ee + de * de
        return CalibratedPlace(north, east, (nn, ne, ee), (nn - own_nn, ne - own_ne, ee - own_ee))


def assessed(
    joint: JointFilter,
    means: tuple[float, ...],
    sigmas: tuple[float, ...],
    *,
    various: bool,
    down: Vector3 = (0.0, 0.0, 1.0),
    drift: InnovationConsistency = NO_DRIFT,
) -> Assessment:
    """``various``: the targets were seen from different headings or at different ranges; ``down``: in the body, on the
    average; ``drift``: of the innovations.
    """
    denied = prior_inflations(joint, means, sigmas)
    for each in denied:
        joint = each.of(joint)
        sigmas = (*sigmas[: each.unknown], each.wider_sigma, *sigmas[each.unknown + 1 :])
    wider = drift.factor
    delay: tuple[int, ...] = TIMING
    plain = holding(joint, all_but(delay), means, sigmas, wider)
    if plain.known_sigma(SharedParameter.DELAY) > DELAY_SHOWN * sigmas[SharedParameter.DELAY]:
        delay = ()
        plain = holding(joint, all_but(delay), means, sigmas, wider)
    # Where a wrong prior bent the estimate its innovations lean as well, and say nothing of what wanders.
    shown = _shown(joint, means, sigmas, delay, 1.0 if denied else drift.shown) if various else ()
    if not shown:
        status = CalibrationStatus.TIME if delay else CalibrationStatus.WAITING
        return Assessment(status, plain, plain, False, _told(plain), (), _drifting(plain), denied)
    heading_held = holding(joint, all_but([*delay, *shown]), means, sigmas, wider).undoubting(SharedParameter.HEADING)
    free = holding(joint, all_but([*delay, *shown, SharedParameter.HEADING]), means, sigmas, wider)
    return Assessment(
        CalibrationStatus.CALIBRATED,
        free,
        plain,
        contradicted=_distance2(heading_held, shown, means) > CONTRADICTION,
        told=_told(free) | _with_heading(free, down),
        mount_alone=tuple((free.mean(i), free.sigma(i)) for i in MOUNT),
        drifting=_drifting(free),
        denied=denied,
    )


def _told(free: ConstrainedEstimate) -> dict[int, tuple[float, float]]:
    let_go = [i for i in range(COMMON_COUNT) if i not in free.held and i not in CONSIDERED]
    return {i: (free.mean(i), free.sigma(i)) for i in let_go}


def _with_heading(free: ConstrainedEstimate, down: Vector3) -> dict[int, tuple[float, float]]:
    """The mount with the heading's error in it, which turns about down.

    R(true) Exp(c) = R(told) Exp(c - heading down), to first order, with down in the body.
    """
    told: dict[int, tuple[float, float]] = {}
    for axis, share in zip(MOUNT, down, strict=True):
        (cc, ch), (_, hh) = free.claimed((axis, SharedParameter.HEADING))
        mean = free.mean(axis) - share * free.mean(SharedParameter.HEADING)
        told[axis] = (mean, sqrt(max(0.0, cc - 2.0 * share * ch + share * share * hh)))
    return told


def _drifting(free: ConstrainedEstimate) -> dict[int, Symmetric2]:
    drifting = {}
    for track in free.joint.tracks:
        place = free.joint.place_of(track) or 0
        (nn, ne), (_, ee) = free.drifting((place, place + 1))
        drifting[track] = (nn, ne, ee)
    return drifting


def _shown(
    joint: JointFilter, means: tuple[float, ...], sigmas: tuple[float, ...], delay: Sequence[int], wider: float
) -> tuple[int, ...]:
    """Of mount and height what the flight has shown, heading taken as right; those without any prior are not asked."""
    for group in ((*MOUNT, SharedParameter.HEIGHT), MOUNT):
        asked = tuple(i for i in group if sigmas[i] > 0.0)
        held = holding(joint, all_but([*delay, *asked]), means, sigmas, wider)
        if asked and all(held.known_sigma(i) <= MOUNT_SHOWN * sigmas[i] for i in asked):
            return asked
    return ()


def _distance2(held: ConstrainedEstimate, shown: Sequence[int], means: tuple[float, ...]) -> float:
    """Squared Mahalanobis distance of what was shown from what was configured."""
    cov = held.claimed(shown)
    offset = [held.mean(i) - means[i] for i in shown]
    return sum(a * b for a, b in zip(offset, solved(cholesky(cov), offset), strict=True))
