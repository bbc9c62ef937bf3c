"""What of a joint estimate is let go, and what the targets and the report are then told.

Three answers are kept apart. The *free* one lets go all that the flight has shown. The *plain* one lets go only the
delay: where what was shown does not contradict the configuration, the configuration is right, and correcting it by its
own noise would only spread the targets. The *report* is the free one with the heading held: by it
is judged what was shown. A mount is told with the heading's error in it, which is nearly inseparable from it while the
tilt varies little.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from math import sqrt

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tracking.answer import CONSIDERED, MOUNT, TIMING, Held, all_but, cholesky, holding, solved
from fwav_companion.tracking.drift import Drift
from fwav_companion.tracking.joint import Joint
from fwav_companion.tracking.linear import Symmetric2
from fwav_companion.tracking.loosening import Loosening, loosenings
from fwav_companion.tracking.rays import COMMON_COUNT, Common

DELAY_SHOWN = 0.5
MOUNT_SHOWN = 0.35
"""Posterior sigma over prior sigma below which an unknown is let go: it then errs much less than its prior."""
CONTRADICTION = 13.3
"""Squared Mahalanobis distance of mount and height from the configuration: a right one exceeds it once in 100 flights
(4 degrees of freedom)."""


NO_DRIFT = Drift()
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


class Placed(msgspec.Struct, frozen=True, gc=False):
    """A target by the joint estimate, horizontal."""

    north: float
    east: float
    cov: Symmetric2
    relative_cov: Symmetric2


class Verdict(msgspec.Struct, frozen=True):
    """What may be believed of a joint estimate."""

    status: CalibrationStatus
    free: Held
    plain: Held
    report: Held
    contradicted: bool
    """The configuration, by what was shown."""
    down: Vector3 = (0.0, 0.0, 1.0)
    """In the body, on the average of what was seen: what the heading turns about."""
    denied: tuple[Loosening, ...] = ()
    """Priors of the configuration that cannot be right."""

    def about(self, joint: Joint, means: tuple[float, ...]) -> Verdict:
        """The same judgement, and the targets by a newer joint estimate. What is reported stays as it was judged."""
        for loosening in self.denied:
            joint = loosening.of(joint)
        plain = self.plain.about(joint, means)
        free = plain if self.free is self.plain else self.free.about(joint, means)
        return msgspec.structs.replace(self, free=free, plain=plain)

    def places(self) -> dict[int, Placed]:
        """Where each target stands, by track."""
        return {track: self._placed(self.free.joint.place_of(track) or 0) for track in self.free.joint.tracks}

    def _placed(self, place: int) -> Placed:
        free = self.free
        wandering = [i for i in CONSIDERED if free.joint.cov[i][i] > 0.0]
        cov = free.cov((place, place + 1, *wandering))
        nn, ne, ee = cov[0][0], cov[0][1], cov[1][1]
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
        return Placed(north, east, (nn, ne, ee), (nn - own_nn, ne - own_ne, ee - own_ee))

    def told(self) -> dict[int, tuple[float, float]]:
        """Mean and one sigma of the common unknowns that are let go; of the mount with the heading's error in it."""
        free = self.free
        let_go = [i for i in range(COMMON_COUNT) if i not in free.held and i not in CONSIDERED]
        told = {i: (free.mean(i), free.sigma(i)) for i in let_go}
        if Common.HEADING in told:
            told |= {i: self._with_heading(i, share) for i, share in zip(MOUNT, self.down, strict=True) if i in told}
        return told

    def _with_heading(self, axis: int, share: float) -> tuple[float, float]:
        """R(true) Exp(c) = R(told) Exp(c - heading down) to first order: what the heading is off turns about down."""
        (cc, ch), (_, hh) = self.free.cov((axis, Common.HEADING))
        mean = self.free.mean(axis) - share * self.free.mean(Common.HEADING)
        return mean, sqrt(max(0.0, cc - 2.0 * share * ch + share * share * hh))

    def mount_alone(self) -> list[tuple[float, float]]:
        """Mean and one sigma of the mount's axes without the heading's error: another flight has another one."""
        return [(self.free.mean(i), self.free.sigma(i)) for i in MOUNT]


def judged(
    joint: Joint,
    means: tuple[float, ...],
    sigmas: tuple[float, ...],
    *,
    various: bool,
    down: Vector3 = (0.0, 0.0, 1.0),
    drift: Drift = NO_DRIFT,
) -> Verdict:
    """``various``: the targets were seen from different headings or at different ranges; ``down``: in the body, on the
    average; ``drift``: of the innovations.
    """
    denied = loosenings(joint, means, sigmas)
    for each in denied:
        joint = each.of(joint)
        sigmas = (*sigmas[: each.unknown], each.wider_sigma, *sigmas[each.unknown + 1 :])
    wider = drift.factor
    delay: tuple[int, ...] = TIMING
    plain = holding(joint, all_but(delay), means, sigmas, wider)
    if plain.known_sigma(Common.DELAY) > DELAY_SHOWN * sigmas[Common.DELAY]:
        delay = ()
        plain = holding(joint, all_but(delay), means, sigmas, wider)
    # Where a wrong prior bent the estimate its innovations lean as well, and say nothing of what wanders.
    shown = _shown(joint, means, sigmas, delay, 1.0 if denied else drift.shown) if various else ()
    if not shown:
        status = CalibrationStatus.TIME if delay else CalibrationStatus.WAITING
        return Verdict(status, plain, plain, plain, contradicted=False, denied=denied)
    report = holding(joint, all_but([*delay, *shown]), means, sigmas, wider).undoubting(Common.HEADING)
    free = holding(joint, all_but([*delay, *shown, Common.HEADING]), means, sigmas, wider)
    return Verdict(
        status=CalibrationStatus.CALIBRATED,
        free=free,
        plain=plain,
        report=report,
        contradicted=_distance2(report, shown, means) > CONTRADICTION,
        denied=denied,
        down=down,
    )


def _shown(
    joint: Joint, means: tuple[float, ...], sigmas: tuple[float, ...], delay: Sequence[int], wider: float
) -> tuple[int, ...]:
    """Of mount and height what the flight has shown, heading taken as right; those without any prior are not asked."""
    for group in ((*MOUNT, Common.HEIGHT), MOUNT):
        asked = tuple(i for i in group if sigmas[i] > 0.0)
        held = holding(joint, all_but([*delay, *asked]), means, sigmas, wider)
        if asked and all(held.known_sigma(i) <= MOUNT_SHOWN * sigmas[i] for i in asked):
            return asked
    return ()


def _distance2(report: Held, shown: Sequence[int], means: tuple[float, ...]) -> float:
    """Squared Mahalanobis distance of what was shown from what was configured."""
    cov = report.cov(shown)
    offset = [report.mean(i) - means[i] for i in shown]
    return sum(a * b for a, b in zip(offset, solved(cholesky(cov), offset), strict=True))
