"""The factor by which innovations that are correlated over seconds exceed white noise.

A parameter that is estimated as constant may wander: a heading as the compass turns, roll and pitch with every bank.
Each innovation is then as small as expected, but they have the same sign for seconds. A covariance that takes them for
independent measurements shrinks below the true error. Sums over blocks show it (batch means: Law & Kelton): the sum of
n whitened innovations has the variance n if they are white. If it is larger by a factor, the variance of their mean is
larger by the same factor.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.types import Bias, ErrorPriors

SHORTEST_NS = 500 * NS_PER_MS
"""Length of the shortest blocks: longer than a wing beat and than the interval of telemetry at 10 Hz, which only
shake."""
SCALES = 5
"""Number of block lengths, each twice the one before: up to 8 s, of which a flight of a minute has a few."""
DOUBT = 4.0
"""Number of fictitious blocks with the expected factor that are counted before the first: a few blocks alone show
nothing."""
EXPECTED = 8.0
"""Factor before any innovation, where the autopilot's roll and pitch have errors: these errors follow turns, and even
constant ones turn in the body as it banks. Over 16 figure-eights each, the mean normalised squared error at
15 s was 6.6 where headings wander and 0.8 where all errors are constant; with a factor of 1 it was 13 and 2.1."""
COUNT, U, V = range(3)
"""Columns of ``blocks``: number of measurements, and sums of their whitened innovations in u and v."""
EXCESS, BLOCKS = range(2)
"""Columns of ``closed``: excess of the squared sums over white noise, and number of blocks."""


class InnovationConsistency(msgspec.Struct, frozen=True):
    """Statistics of the innovations so far, in blocks of several lengths. Immutable."""

    expected: float = 1.0
    """Factor before any innovation."""
    start_ns: int | None = None
    """Capture of the first batch, host clock; None before it."""
    index: int = 0
    """Index of the open block of the shortest length."""
    blocks: Array = np.zeros((SCALES, 3))
    """Sums of the open block of each length, the shortest first."""
    closed: Array = np.zeros((SCALES, 2))
    """Statistics of the closed blocks of each length."""

    def seen(self, host_ns: int, whitened: Array, used: Mask) -> InnovationConsistency:
        """The statistics after a batch. Batches come in the order of capture; an earlier one counts in the open block.

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
        """Factor on the measurements' variance, at least 1: the largest of all block lengths, with the expected one."""
        return self._factor(self.expected, self.closed[:, EXCESS])

    @property
    def shown(self) -> float:
        """Factor on the measurements' variance, at least 1, by the innovations alone, beyond chance.

        The excess of a block of white noise has the variance 1. The largest factor of all lengths is then 1.18 in the
        mean after 21 of the shortest blocks; with one sigma subtracted for each length it is 1.06.
        """
        excess, count = self.closed.T
        return self._factor(1.0, excess - np.sqrt(count))

    def _factor(self, expected: float, excess: Array) -> float:
        count = self.closed[:, BLOCKS]
        return 1.0 + max(0.0, float(((DOUBT * (expected - 1.0) + excess) / (DOUBT + count)).max()))

    def _closed(self, index: int) -> InnovationConsistency:
        """The statistics after the blocks that end before this index were closed and added to longer open ones."""
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
    """Innovation statistics before any innovation, with the factor expected under these priors."""
    errs = priors.sigma(Bias.ROLL) > 0.0 or priors.sigma(Bias.PITCH) > 0.0
    return InnovationConsistency(EXPECTED if errs else 1.0)
