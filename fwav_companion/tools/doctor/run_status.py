"""The service's status as `check` reads it: the status file's JSON, typed. Another version may lack any part."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, Final

import msgspec

from fwav_companion.types import Reason

ADOPTION_S: Final = 5.0
"""Seconds of listening until an autopilot is adopted: one heartbeat, three seconds of choosing, one second to spare."""
MEASURED_S: Final = 5.0
"""Seconds after adoption until rates, clock and position can be judged: a window of 2 s, begun within a second."""
REQUESTS: Final = 20
"""TIMESYNC requests without an answer before the autopilot counts as silent: 2 s."""


class StatusPart(msgspec.Struct, frozen=True, kw_only=True):
    """One part of the status. A field that is absent or null has its default."""


class PeerReport(StatusPart, frozen=True, kw_only=True):
    """One (system, component) heard on a link."""

    system: int
    component: int
    received: int = 0
    """Frames."""
    lost: int = 0
    """Frames missing by sequence number."""
    rates_hz: dict[str, float] = {}
    """By message name."""

    @property
    def loss(self) -> float:
        """Share of the frames that are missing, 0 to 1."""
        return self.lost / (self.received + self.lost) if self.lost > 0 else 0.0


class TrafficReport(StatusPart, frozen=True, kw_only=True):
    """MAVLink on one link."""

    name: str
    bytes_in: int = 0
    skipped_bytes: int = 0
    """Bytes that belong to no frame."""
    echoes: int = 0
    """Frames of this service that came back."""
    refused_signatures: int = 0
    """Frames with a signature that does not verify."""
    refused_unsigned: int = 0
    """Unsigned frames that were not believed."""
    signed_unverified: int = 0
    """Signed frames, where no key is configured."""
    peers: list[PeerReport] = []


class LinkReport(StatusPart, frozen=True, kw_only=True):
    """Connection of one link."""

    state: str = "not opened"
    """up | down | connecting."""
    why: str = ""


class StreamReport(StatusPart, frozen=True, kw_only=True):
    """One message that is requested from the autopilot at a rate."""

    asked_hz: float | None = None
    measured_hz: float | None = None
    """Over the last full window since the rate was granted; None before the first one ended."""
    state: str = ""
    undone_by: str = ""
    """Cause of a recent loss of the rate."""


class ClockReport(StatusPart, frozen=True, kw_only=True):
    """The autopilot's clock against the host's."""

    status: str = "unknown"
    """unknown | arrivals | settling | settled | followed."""
    skew: float = 0.0
    """Seconds by which the autopilot's clock falls behind in a second."""
    sigma_s: float | None = None
    bound_s: float | None = None
    round_trip_s: float | None = None
    """Best round trip."""


class TimesyncReport(StatusPart, frozen=True, kw_only=True):
    """TIMESYNC exchanges with the autopilot."""

    requests: int = REQUESTS
    """Sent since the adoption."""
    exchanges: int = 0
    """Answered."""


class IntakeReport(StatusPart, frozen=True, kw_only=True):
    """Frames of detections as they arrive."""

    came: int = 0
    age_s: float | None = None
    """Seconds since the last one."""
    why: str = ""
    """Why the port could not be opened."""


class VisionReport(StatusPart, frozen=True, kw_only=True):
    """The camera process."""

    works: bool = False
    why: str = ""


class TelemetryReport(StatusPart, frozen=True, kw_only=True):
    """The autopilot's telemetry."""

    attitude_source: str = "ATTITUDE"
    """The message that attitudes are taken from."""
    rates_hz: dict[str, float] = {}
    """By message name, 2 to 4 s back."""
    motion_hz: float = 0.0
    motion_swing: float = 0.0
    """RMS amplitude of the motion, rad."""
    too_slow_for_motion: bool = False
    pitch_trim_undone_deg: float | None = None
    relative_world: bool = False
    gimbal_unused: int | None = None
    """gimbal_device_id of a gimbal that is heard while none is configured."""


class AutopilotReport(StatusPart, frozen=True, kw_only=True):
    """The adopted autopilot."""

    system: int
    component: int = 1
    kind: str = ""
    """ardupilot | px4 | other."""
    armed: bool = False
    link: str = ""


class HeardReport(StatusPart, frozen=True, kw_only=True):
    """What frames brought, whether it was used or not."""

    labels: dict[str, int] = {}
    """Detections by label."""
    best_score: float | None = None
    stamp_ages_s: list[float] = []
    """Least age of a stamp at its arrival, in consecutive windows of 2 s."""


class AgreementReport(StatusPart, frozen=True, kw_only=True):
    """Agreement of the fixes of one target from frame to frame."""

    compared: int = 0
    apart: float = 0.0
    """Share that disagrees beyond 95 % of what [uncertainty] allows."""
    apart_m: float = 0.0
    """Median distance from their middle."""
    turn_deg: float | None = None
    """Turn of the mount about the body's down axis with which they agree."""
    label: str = ""


class ReadoutReport(StatusPart, frozen=True, kw_only=True):
    """Part of the error of fixes by an unknown readout."""

    matters: bool = False
    by_readout_m: float = 0.0
    """One sigma by the readout alone."""
    sigma_m: float = 0.0
    """One sigma of fixes relative to the vehicle."""


class SightReport(StatusPart, frozen=True, kw_only=True):
    """From detections to fixes."""

    axis_elevation_deg: float | None = None
    """Elevation of the optical axis above the horizon."""
    heard: HeardReport = HeardReport()
    agreement: AgreementReport = AgreementReport()
    readout: ReadoutReport = ReadoutReport()


class OriginReport(StatusPart, frozen=True, kw_only=True):
    """Origin of the local frame, degrees."""

    lat: float
    lon: float


class RunStatus(StatusPart, frozen=True, kw_only=True):
    """The whole status."""

    pid: int = 0
    config_path: str = ""
    time_monotonic: float = 0.0
    up_s: float = inf
    """Seconds since the service started; inf where the status does not hold it."""
    adopted_s: float = inf
    """Seconds since the autopilot was adopted; inf likewise."""
    internal_faults: int = 0
    recording: str = ""
    links: dict[str, LinkReport] = {}
    traffic: list[TrafficReport] = []
    autopilot: AutopilotReport | None = None
    autopilot_lost: bool = False
    clock: ClockReport = ClockReport()
    timesync: TimesyncReport = TimesyncReport()
    rates: dict[str, StreamReport] = {}
    parameters: dict[str, float] = {}
    origin: OriginReport | None = None
    telemetry: TelemetryReport = TelemetryReport()
    intake: IntakeReport = IntakeReport()
    vision: VisionReport | None = None
    sight: SightReport = SightReport()
    frames: int = 0
    detections: int = 0
    fixes: int = 0
    dropped: dict[str, int] = {}
    """Frames or detections by the reason of their refusal."""

    def traffic_of(self, link: str) -> TrafficReport:
        """Return the MAVLink traffic of a link; zeros where the status has none."""
        return next((each for each in self.traffic if each.name == link), TrafficReport(name=link))

    def link(self, name: str) -> LinkReport:
        """Return the connection of a link."""
        return self.links.get(name, LinkReport())

    def refused(self, *reasons: Reason) -> int:
        """Return how often these reasons together were counted."""
        return sum(self.dropped.get(reason.value, 0) for reason in reasons)


def run_status(decoded: Any) -> RunStatus | None:
    """Return the decoded JSON of a status file as a RunStatus; None where a part is of another type."""
    try:
        return msgspec.convert(_without_nulls(decoded), RunStatus)
    except msgspec.ValidationError:
        return None


def _without_nulls(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_nulls(each) for key, each in value.items() if each is not None}
    if isinstance(value, list):
        return [_without_nulls(each) for each in value if each is not None]
    return value
