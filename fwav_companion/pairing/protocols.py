"""Protocols of the telemetry that pairing uses; the pipeline passes telemetry in."""

from __future__ import annotations

from typing import Protocol

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.types import Unpaired, VehicleState


class TwoClocks(Protocol):
    """The conversion between host clock and autopilot clock."""

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """The host instant of an autopilot instant, or NO_CLOCK."""

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """The autopilot instant of a host instant, or NO_CLOCK."""

    def sigma_s_at(self, host_ns: HostNs) -> float:
        """One sigma of the clock offset at a host instant, seconds."""

    def rate_at(self, host_ns: HostNs) -> float:
        """Autopilot seconds per host second; 1 for a clock that is a crystal's."""


class WorldFrame(Protocol):
    """The local frame of positions."""

    @property
    def relative(self) -> bool | None:
        """Whether targets are relative to the point below the camera; None while that is undecided."""


class VehicleSource(Protocol):
    """The vehicle's states over time."""

    @property
    def clock(self) -> TwoClocks:
        """The clocks of host and autopilot."""

    @property
    def world(self) -> WorldFrame:
        """The local frame of the vehicle's positions."""

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """The state of the vehicle at this instant, or the reason why it is not known."""

    def newest_state(self) -> VehicleState | Unpaired:
        """The newest state of the vehicle, or the reason why it is not known."""

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Whether waiting longer cannot improve the state at this instant."""
