"""The service's whole status: the status file holds it as JSON, and `check` assesses it.

Each room fills its own part; the service encodes the whole once a second. The names of the fields are the keys of the
file, which other programs read. Every field except names and addresses has a default, because the status of another
version may lack the field.
"""

from __future__ import annotations

from math import inf

import msgspec

from fwav_companion.types.camera import DeliveryReport
from fwav_companion.types.flight_status import (
    ActingReport,
    AutopilotReport,
    ClockReport,
    OriginReport,
    PublishingReport,
    SelfCalibrationReport,
    SightReport,
    TelemetryReport,
    TrackReport,
)
from fwav_companion.types.network_status import LinkReport, LinkStatistics, StreamReport, TimesyncReport
from fwav_companion.types.reasons import Reason


class IntakeReport(msgspec.Struct, frozen=True, kw_only=True):
    """Frames of detections as they arrive."""

    came: int = 0
    age_s: float | None = None
    """Seconds since the last frame; None before the first."""
    why: str = ""
    """Reason why the port could not be opened."""


class VisionReport(msgspec.Struct, frozen=True, kw_only=True):
    """The camera process."""

    works: bool = False
    why: str = ""
    """Reason why it does not work."""
    stopped: bool = False
    """Whether the detector cannot work as it is configured: it is not tried again."""
    pid: int | None = None
    deaths: int = 0
    """Number of camera processes that ended."""
    delivery: DeliveryReport | None = None
    """Size, rate and ages of the camera's pictures; None before the first two pictures."""


class PipelineStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The pipeline's part of the status."""

    autopilot: AutopilotReport | None = None
    autopilot_lost: bool = False
    obstacle: str | None = None
    """Why targets cannot be localized now, and what to do; "" where they can be; None without a camera."""
    adopted_s: float = inf
    """Seconds since the autopilot was adopted; inf before, which is null in JSON."""
    clock: ClockReport = ClockReport()
    timesync: TimesyncReport = TimesyncReport()
    rates: dict[str, StreamReport] = {}
    """Requested messages by name."""
    parameters: dict[str, float] = {}
    """Parameters of the autopilot that were read, by name."""
    origin: OriginReport | None = None
    telemetry: TelemetryReport = TelemetryReport()
    sight: SightReport | None = None
    """The chain from detections to fixes; None in a relay without a camera."""
    calibration: SelfCalibrationReport | None = None
    """Results of self-calibration; None where it is off."""
    publishing: PublishingReport = PublishingReport()
    acting: ActingReport | None = None
    """What is done about the selected target; None where [act] asks for nothing."""
    tracks: list[TrackReport] = []
    """Confirmed and coasting tracks, the oldest first; at most 64."""
    footprint: list[tuple[float, float]] = []
    """Latitude and longitude of the border of the camera's footprint, degrees; empty without a recent picture."""
    frames: int = 0
    detections: int = 0
    fixes: int = 0
    dropped: dict[str, int] = {}
    """Number of refused frames and detections by reason."""
    dropped_frames: dict[str, int] = {}
    """Number of frames that were refused as a whole, by reason."""
    dropped_detections: dict[str, int] = {}
    """Number of refused detections in frames that were used, by reason."""

    @property
    def seen(self) -> SightReport:
        """The chain from detections to fixes; without a camera, a report without any frames."""
        return self.sight or SightReport()

    def refused(self, *reasons: Reason) -> int:
        """Return the sum of the counts of these reasons."""
        return sum(self.dropped.get(reason.value, 0) for reason in reasons)


class RunStatus(PipelineStatus, frozen=True, kw_only=True):
    """The whole status."""

    version: str = ""
    pid: int = 0
    config: str = ""
    config_path: str = ""
    time_unix: float = 0.0
    time_monotonic: float = 0.0
    up_s: float = inf
    """Seconds since the service started; inf where the status does not hold it."""
    internal_faults: int = 0
    links: dict[str, LinkReport] = {}
    """Connection of each link, by name."""
    traffic: list[LinkStatistics] = []
    intake: IntakeReport = IntakeReport()
    vision: VisionReport | None = None
    """The camera process; None without [vision]."""
    recording: str | None = None
    """State of the recording; None where no recording is configured."""

    def traffic_of(self, link: str) -> LinkStatistics:
        """Return the MAVLink traffic of a link; zeros where the status has none."""
        return next((each for each in self.traffic if each.name == link), LinkStatistics(name=link))

    def link(self, name: str) -> LinkReport:
        """Return the connection of a link."""
        return self.links.get(name, LinkReport())
