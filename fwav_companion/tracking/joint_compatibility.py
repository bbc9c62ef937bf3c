"""Joint compatibility: errors that all targets share move all fixes of a frame alike.

Seen from another side, targets are displaced by errors of mount, heading, height and time, possibly by more than their
distance from one another. A row of targets then exchanges its tracks by one place, with each pair within its own gate.
The displacements of the pairs must agree (Neira & Tardos 2001): an innovation is ``D b + noise`` with the biases b in
sigmas of their priors, and the unambiguous pairs show b. The estimate of b does not correct the targets, because their
filter considers the biases.
"""

from __future__ import annotations

from math import exp, log

from msgspec.structs import replace

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.tracking.filters.base import SharedInnovation
from fwav_companion.tracking.filters.bias_estimate import BiasEstimate
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult

MEMORY_S = 20.0
"""Time constant with which the biases return to their priors: an autopilot's heading wanders in tens of seconds."""
WANDERING = 2
"""Number of wander states, the last two of the biases: how far the vehicle's position has wandered since a target was
seen, north and east. Each frame begins with their priors."""


class CommonBiases(BiasEstimate, frozen=True, gc=False):
    """Estimate of the shared biases by the innovations of all targets. Immutable."""

    host_ns: HostNs = HostNs(0)
    """Instant of the estimate; priors are the same at every instant."""

    def predict(self, host_ns: HostNs) -> CommonBiases:
        """The biases at a later instant."""
        left, count = exp(-s_from_ns(host_ns - self.host_ns) / MEMORY_S), len(self.mean) - WANDERING
        return replace(self.decayed((left,) * count + (0.0,) * WANDERING), host_ns=host_ns)

    def gate(self, innovation: SharedInnovation, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix with this innovation, given these biases."""
        (f_nn, f_ne, _), (_, f_ee, _), _ = fix.noise_cov
        seen = self.residual(innovation)
        return GateResult(seen.nis, log(seen.area2 / (f_nn * f_ee - f_ne * f_ne)))


class JointGate:
    """The gate of one frame: it narrows with every pair that is learned."""

    __slots__ = ("_innovations", "_learned", "_now", "biases")

    def __init__(self, before: CommonBiases | None) -> None:
        """``before``: the biases after the previous frames; None where they are unknown."""
        self.biases = before
        """The biases with which the next frame begins; None where they are unknown.

        A steady track has the same error in many frames, so its pair counts for the present frame only.
        """
        self._now: CommonBiases | None = None
        self._learned: set[tuple[int, int]] = set()
        self._innovations: dict[tuple[int, int], SharedInnovation] = {}

    @property
    def pairs(self) -> int:
        """Number of pairs learned. The gates do not change until another pair is learned."""
        return len(self._learned)

    def gate(self, target: StandingTargetState, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix, given what other pairs have shown."""
        innovation = self._innovation(target, fix)
        return self._known(innovation, fix).gate(innovation, fix)

    def learn(self, target: StandingTargetState, fix: GroundFix, *, steady: bool) -> None:
        """Update the biases with an unambiguous pair; a repeated pair counts once.

        ``steady``: the pair is beyond doubt, so biases that exclude it are wrong and return to their priors.
        """
        pair = (id(target), id(fix))
        if pair in self._learned:
            return
        self._learned.add(pair)
        innovation = self._innovation(target, fix)
        now = self._known(innovation, fix)
        seen = now.residual(innovation)
        if not steady:
            before = self.biases or now
            self.biases = before.update(before.residual(innovation))
        elif seen.nis > GATE:
            self.biases = self._now = None
            now = self._known(innovation, fix)
            seen = now.residual(innovation)
        self._now = now.update(seen)

    def _innovation(self, target: StandingTargetState, fix: GroundFix) -> SharedInnovation:
        pair = (id(target), id(fix))
        if pair not in self._innovations:
            self._innovations[pair] = target.innovation(fix)
        return self._innovations[pair]

    def _known(self, innovation: SharedInnovation, fix: GroundFix) -> CommonBiases:
        """The biases at the instant of the fix, after the pairs learned so far."""
        if self._now is None:
            before = self.biases or CommonBiases.prior(len(innovation.shared[0]))
            self._now = self.biases = before.predict(fix.sighting.frame_host_ns)
        return self._now
