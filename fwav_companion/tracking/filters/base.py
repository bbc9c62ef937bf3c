"""What the tracker needs of a filter: a belief about one target that is replaced, never changed.

A filter of one's own: a class in a module that Python finds (the current folder too), which is made with the
configuration's :class:`~fwav_companion.types.ErrorPriors` and is a :class:`Filter`; its beliefs need every attribute
of :class:`TargetState`. ``replay --set tracking.filter=module:Class`` puts a recorded flight through it.
"""

from __future__ import annotations

from typing import Protocol

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult, GateShare


class TargetState(Protocol):
    """One target as a filter sees it. Immutable: a snapshot of the tracker is a copy of references."""

    @property
    def position_ned(self) -> Vector3:
        """Metres."""

    @property
    def cov(self) -> Matrix3:
        """Every source of error, m^2, NED."""

    @property
    def apparent_ned(self) -> Vector3:
        """Position plus the present error of the vehicle's position, NED, metres: what single fixes agree with now."""

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of ``apparent_ned`` about the true vector from the vehicle, NED, m^2."""

    @property
    def velocity_ned(self) -> Vector3 | None:
        """m/s; None where the filter has none."""

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """(m/s)^2, NED."""

    def predict(self, host_ns: HostNs) -> TargetState:
        """The same target at a later instant."""

    def gate(self, fix: GroundFix) -> GateResult:
        """How little a fix at this instant was expected.

        Errors that the belief and the fix share cancel, as they do in the difference that is weighed.
        """

    def update(self, fix: GroundFix) -> TargetState:
        """With a fix of this instant blended in."""


class CoarselyGated(TargetState, Protocol):
    """A target state with which many targets are gated several times as fast. Optional for a filter."""

    @property
    def gate_share(self) -> GateShare:
        """The share of this target in the variance of any innovation that :meth:`TargetState.gate` accepts."""

    def gate_share_of(self, fix: GroundFix) -> GateShare:
        """The share of a fix in it; the same for every target of the filter."""


class Filter(Protocol):
    """Starts beliefs."""

    def initiate(self, fix: GroundFix) -> TargetState:
        """The belief after the first fix of a target."""
