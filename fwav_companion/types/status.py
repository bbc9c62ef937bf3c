"""The service's status as a whole: what the status file holds as JSON, and what `check` judges.

Each room fills its own part; the service encodes the whole once a second. The names of the fields are the keys of the
file, which other programs read. Every field but names and addresses has a default, for the status of another version,
which may lack it.
"""

from __future__ import annotations

from math import inf

import msgspec

from fwav_companion.types.camera import DeliveryReport
from fwav_companion.types.flight_status import (
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
    """Seconds since the last one."""
    why: str = ""
    """Why the port could not be opened."""


class VisionReport(msgspec.Struct, frozen=True, kw_only=True):
    """The camera process."""

    works: bool = False
    why: str = ""
    """Reason why it does not work."""
    pid: int | None = None
    deaths: int = 0
    """Processes that ended."""
    delivery: DeliveryReport | None = None
    """What the camera delivers; None before the first two pictures."""


class PipelineStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The pipeline's part of the status."""

    autopilot: AutopilotReport | None = None
    autopilot_lost: bool = False
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
    """None in a relay without a camera."""
    calibration: SelfCalibrationReport | None = None
    """None where self-calibration is off."""
    publishing: PublishingReport = PublishingReport()
    tracks: list[TrackReport] = []
    """Confirmed and coasting tracks, the oldest first; at most 64."""
    footprint: list[tuple[float, float]] = []
    """Latitude and longitude of the border of what the camera sees, degrees; empty without a recent picture."""
    frames: int = 0
    detections: int = 0
    fixes: int = 0
    dropped: dict[str, int] = {}
    """Frames or detections by the reason of their refusal."""
    dropped_frames: dict[str, int] = {}
    """The same of frames that were refused as a whole."""
    dropped_detections: dict[str, int] = {}
    """The same of detections in frames that were used."""

    @property
    def seen(self) -> SightReport:
        """The way from detections to fixes; without a camera one in which nothing was seen."""
        return self.sight or SightReport()

    def refused(self, *reasons: Reason) -> int:
        """Return how often these reasons together were counted."""
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
    """By name."""
    traffic: list[LinkStatistics] = []
    intake: IntakeReport = IntakeReport()
    vision: VisionReport | None = None
    """None without [vision]."""
    recording: str | None = None
    """State of the recording; None where no recording is configured."""

    def traffic_of(self, link: str) -> LinkStatistics:
        """Return the MAVLink traffic of a link; zeros where the status has none."""
        return next((each for each in self.traffic if each.name == link), LinkStatistics(name=link))

    def link(self, name: str) -> LinkReport:
        """Return the connection of a link."""
        return self.links.get(name, LinkReport())
