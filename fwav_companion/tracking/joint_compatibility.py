"""Joint compatibility: errors that all targets share move all fixes of a frame alike.

Seen from another side, targets are displaced by mount, heading, height and time, farther than they may be from one
another. A row of them then exchanges its tracks by one place, each pair within its own gate. The displacements of the
pairs must agree (Neira & Tardos 2001): an innovation is ``D b + noise`` with the biases b in sigmas of their priors,
and the pairs that are not in doubt show b. The targets are not corrected by it: their filter considers the biases.
"""

from __future__ import annotations

from math import exp, log

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, inner
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.tracking.filters.base import JointlyGated, SharedInnovation
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult

MEMORY_S = 20.0
"""Time constant with which the biases return to their priors: an autopilot's heading wanders in tens of seconds."""
WANDERING = 2
"""The last ones: how far the vehicle's position has wandered since a target was seen, north and east. The next frame
begins with their priors."""


class CommonBiases(msgspec.Struct, frozen=True, gc=False):
    """The biases as the innovations of all targets show them. Immutable."""

    mean: Row
    """In sigmas of their priors."""
    cov: tuple[Row, ...]
    host_ns: HostNs

    def predict(self, host_ns: HostNs) -> CommonBiases:
        """The biases at a later instant."""
        left, count = exp(-s_from_ns(host_ns - self.host_ns) / MEMORY_S), len(self.mean) - WANDERING
        rows = [[left * left * c for c in row[:count]] + [0.0] * WANDERING for row in self.cov[:count]]
        rows += [[0.0] * len(self.mean)] * WANDERING
        gone = [1.0 - left * left] * count + [1.0] * WANDERING
        cov = tuple([(*row[:i], row[i] + gone[i], *row[i + 1 :]) for i, row in enumerate(rows)])
        return CommonBiases((*[left * m for m in self.mean[:count]], *[0.0] * WANDERING), cov, host_ns)

    def gate(self, innovation: SharedInnovation, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix with this innovation, given these biases."""
        _, _, (n, e), (nn, ne, ee) = self._expected(innovation)
        (f_nn, f_ne, _), (_, f_ee, _), _ = fix.noise_cov
        area2 = nn * ee - ne * ne
        nis = (ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2
        return GateResult(nis, log(area2 / (f_nn * f_ee - f_ne * f_ne)))

    def update(self, innovation: SharedInnovation) -> CommonBiases:
        """The biases after one more innovation."""
        by_n, by_e, (n, e), (nn, ne, ee) = self._expected(innovation)
        scale = 1.0 / (nn * ee - ne * ne)
        i_nn, i_ne, i_ee = ee * scale, -ne * scale, nn * scale
        gains = [(a * i_nn + b * i_ne, a * i_ne + b * i_ee) for a, b in zip(by_n, by_e, strict=True)]
        mean = tuple([m + k_n * n + k_e * e for m, (k_n, k_e) in zip(self.mean, gains, strict=True)])
        cov = tuple(
            [
                tuple([c - k_n * a - k_e * b for c, a, b in zip(row, by_n, by_e, strict=True)])
                for row, (k_n, k_e) in zip(self.cov, gains, strict=True)
            ]
        )
        return CommonBiases(mean, cov, self.host_ns)

    def _expected(self, innovation: SharedInnovation) -> tuple[Row, Row, tuple[float, float], Symmetric2]:
        """Columns of cov D', the innovation less its expectation, and its covariance."""
        (d_n, d_e), (nn, ne, ee) = innovation.shared, innovation.noise
        by_n, by_e = tuple([inner(row, d_n) for row in self.cov]), tuple([inner(row, d_e) for row in self.cov])
        rest = (innovation.north_m - inner(self.mean, d_n), innovation.east_m - inner(self.mean, d_e))
        return by_n, by_e, rest, (nn + inner(by_n, d_n), ne + inner(by_n, d_e), ee + inner(by_e, d_e))


class JointGate:
    """The gate of one frame: it narrows with every pair that is learned."""

    __slots__ = ("_innovations", "_learned", "_now", "biases")

    def __init__(self, before: CommonBiases | None) -> None:
        """``before``: the biases after the frames before; None where nothing is known of them."""
        self.biases = before
        """The biases that the next frame begins with; None where nothing is known of them.

        A steady track has the same error in many frames: what its pair shows holds for this one.
        """
        self._now: CommonBiases | None = None
        self._learned: set[tuple[int, int]] = set()
        self._innovations: dict[tuple[int, int], SharedInnovation] = {}

    def gate(self, target: JointlyGated, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix, given what other pairs have shown."""
        innovation = self._innovation(target, fix)
        return self._known(innovation, fix).gate(innovation, fix)

    def learn(self, target: JointlyGated, fix: GroundFix, *, steady: bool) -> None:
        """Take this pair as not in doubt; the same one counts once.

        ``steady``: the pair is beyond doubt, so biases that exclude it are wrong, and are forgotten.
        """
        pair = (id(target), id(fix))
        if pair in self._learned:
            return
        self._learned.add(pair)
        innovation = self._innovation(target, fix)
        now = self._known(innovation, fix)
        if not steady:
            self.biases = (self.biases or now).update(innovation)
        elif now.gate(innovation, fix).nis > GATE:
            self.biases = self._now = None
            now = self._known(innovation, fix)
        self._now = now.update(innovation)

    def _innovation(self, target: JointlyGated, fix: GroundFix) -> SharedInnovation:
        pair = (id(target), id(fix))
        if pair not in self._innovations:
            self._innovations[pair] = target.innovation(fix)
        return self._innovations[pair]

    def _known(self, innovation: SharedInnovation, fix: GroundFix) -> CommonBiases:
        """The biases by now."""
        if self._now is None:
            host_ns = fix.sighting.frame_host_ns
            if self.biases is None:
                self.biases = unknown_biases(len(innovation.shared[0]), host_ns)
            self._now = self.biases = self.biases.predict(host_ns)
        return self._now


def unknown_biases(count: int, host_ns: HostNs) -> CommonBiases:
    """Biases of which their priors are known."""
    unit = tuple([tuple([float(i == j) for j in range(count)]) for i in range(count)])
    return CommonBiases((0.0,) * count, unit, host_ns)
