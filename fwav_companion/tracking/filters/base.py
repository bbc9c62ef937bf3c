"""The protocol of a filter: states of one target, replaced and never changed.

A user's filter is a class in a module that Python finds (the current folder too). It is made with the configuration's
:class:`~fwav_companion.types.ErrorPriors` and follows :class:`Filter`; its states follow :class:`TargetState`.
``docs/examples/mean_filter.py`` is one that runs: ``replay --allow-code --set tracking.filter=module:Class``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult, GateShare


class TargetState(Protocol):
    """One target. Immutable: a snapshot of the tracker is a copy of references."""

    @property
    def position_ned(self) -> Vector3:
        """Place, NED, metres."""

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place by every source of error, NED, m^2."""

    @property
    def apparent_ned(self) -> Vector3:
        """Place plus the present error of the vehicle's position, NED, metres: what single fixes agree with now."""

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of ``apparent_ned`` minus the reported position of the vehicle, NED, m^2."""

    @property
    def velocity_ned(self) -> Vector3 | None:
        """Velocity, NED, m/s; None where the filter has none."""

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """Covariance of the velocity, NED, (m/s)^2."""

    def predict(self, host_ns: HostNs) -> TargetState:
        """The state at a later instant."""

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant. Errors that state and fix share cancel in the innovation."""

    def update(self, fix: GroundFix) -> TargetState:
        """The state after a fix of this instant."""


class CoarselyGated(TargetState, Protocol):
    """A target state with which many targets are gated several times as fast. Optional for a filter."""

    @property
    def gate_share(self) -> GateShare:
        """The share of this target in the variance of any innovation that :meth:`TargetState.gate` accepts."""

    def gate_share_of(self, fix: GroundFix) -> GateShare:
        """The share of a fix in it; the same for every target of the filter."""

    def gates(self, fixes: Sequence[GroundFix]) -> list[GateResult]:
        """:meth:`TargetState.gate` of several fixes."""


class SharedInnovation(msgspec.Struct, frozen=True, gc=False):
    """A fix minus the predicted target, horizontal, by the errors that all targets share and by noise."""

    north_m: float
    east_m: float
    shared: tuple[Row, Row]
    """Sensitivities to shared errors of unit variance, north and east, metres; the last two are the wander's."""
    noise: Symmetric2
    """Covariance by noise, m^2."""


class JointlyGated(TargetState, Protocol):
    """A target state whose fixes are gated given what those of other targets show. Optional for a filter."""

    @property
    def nonlinear(self) -> bool:
        """Whether errors that targets share may displace fixes out of proportion to their sensitivities."""

    def innovation(self, fix: GroundFix) -> SharedInnovation:
        """The innovation of a fix at this instant."""


class Filter(Protocol):
    """Initiates targets."""

    def initiate(self, fix: GroundFix) -> TargetState:
        """The state after the first fix of a target."""
