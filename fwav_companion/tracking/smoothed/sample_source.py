"""What the smoother takes of a vehicle's telemetry. Loads without numpy."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.types import AttitudeSample, RangeSample, Reason, ReportedGimbal, Unpaired, VehicleState


@runtime_checkable
class SampleSource(Protocol):
    """The vehicle's samples as sent."""

    def attitudes_after(self, boot_ns: BootNs) -> list[AttitudeSample]:
        """Attitudes later than the instant, in order of time."""

    def positions_after(self, boot_ns: BootNs) -> list[tuple[BootNs, bool]]:
        """Instants of positions later than the instant, in order, and whether the position jumped there."""

    def ranges_after(self, boot_ns: BootNs) -> list[RangeSample]:
        """A rangefinder's readings later than the instant, in order of time."""

    def gimbal_at(self, boot_ns: BootNs) -> ReportedGimbal | Reason:
        """Attitude of the gimbal that carries the camera between two of its reports, or the reason why it is not
        known.
        """

    def state_at(self, boot_ns: BootNs) -> VehicleState | Unpaired:
        """The state of the vehicle at this instant, or the reason why it is not known."""
