"""The protocol of a filter. The state of a target is immutable: an update returns a new one.

A user's filter is a class in a module on Python's search path, which includes the current folder. Its constructor takes
the configuration's :class:`~fwav_companion.types.ErrorPriors`. The class follows :class:`Filter`, its states follow
:class:`TargetState`. ``docs/examples/mean_filter.py`` is an example that runs with
``replay --allow-code --set tracking.filter=module:Class``.
"""

from __future__ import annotations

from typing import Protocol

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult


class ReportedTarget(Protocol):
    """A target as it is reported at one instant."""

    @property
    def position_ned(self) -> Vector3:
        """Position of the target, NED, metres."""

    @property
    def cov(self) -> Matrix3:
        """Covariance of the position, all sources of error included, NED, m^2."""

    @property
    def apparent_ned(self) -> Vector3:
        """Target position plus present error of the vehicle's position, NED, metres: single fixes agree with this."""

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of ``apparent_ned`` minus the reported position of the vehicle, NED, m^2."""

    @property
    def velocity_ned(self) -> Vector3 | None:
        """Velocity, NED, m/s; None if it is not estimated."""

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """Covariance of the velocity, NED, (m/s)^2."""


class TargetEstimate(ReportedTarget, Protocol):
    """Estimate of one target at one instant, which judges fixes."""

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant. Errors that state and fix share cancel in the innovation."""


class TargetState(TargetEstimate, Protocol):
    """One target between frames. Immutable: a snapshot of the tracker is a copy of references."""

    def predict(self, host_ns: HostNs) -> TargetState:
        """The state at a later instant."""

    def update(self, fix: GroundFix) -> TargetState:
        """The state after a fix of this instant."""


class SharedInnovation(msgspec.Struct, frozen=True, gc=False):
    """Horizontal innovation of a fix, with its sensitivities to the errors that all targets share, and its noise."""

    north_m: float
    east_m: float
    shared: tuple[Row, Row]
    """Sensitivities to shared errors of unit variance, north and east, metres; wander, if included, comes last."""
    noise: Symmetric2
    """Covariance of the noise, m^2."""


class Filter(Protocol):
    """Initiates targets."""

    def initiate(self, fix: GroundFix) -> TargetState:
        """The state after the first fix of a target."""
