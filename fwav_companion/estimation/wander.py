"""The position's error in time: kernels of its wander, its knots, and its variance between two knots.

The error (north, east, up; reported minus true) is the receiver's wander plus what the smoothing of the path left of
the white noise. How rough the wander is cannot be known before the flight: several kernels are compared by the marginal
likelihood of the sightings (Rasmussen & Williams 2006, ch. 5).

A receiver that gains or loses corrections changes its solution. The error is then the wander of the best solution of
the flight, plus another one of the same kernel while the solution is worse, independent of those of other pieces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array, Ints
from fwav_companion.estimation.path_samples import PathBreak


class WanderKernel(NamedTuple):
    """Shape of a wander: `low_pass_s` smooths a Gauss-Markov process; None: a second-order one with a finite rate."""

    name: str
    low_pass_s: float | None


SMOOTH: Final = WanderKernel("smooth", None)
QUICK: Final = WanderKernel("quick", 0.0)
KERNELS: Final = (
    SMOOTH, WanderKernel("8 s", 8.0), WanderKernel("3 s", 3.0), WanderKernel("1 s", 1.0), QUICK,
)  # fmt: skip
_PATH_LOW_PASS = 1.4  # of the smoothing's time constant: it has low-passed the wander, too
_LEAST_LOW_PASS_S = 0.07
_JITTER_M2 = 1e-8  # keeps the knots' covariance regular
SHORT_S = 0.5  # gap up to which the error is a random walk
_KEPT = np.ones(3)
_LEAST_VARIANCE_M2, _LEAST_SHARE = 1e-12, 1e-6  # of an error without a wander, and after the longest gap
_UNMEASURED_M_S2 = 3.0  # a small vehicle that banks at 17 degrees
_LEAST_JUMP_M = 0.1  # one sigma of a jump at least: steps of the format, and reports of one instant that differ
_LEAST_STEP_M = 1.0  # of a break's prior: its size is known only as well as the noise


class Pieces(NamedTuple):
    """Solutions of the receiver at the knots."""

    piece: Ints  # (K,) number of the solution
    extra2: Array  # (K,) m^2, its variance beyond that of the flight's best one


@dataclass(frozen=True)
class Wander:
    """Covariance of one component of the error as a function of the lag."""

    sigma_m: float
    times_s: tuple[float, ...]  # the variance is shared equally
    kernel: WanderKernel
    path: tuple[float, float]  # m, s: what the smoothing of the path left

    def covariance(self, lag: Array) -> Array:
        """(...) s to (...) m^2."""
        left_m, left_s = self.path
        total = left_m**2 * np.exp(lag * (-1.0 / left_s))
        if self.sigma_m <= 0.0:
            return np.asarray(total)
        return np.asarray(total + self.sigma_m**2 * self.correlation(lag))

    def correlation(self, lag: Array) -> Array:
        """Of the wander without what the smoothing left: (...) s to (...)."""
        total, left_s = np.zeros_like(lag), self.path[1]
        share = 1.0 / len(self.times_s)
        for time in self.times_s:
            if self.kernel.low_pass_s is None:
                x = (2.0 / time) * lag
                total = total + share * (1.0 + x) * np.exp(-x)
            else:
                low_pass = max(_PATH_LOW_PASS * left_s, _LEAST_LOW_PASS_S, self.kernel.low_pass_s)
                slow, fast = 1.0 / time, max(1.0 / low_pass, 1.001 / time)
                process = fast * np.exp(-slow * lag) - slow * np.exp(-fast * lag)
                total = total + share / (fast - slow) * process
        return np.asarray(total)

    def growth(self) -> float:
        """Process noise (m^2/s) of the random walk that grows like this over half a second."""
        start, later = self.covariance(np.array([0.0, SHORT_S])).tolist()
        return float(2.0 * (start - later) / SHORT_S)

    def bridge(self, gap: Array, part: Array) -> Array:
        """Variance (m^2) about the straight line between two knots, at the fraction `part` of the gap (s).

        Sightings see the error, not the line. Without this variance the sightings between two knots count as
        independent looks at the line, and the knots are claimed too well.
        """
        start, ends, left, right = self.covariance(np.stack([0.0 * gap, gap, part * gap, (1.0 - part) * gap]))
        line = (part**2 + (1.0 - part) ** 2) * start + 2.0 * part * (1.0 - part) * ends
        return np.asarray(np.maximum(0.0, start + line - 2.0 * ((1.0 - part) * left + part * right)))

    def bridge_of_pieces(self, gap: Array, part: Array, left: Ints, pieces: Pieces) -> Array:
        """Variance (N,) m^2 about the lines between knots that the worse solutions add; left (N,): the knot before.

        Between two solutions the line says nothing.
        """
        unit = replace(self, sigma_m=1.0, path=(0.0, self.path[1]))
        before, after = pieces.extra2[left], pieces.extra2[left + 1]
        same = pieces.piece[left] == pieces.piece[left + 1]
        return np.where(same, unit.bridge(gap, part) * before, 2.0 * np.maximum(before, after))

    def precision(self, knots: Array, breaks: list[PathBreak], pieces: Pieces | None = None) -> tuple[Array, float]:
        """Inverse (K, K) of the prior covariance of the knots (K,) s, and the log determinant of the covariance."""
        lag = np.abs(knots[:, None] - knots)
        covariance = self.covariance(lag)  # (K, K)
        if pieces is not None:
            same = pieces.piece[:, None] == pieces.piece
            covariance += np.where(same, pieces.extra2, 0.0) * self.correlation(lag)
        covariance[np.diag_indices(len(knots))] += _JITTER_M2
        for b in breaks:  # everything after a step may be off by one more constant
            after = (knots >= b.after - 1e-9).astype(np.float64)
            covariance += step_variance(b) * np.outer(after, after)
        root = np.linalg.cholesky(covariance)
        inverse = np.linalg.inv(root)
        return inverse.T @ inverse, 2.0 * float(np.log(np.diag(root)).sum())


class ErrorAgeing:
    """How the error now ages without sightings of it.

    For half a second it is a random walk with the growth of the kernel over that time. Later its mean fades and its
    variance grows as the kernel says, counted from the last sighting: steps of half a second that follow each other
    would neither fade nor grow like a wander of finite rate.
    """

    def __init__(self, wanders: tuple[Wander, Wander]) -> None:
        """wanders: of north and east, and of up."""
        self._wanders = wanders
        level, up = (w.growth() for w in wanders)
        self._growth = np.array([level, level, up])  # m^2/s

    def between(self, since_s: float, until_s: float) -> tuple[Array, Array]:
        """Factor (3,) on the error and variance (3,) added from one time after the last sighting to a later one, s."""
        if until_s < SHORT_S:
            return _KEPT, self._growth * (until_s - since_s)
        (before, old), (after, new) = self._since_sighting(since_s), self._since_sighting(until_s)
        keep = after / before
        return keep, np.maximum(new - keep * keep * old, 0.0)

    def _since_sighting(self, lag_s: float) -> tuple[Array, Array]:
        """Share (3,) of the error that is left, and variance (3,) added, this time after the last sighting."""
        if lag_s < SHORT_S:
            return _KEPT, self._growth * lag_s
        (a, b), (c, d) = (w.covariance(np.array([0.0, lag_s])).tolist() for w in self._wanders)
        start, later = np.maximum(np.array([a, a, c]), _LEAST_VARIANCE_M2), np.array([b, b, d])
        return np.maximum(later / start, _LEAST_SHARE), np.maximum(
            start - later * later / start, self._growth * SHORT_S
        )


def step_variance(b: PathBreak) -> float:
    """Variance (m^2) of the constant by which the error steps at a break."""
    return max(_LEAST_STEP_M, 4.0 * b.step_m) ** 2


def jump_variance(b: PathBreak, noise_m: float) -> float:
    """Variance (m^2) of a break's constant when the reports before and after it are known, with this noise.

    Between them an unmeasured acceleration moves the vehicle away from the mean of both velocities.
    """
    if b.jump is None:
        return step_variance(b)
    moved_m = _UNMEASURED_M_S2 * (b.after - b.before) ** 2 / 8.0
    return 2.0 * noise_m**2 + moved_m**2 + _LEAST_JUMP_M**2


def jumps(breaks: list[PathBreak], since_s: float, until_s: float, noise_m: float) -> tuple[Array, float]:
    """Jump (3,) m of the error by the report's steps in a span of time, and its variance, m^2.

    The error steps as the report does beyond its velocity.
    """
    jump, variance = np.zeros(3), 0.0
    for b in breaks:
        if since_s < b.after <= until_s:
            jump[:2] += b.jump or (0.0, 0.0)
            variance += jump_variance(b, noise_m)
    return jump, variance


# Gaps between knots by their age, both s: dense where the error now is estimated, sparse where it only carries places.
SPACING: Final = ((0.0, 0.5), (8.0, 1.0), (25.0, 2.0), (60.0, 4.0), (200.0, 8.0), (800.0, 16.0))


def place_knots(t: Array, now: float, breaks: list[PathBreak], stretch: float = 1.0) -> Array:
    """Times (K,) of the knots, at least two: at `now`, at both sides of breaks, and about sightings (N,) s."""
    age = now - t
    found = [np.array([now])]
    for i, (start, gap) in enumerate(SPACING):
        end = SPACING[i + 1][0] if i + 1 < len(SPACING) else np.inf
        gap *= stretch
        cells = np.unique(np.floor(t[(age >= start) & (age < end)] / gap)) * gap
        found += [cells, cells + gap]
    inside = [x for b in breaks for x in (b.before, b.after) if t[0] < x < now]
    knots = np.concatenate([*found, np.array(inside)])
    knots = np.unique(np.round(knots[knots <= now], 6))
    if knots[0] > t[0] or len(knots) < 2:
        knots = np.unique(np.append(knots, min(float(t[0]), now - SPACING[0][1])))
    return knots


def at_times(t: Array, knots: Array, errors: Array) -> Array:
    """Error (N, 3) at times (N,): straight lines between knots (K,) with errors (K, 3), constant beyond the ends."""
    if not len(knots):
        return np.zeros((len(t), 3))
    return np.stack([np.interp(t, knots, errors[:, c]) for c in range(3)], axis=-1)
