"""How much more than noise the innovations of an estimate keep together over seconds.

What is estimated as constant may wander: a heading as the compass turns, roll and pitch with every bank. Each
innovation is then as small as it should be, but they lean one way for seconds, and a covariance that takes them for so
many independent measurements shrinks below what stands behind it. Sums over blocks show that (the method of batch
means): the sum of n whitened innovations has the variance n where they are noise, and a mean of them is less certain by
the factor that it exceeds n by.

The vehicle's position error leans, too, but is in the covariance as it stands: what it explains of a sum is no drift.
"""

from __future__ import annotations

from math import atan2, cos, expm1, hypot, sin, sqrt

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS
from fwav_companion.self_calibration.joint_filter import PixelInnovation
from fwav_companion.self_calibration.pixel_measurement import SharedParameter
from fwav_companion.types import Bias, ErrorPriors

SHORTEST_NS = 500 * NS_PER_MS
"""Longer than a beat of the wings, and than telemetry at 10 Hz: those only shake."""
SCALES = 5
"""Each twice as long as the one before: up to 8 s, of which a flight of a minute has a few."""
DOUBT = 4.0
"""Blocks of the factor that was expected, counted before the first: of a few alone nothing can be told."""
LEAST = 1e-12
"""Of a variance, what rounding leaves of it."""
EXPECTED = 8.0
"""Factor before anything was seen, where the autopilot's roll and pitch err at all: their errors follow turns, and even
constant ones turn in the body as it banks. Of 16 figure-eights each, the mean of the normalized squared error at 15 s
was 6.6 where headings wander and 0.8 where all errors stand still; with a factor of 1 it was 13 and 2.1.
"""


class InnovationBatch(msgspec.Struct, frozen=True, gc=False):
    """Sums over the innovations of some seconds, in units of their noise."""

    count: int = 0
    u: float = 0.0
    v: float = 0.0
    u_north: float = 0.0
    """By one sigma of the vehicle's position error; so are the others."""
    v_north: float = 0.0
    u_east: float = 0.0
    v_east: float = 0.0
    moved: float = 0.0
    """By one sigma of the position error as it wanders, whichever way: a whole turn of the image leaves this alone."""

    def with_block(self, other: InnovationBatch) -> InnovationBatch:
        """Both together."""
        return InnovationBatch(
            self.count + other.count,
            self.u + other.u,
            self.v + other.v,
            self.u_north + other.u_north,
            self.v_north + other.v_north,
            self.u_east + other.u_east,
            self.v_east + other.v_east,
            self.moved + other.moved,
        )


class BatchMeans(msgspec.Struct, frozen=True, gc=False):
    """What the blocks of one length tell."""

    excess: float = 0.0
    """By what the squares of their sums exceed noise, each weighed by how well it tells."""
    weight: float = 0.0
    """How many blocks of noise tell it."""
    wide: float = 0.0
    """Sum of the factors by which the position error makes their variance larger than noise does."""
    count: int = 0

    def with_block(self, block: InnovationBatch, within: float) -> BatchMeans:
        """With one block more; ``within``: share of the position error's variance that comes and goes in it.

        Along the axes of what the position error explains of its sums: one whose variance that makes r times as large
        tells of noise with 1/r of its weight, squared.
        """
        n = block.count
        if not n:
            return self
        uu = (block.u_north**2 + block.u_east**2) / n
        uv = (block.u_north * block.v_north + block.u_east * block.v_east) / n
        vv = (block.v_north**2 + block.v_east**2) / n
        mean, half = 0.5 * (uu + vv), 0.5 * hypot(uu - vv, 2.0 * uv)
        angle = 0.5 * atan2(2.0 * uv, uu - vv)
        c, s = cos(angle), sin(angle)
        least = 1.0 + 0.5 * within * block.moved**2 / n
        excess, weight = self.excess, self.weight
        for total, explained in ((c * block.u + s * block.v, mean + half), (c * block.v - s * block.u, mean - half)):
            wide = least + max(0.0, explained)
            excess += 0.5 * (total * total / (n * wide) - 1.0) / wide
            weight += 0.5 / (wide * wide)
        return BatchMeans(excess, weight, self.wide + least + mean, self.count + 1)


class InnovationConsistency(msgspec.Struct, frozen=True, gc=False):
    """The innovations so far, in blocks of several lengths. Immutable."""

    expected: float = 1.0
    """Factor before anything was seen."""
    start_ns: int | None = None
    index: int = 0
    """Of the shortest block that is open."""
    blocks: tuple[InnovationBatch, ...] = (InnovationBatch(),) * SCALES
    """Open ones, the shortest first."""
    told: tuple[BatchMeans, ...] = (BatchMeans(),) * SCALES
    """Of the closed ones, of each length."""

    def seen(self, host_ns: int, innovation: PixelInnovation, priors: ErrorPriors) -> InnovationConsistency:
        """With one innovation more, in the order of capture; those before a target is placed come with it."""
        start_ns = host_ns if self.start_ns is None else self.start_ns
        since_ns = max(0, host_ns - start_ns)
        index = max(self.index, since_ns // SHORTEST_NS)
        state = self._closed(index, priors.position_bias_time_s) if index > self.index else self
        block = state.blocks[0].with_block(whitened(innovation, priors, since_ns * 1e-9))
        return InnovationConsistency(self.expected, start_ns, index, (block, *state.blocks[1:]), state.told)

    @property
    def factor(self) -> float:
        """Of the variance of what the innovations have taught, at least 1: by the length of block that shows most.

        What the position error has done before is in that variance, too: where it is r times the noise in a block, the
        noise has taught no more than that share, and only this is less certain.
        """
        return self._factor(self.expected)

    @property
    def shown(self) -> float:
        """The same by what was seen alone."""
        return self._factor(1.0)

    def _factor(self, expected: float) -> float:
        most, wide = 0.0, 1.0
        for told in self.told:
            wide = told.wide / told.count if told.count else wide
            more = (DOUBT * (expected - 1.0) + told.excess) / (DOUBT + told.weight)
            most = max(most, more / wide)
        return 1.0 + most

    def _closed(self, index: int, wander_s: float) -> InnovationConsistency:
        """The blocks that end before this one are told, and are part of the longer ones."""
        blocks, told, whole = list(self.blocks), list(self.told), InnovationBatch()
        for i, (block, before) in enumerate(zip(self.blocks, self.told, strict=True)):
            whole = block.with_block(whole)
            if index >> i == self.index >> i:
                blocks[i] = whole
                break
            blocks[i] = InnovationBatch()
            told[i] = before.with_block(whole, wandered_within(SHORTEST_NS * 1e-9 * 2**i, wander_s))
        return InnovationConsistency(self.expected, self.start_ns, index, tuple(blocks), tuple(told))


def drift_of(priors: ErrorPriors) -> InnovationConsistency:
    """Before any innovation."""
    return InnovationConsistency(EXPECTED if priors.sigma(Bias.ROLL) > 0.0 or priors.sigma(Bias.PITCH) > 0.0 else 1.0)


def whitened(innovation: PixelInnovation, priors: ErrorPriors, seconds: float) -> InnovationBatch:
    """One innovation in units of its noise; ``seconds``: since the first.

    Its covariance is its noise, what has been learned and not, and the vehicle's position error. The latter is told
    apart as the share of what is no noise that it may have.
    """
    (iuu, iuv, ivv), determinant = innovation.inverse, innovation.determinant
    uu, uv, vv = ivv * determinant, -iuv * determinant, iuu * determinant
    wander = sqrt(wandered(seconds, priors.position_bias_time_s))
    north, east = priors.sigma(Bias.POSITION_NORTH), priors.sigma(Bias.POSITION_EAST)
    by_u, by_v = innovation.rows
    un, vn = by_u[SharedParameter.NORTH] * north * wander, by_v[SharedParameter.NORTH] * north * wander
    ue, ve = by_u[SharedParameter.EAST] * east * wander, by_v[SharedParameter.EAST] * east * wander
    if wander > 0.0 and (north > 0.0 or east > 0.0):
        noise_uu, noise_uv, noise_vv = innovation.noise
        more = uu / noise_uu + vv / noise_vv - 2.0
        moved = (un * un + ue * ue) / noise_uu + (vn * vn + ve * ve) / noise_vv
        share = min(1.0, moved / more) if more > 0.0 else 1.0
        uu, uv, vv = uu - share * (uu - noise_uu), uv - share * (uv - noise_uv), vv - share * (vv - noise_vv)
    root_u = sqrt(uu)
    slope = uv / root_u
    root_v = sqrt(max(vv - slope * slope, LEAST * vv))
    du, dv = innovation.difference
    du, un, ue = du / root_u, un / root_u, ue / root_u
    dv, vn, ve = (dv - slope * du) / root_v, (vn - slope * un) / root_v, (ve - slope * ue) / root_v
    moved = hypot(un, ue, vn, ve) / wander if wander > 0.0 else 0.0
    return InnovationBatch(1, du, dv, un, vn, ue, ve, moved)


def wandered(seconds: float, time_s: float) -> float:
    """Variance of what wanders about its own mean over the seconds before, as a share of its whole variance.

    Of a Gauss-Markov process with this time constant: 1 - 2 cov(now, mean) + var(mean).
    """
    x = seconds / time_s if time_s > 0.0 else 0.0
    if x < 1e-3:
        return x * 2.0 / 3.0
    gone = -expm1(-x)
    return 1.0 - 2.0 * gone / x + 2.0 * (x - gone) / (x * x)


def wandered_within(seconds: float, time_s: float) -> float:
    """Variance of what wanders about its own mean within so many seconds, as a share of its whole variance: of a walk
    of 2 / time_s a second, a sixth of what it comes to.
    """
    return min(1.0, seconds / (3.0 * time_s)) if time_s > 0.0 else 0.0
