"""What pairing asks of telemetry; the pipeline hands it in."""

from __future__ import annotations

from typing import Protocol

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.types import ClockEstimate, Unpaired, VehicleState


class TwoClocks(Protocol):
    """Host time and autopilot time in terms of one another."""

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """The host's instant, or NO_CLOCK."""

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """The autopilot's instant, or NO_CLOCK."""

    def estimate(self, now: HostNs) -> ClockEstimate:
        """How well they are known."""


class LocalWorld(Protocol):
    """Where positions are told."""

    @property
    def relative(self) -> bool | None:
        """Targets are relative to the point below the camera; None while that is not decided."""


class VehicleSource(Protocol):
    """A vehicle that can be asked where it was."""

    @property
    def clock(self) -> TwoClocks:
        """Its clock."""

    @property
    def world(self) -> LocalWorld:
        """Its world."""

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """The vehicle at this instant, or why that is not known."""

    def ready_for(self, boot_ns: BootNs) -> bool:
        """Waiting longer makes the state at this instant no better."""
