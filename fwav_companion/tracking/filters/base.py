"""The protocol of a filter: states of one target, replaced and never changed.

A user's filter is a class in a module that Python finds (the current folder too). It is made with the configuration's
:class:`~fwav_companion.types.ErrorPriors` and follows :class:`Filter`; its states follow :class:`TargetState`.
``docs/examples/mean_filter.py`` is one that runs: ``replay --allow-code --set tracking.filter=module:Class``.
"""

from __future__ import annotations

from typing import Protocol

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult


class TargetEstimate(Protocol):
    """One target at one instant."""

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

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant. Errors that state and fix share cancel in the innovation."""


class TargetState(TargetEstimate, Protocol):
    """One target between frames. Immutable: a snapshot of the tracker is a copy of references."""

    def predict(self, host_ns: HostNs) -> TargetState:
        """The state at a later instant."""

    def update(self, fix: GroundFix) -> TargetState:
        """The state after a fix of this instant."""


class SharedInnovation(msgspec.Struct, frozen=True, gc=False):
    """A fix minus the predicted target, horizontal, by the errors that all targets share and by noise."""

    north_m: float
    east_m: float
    shared: tuple[Row, Row]
    """Sensitivities to shared errors of unit variance, north and east, metres; the last two are the wander's."""
    noise: Symmetric2
    """Covariance by noise, m^2."""


class Filter(Protocol):
    """Initiates targets."""

    def initiate(self, fix: GroundFix) -> TargetState:
        """The state after the first fix of a target."""
