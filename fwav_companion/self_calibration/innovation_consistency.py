"""The factor by which the innovations of an estimate keep together over seconds, beyond noise.

A parameter that is estimated as constant may wander: a heading as the compass turns, roll and pitch with every bank.
Each innovation is then as small as it should be, but they lean one way for seconds, and a covariance that counts them
as independent measurements shrinks below the true error. Sums over blocks show it (batch means: Law & Kelton): the
sum of n whitened innovations has the variance n where they are noise, and a mean of them is less certain by the factor
that it exceeds n by.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.self_calibration.arrays import Array, Mask
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
COUNT, U, V = range(3)
"""Columns of ``blocks``: sums over whitened innovations."""
EXCESS, BLOCKS = range(2)
"""Columns of ``closed``: the excess of the squares of sums over noise, and the number of blocks."""


class InnovationConsistency(msgspec.Struct, frozen=True):
    """The innovations so far, in blocks of several lengths. Immutable."""

    expected: float = 1.0
    """Factor before any innovation."""
    start_ns: int | None = None
    index: int = 0
    """Index of the shortest block that is open."""
    blocks: Array = np.zeros((SCALES, 3))
    """Open blocks, the shortest first."""
    closed: Array = np.zeros((SCALES, 2))
    """Statistics of the closed blocks of each length."""

    def seen(self, host_ns: int, whitened: Array, used: Mask) -> InnovationConsistency:
        """The statistics after a batch, in the order of capture; earlier ones count as of the newest.

        ``whitened`` (2N): innovations of the ``used`` (N) measurements whitened by their covariance, u and v alternate.
        """
        count = int(used.sum())
        if not count:
            return self
        start_ns = host_ns if self.start_ns is None else self.start_ns
        index = max(self.index, max(0, host_ns - start_ns) // SHORTEST_NS)
        state = self._closed(index) if index > self.index else self
        blocks = state.blocks.copy()
        blocks[0] += (count, whitened[::2].sum(), whitened[1::2].sum())
        return InnovationConsistency(self.expected, start_ns, index, blocks, state.closed)

    @property
    def factor(self) -> float:
        """Factor, at least 1, of the measurements' variance, by the block length that shows most."""
        return self._factor(self.expected, self.closed[:, EXCESS])

    @property
    def shown(self) -> float:
        """The factor by the innovations alone, beyond chance.

        Each block of noise alone has an excess with the variance 1. The largest factor of all lengths is 1.18 in the
        mean after 21 of the shortest blocks; with one sigma taken off each length it is 1.06.
        """
        excess, count = self.closed.T
        return self._factor(1.0, excess - np.sqrt(count))

    def _factor(self, expected: float, excess: Array) -> float:
        count = self.closed[:, BLOCKS]
        return 1.0 + max(0.0, float(((DOUBT * (expected - 1.0) + excess) / (DOUBT + count)).max()))

    def _closed(self, index: int) -> InnovationConsistency:
        """The statistics with the blocks that end before this index closed, and part of the longer ones."""
        blocks, closed, whole = self.blocks.copy(), self.closed.copy(), np.zeros(3)
        for i in range(SCALES):
            whole = blocks[i] + whole
            if index >> i == self.index >> i:
                blocks[i] = whole
                break
            blocks[i] = 0.0
            if whole[COUNT]:
                closed[i] += (0.5 * (whole[U] ** 2 + whole[V] ** 2) / whole[COUNT] - 1.0, 1.0)
        return InnovationConsistency(self.expected, self.start_ns, index, blocks, closed)


def drift_of(priors: ErrorPriors) -> InnovationConsistency:
    """The statistics before any innovation."""
    errs = priors.sigma(Bias.ROLL) > 0.0 or priors.sigma(Bias.PITCH) > 0.0
    return InnovationConsistency(EXPECTED if errs else 1.0)
