"""The factor by which the innovations of an estimate keep together over seconds, beyond noise.

A parameter that is estimated as constant may wander: a heading as the compass turns, roll and pitch with every bank.
Each innovation is then as small as it should be, but they lean one way for seconds, and a covariance that counts them
as independent measurements shrinks below the true error. Sums over blocks show it (batch means: Law & Kelton): the
sum of n whitened innovations has the variance n where they are noise, and a mean of them is less certain by the factor
that it exceeds n by.

The vehicle's position error leans, too, but is part of the covariance: what it explains of a sum is no drift.
"""

from __future__ import annotations

from math import expm1, sqrt

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.joint_filter import CONSIDERED, PixelInnovations
from fwav_companion.types import Bias, ErrorPriors

SHORTEST_NS = 500 * NS_PER_MS
"""Longer than a beat of the wings, and than telemetry at 10 Hz: those only shake."""
SCALES = 5
"""Block lengths, each twice the one before: up to 8 s, of which a flight of a minute has a few."""
DOUBT = 4.0
"""Blocks of the expected factor, counted before the first: a few alone say nothing."""
EXPECTED = 8.0
"""Factor before any innovation, where the autopilot's roll and pitch err at all: their errors follow turns, and even
constant ones turn in the body as it banks. Of 16 figure-eights each, the mean of the normalized squared error at 15 s
was 6.6 where headings wander and 0.8 where all errors are constant; with a factor of 1 it was 13 and 2.1.
"""
COUNT, U, V, U_NORTH, V_NORTH, U_EAST, V_EAST, MOVED = range(8)
"""Columns of ``blocks``: sums over innovations in units of their noise, over what one sigma of the position error
explains of them, and over the size of that whichever way: a whole turn of the image leaves only the last."""
EXCESS, WEIGHT, WIDE, BLOCKS = range(4)
"""Columns of ``closed``: the excess of the squares of sums over noise, weighted; the number of blocks of noise that
show it; the sum of the factors by which the position error widens them; and their number."""


class InnovationConsistency(msgspec.Struct, frozen=True):
    """The innovations so far, in blocks of several lengths. Immutable."""

    expected: float = 1.0
    """Factor before any innovation."""
    start_ns: int | None = None
    index: int = 0
    """Index of the shortest block that is open."""
    blocks: Array = np.zeros((SCALES, 8))
    """Open blocks, the shortest first."""
    closed: Array = np.zeros((SCALES, 4))
    """Statistics of the closed blocks of each length."""

    def seen(
        self, host_ns: int, innovations: PixelInnovations, used: Mask, priors: ErrorPriors
    ) -> InnovationConsistency:
        """The statistics after a batch, in the order of capture; earlier ones count as of the newest."""
        start_ns = host_ns if self.start_ns is None else self.start_ns
        since_ns = max(0, host_ns - start_ns)
        index = max(self.index, since_ns // SHORTEST_NS)
        state = self._closed(index, priors.position_bias_time_s) if index > self.index else self
        blocks = state.blocks.copy()
        blocks[0] += whitened_sums(innovations, used, priors, since_ns * 1e-9)
        return InnovationConsistency(self.expected, start_ns, index, blocks, state.closed)

    @property
    def factor(self) -> float:
        """Factor, at least 1, of the variance of what the innovations contributed: by the block length that shows most.

        The past position error is in that variance, too: where it is r times the noise in a block, the noise
        contributed only that share, and only this is less certain.
        """
        return self._factor(self.expected)

    @property
    def shown(self) -> float:
        """The factor by the innovations alone."""
        return self._factor(1.0)

    def _factor(self, expected: float) -> float:
        most, wide = 0.0, 1.0
        for excess, weight, wides, count in self.closed.tolist():
            wide = wides / count if count else wide
            most = max(most, (DOUBT * (expected - 1.0) + excess) / (DOUBT + weight) / wide)
        return 1.0 + most

    def _closed(self, index: int, wander_s: float) -> InnovationConsistency:
        """The statistics with the blocks that end before this index closed, and part of the longer ones."""
        blocks, closed, whole = self.blocks.copy(), self.closed.copy(), np.zeros(8)
        for i in range(SCALES):
            whole = blocks[i] + whole
            if index >> i == self.index >> i:
                blocks[i] = whole
                break
            blocks[i] = 0.0
            closed[i] += _statistics(whole, wandered_within(SHORTEST_NS * 1e-9 * 2**i, wander_s))
        return InnovationConsistency(self.expected, self.start_ns, index, blocks, closed)


def _statistics(block: Array, within: float) -> Array:
    """The contribution of one closed block; ``within``: share of the position error's variance that changes in it.

    Along the axes of what the position error explains of the sums: one whose variance that makes r times as large
    shows noise with the weight 1/r, squared.
    """
    n = block[COUNT]
    if not n:
        return np.zeros(4)
    north, east = block[[U_NORTH, V_NORTH]], block[[U_EAST, V_EAST]]
    explained, axes = np.linalg.eigh((np.outer(north, north) + np.outer(east, east)) / n)
    least = 1.0 + 0.5 * within * block[MOVED] ** 2 / n
    wide = least + np.maximum(0.0, explained)
    totals = axes.T @ block[[U, V]]
    excess = 0.5 * ((totals**2 / (n * wide) - 1.0) / wide).sum()
    return np.array((excess, 0.5 * (wide**-2).sum(), least + 0.5 * explained.sum(), 1.0))


def drift_of(priors: ErrorPriors) -> InnovationConsistency:
    """The statistics before any innovation."""
    errs = priors.sigma(Bias.ROLL) > 0.0 or priors.sigma(Bias.PITCH) > 0.0
    return InnovationConsistency(EXPECTED if errs else 1.0)


def whitened_sums(seen: PixelInnovations, used: Mask, priors: ErrorPriors, seconds: float) -> Array:
    """Sums (8) over the used innovations in units of their noise; ``seconds``: since the first.

    Their covariance S is noise R, parameters, and the vehicle's position error. The latter is removed as the largest
    share of S - R that it may have: in numpy, with D the root of what remains, S' = R + D (S - R) D.
    """
    k = np.flatnonzero(used[0])
    each = (2 * k[:, None] + np.arange(2)).ravel()
    cov, noise = seen.cov[0][each[:, None], each], seen.noise[0, k]
    wander = sqrt(wandered(seconds, priors.position_bias_time_s))
    sigmas = np.array(priors.bias_sigmas[Bias.POSITION_NORTH : Bias.POSITION_EAST + 1])
    by_position = seen.rows[0][each, CONSIDERED] * sigmas * wander
    if wander > 0.0 and sigmas.any():
        variance = noise[:, (0, 1), (0, 1)]
        more = (np.diag(cov).reshape(-1, 2) / variance).sum(1) - 2.0
        moved = (by_position.reshape(-1, 2, 2) ** 2 / variance[:, :, None]).sum((1, 2))
        share = np.where(more > 0.0, np.minimum(1.0, moved / np.where(more > 0.0, more, 1.0)), 1.0)
        left = np.repeat(np.sqrt(1.0 - share), 2)
        block = np.zeros_like(cov)
        for i in range(len(k)):
            block[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = noise[i]
        cov = block + left[:, None] * (cov - block) * left
    right = np.concatenate((seen.difference[0][each, None], by_position), 1)
    white = np.linalg.solve(np.linalg.cholesky(cov), right).reshape(-1, 2, 3)
    moved_by = np.sqrt((white[:, :, 1:] ** 2).sum((1, 2))) / wander if wander > 0.0 else np.zeros(len(k))
    u, v = white.sum(0)
    return np.array((len(k), u[0], v[0], u[1], v[1], u[2], v[2], moved_by.sum()))


def wandered(seconds: float, time_s: float) -> float:
    """Variance of a wandering error about its own mean over the seconds before, as a share of its whole variance.

    For a Gauss-Markov process with this time constant: 1 - 2 cov(now, mean) + var(mean).
    """
    x = seconds / time_s if time_s > 0.0 else 0.0
    if x < 1e-3:
        return x * 2.0 / 3.0
    gone = -expm1(-x)
    return 1.0 - 2.0 * gone / x + 2.0 * (x - gone) / (x * x)


def wandered_within(seconds: float, time_s: float) -> float:
    """Variance of a wandering error about its own mean within a block, as a share of its whole variance: for a random
    walk of 2 / time_s a second, a sixth of its final variance.
    """
    return min(1.0, seconds / (3.0 * time_s)) if time_s > 0.0 else 0.0
