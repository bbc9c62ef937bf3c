"""The lines of a targets file (schema 1), one Struct for each type. PURE.

``run``, ``replay`` and ``demo`` write them, ``line_decoder`` reads them. The order of the fields is that of the file's
keys. Files of earlier versions may lack a field with a default. With ``omit_defaults`` it is absent where it has a
plain default (None, "", ()), and a field of :func:`null` is written nevertheless. Unknown fields are ignored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeAlias

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.types import ErrorBudget, TrackState
from fwav_companion.types.flight_status import ParameterReport

SCHEMA = 1
PlausibleMetres = Annotated[float, msgspec.Meta(ge=-1e8, le=1e8)]
"""A distance from an origin, metres; the limit is several times the Earth's diameter."""
PlausibleSeconds = Annotated[float, msgspec.Meta(ge=-9e9, le=9e9)]
"""A time since 1970, or since a start, or their difference: the sum of two fits into MCAP's 64 bits of nanoseconds."""


def null() -> None:
    """None as a default that is written: ``omit_defaults`` leaves out plain defaults alone."""


class OriginObject(msgspec.Struct, frozen=True):
    """The place of NED's zero, degrees and metres."""

    lat: float
    lon: float
    alt_amsl: float | None
    """Metres above mean sea level; None where altitudes count from the take-off."""

    @property
    def plane(self) -> TangentPlane:
        """NED about the origin; an altitude that is not known counts as 0."""
        return TangentPlane(self.geodetic)

    @property
    def geodetic(self) -> Geodetic:
        """The place; an altitude that is not known counts as 0."""
        return Geodetic.from_degrees(self.lat, self.lon, self.alt_amsl or 0.0)


class HeaderLine(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="header"):
    """The first line."""

    schema: int = SCHEMA
    version: str
    origin: OriginObject | None
    """None: not known when the header was written."""
    unix_offset_s: PlausibleSeconds
    """Recording's clock minus the host's monotonic clock, seconds."""
    config: Mapping[str, Any] = {}
    """The configuration by table and key, without secrets."""


class OriginLine(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="origin"):
    """An origin that became known after the header was written; also where a global position is lost or comes back."""

    time_unix: PlausibleSeconds | None = None
    origin: OriginObject | None
    lat: float | None = None
    lon: float | None = None
    alt_amsl: float | None = None
    yaw_deg: float | None = None
    """Yaw of NED's north in the autopilot's."""


class HomeLine(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="home"):
    """A change of the home surface."""

    time_unix: PlausibleSeconds | None = None
    down: float
    """Home surface in NED, metres."""


class TerrainLine(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="terrain"):
    """A shift of the elevation model to the take-off height."""

    time_unix: PlausibleSeconds
    shift_m: float
    sigma_m: float
    source: str


class ClockEstimateLine(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="type", tag="clock"):
    """The clock estimate, once a second."""

    time_monotonic: PlausibleSeconds
    time_boot: float
    host_from_autopilot_s: float
    """Host clock minus the autopilot's, seconds."""
    sigma_s: float
    bound_s: float
    """Hard bound of the error, seconds."""
    round_trip_s: float | None = msgspec.field(default_factory=null)
    rate: float | None = msgspec.field(default_factory=null)
    """Seconds of the host's clock in a second of the autopilot's."""
    utc_minus_time_unix_s: float | None = msgspec.field(default_factory=null)
    status: str = ""


class CalibrationLine(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="type",
                      tag="calibration"):  # fmt: skip
    """The state of self-calibration, once a second."""

    time_unix: PlausibleSeconds
    time_offset_s: float
    """Total delay, the configured one included, seconds."""
    time_offset_sigma_s: float
    mount_deg: Vector3
    """Mount correction, a rotation vector about the body axes, degrees."""
    mount_sigma_deg: Vector3
    status: str
    reason: str | None = msgspec.field(default_factory=null)
    """What is missing; None when calibrated."""
    parameters: tuple[ParameterReport, ...] = ()
    """Status of each parameter, where the smoother estimates."""
    mistake: str = ""
    """A gross error of the mount."""


class SightingLine(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="type", tag="sighting"):
    """One detection, used or not."""

    frame: int | None
    index: int
    """Index of the detection in its frame."""
    time_boot: float | None
    ray_ned: Vector3 | None = msgspec.field(default_factory=null)
    """Unit vector from the camera, NED."""
    camera_ned: Vector3 | None
    q_ned_body: Quaternion | None = msgspec.field(default_factory=null)
    q_ned_gimbal: Quaternion | None = None
    gap_s: float | None
    """Time to the nearest attitude, seconds."""
    reason: str | None
    """Why it gave no fix; None: it gave one."""
    budget: ErrorBudget | None
    ground_ned: Vector3 | None = msgspec.field(default_factory=null)
    """Place on the ground, NED, metres."""
    noise_cov: Matrix3 | None = msgspec.field(default_factory=null)
    """Covariance of the fix's noise alone, NED, m^2."""


class PlaceObject(msgspec.Struct, frozen=True, kw_only=True):
    """A place in NED, metres, with its covariance, m^2: of a fix, or of a target minus the vehicle."""

    north: PlausibleMetres
    east: PlausibleMetres
    down: PlausibleMetres
    cov: Matrix3


class InnovationObject(msgspec.Struct, frozen=True, kw_only=True):
    """A fix minus the prediction of its target, metres."""

    north: PlausibleMetres
    east: PlausibleMetres
    distance2: Annotated[float, msgspec.Meta(ge=0.0)]
    """Normalised innovation squared, 2 degrees of freedom."""


class TargetLine(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="type", tag="target"):
    """State of one live track after one processed frame."""

    time_unix: PlausibleSeconds
    time_boot: float | None = msgspec.field(default_factory=null)
    frame: int | None
    track: int
    label: str
    state: TrackState
    reason: str | None = None
    """Why the track was dropped."""
    replaced_by: int | None = None
    """Track that this one was merged into."""
    north: PlausibleMetres
    """NED, metres."""
    east: PlausibleMetres
    down: PlausibleMetres
    lat: float | None = msgspec.field(default_factory=null)
    lon: float | None = msgspec.field(default_factory=null)
    alt_amsl: float | None = msgspec.field(default_factory=null)
    cov: Matrix3
    """By every source of error, NED, m^2."""
    vel: Vector3 | None = msgspec.field(default_factory=null)
    vel_cov: Matrix3 | None = msgspec.field(default_factory=null)
    relative: PlaceObject | None = msgspec.field(default_factory=null)
    """Target minus vehicle at this capture; None without a position of the vehicle."""
    fix: PlaceObject | None
    """The fix of this frame alone."""
    innovation: InnovationObject | None = None
    alt_takeoff: float | None = None
    """Metres above the take-off, where the altitude of that is not known."""

    @property
    def lat_lon(self) -> tuple[float, float] | None:
        """Latitude and longitude, degrees; None without a global position."""
        return None if self.lat is None or self.lon is None else (self.lat, self.lon)

    @property
    def is_confirmed(self) -> bool:
        """Whether the target is confirmed, seen recently or coasting."""
        return self.state in (TrackState.CONFIRMED, TrackState.COASTING)


Line: TypeAlias = (
    HeaderLine
    | OriginLine
    | HomeLine
    | TerrainLine
    | ClockEstimateLine
    | CalibrationLine
    | SightingLine
    | TargetLine
    | SummaryLine
)
"""Any line of a targets file."""


def header_of(lines: Sequence[Line]) -> HeaderLine | None:
    """The header; None where the first line is not one."""
    return lines[0] if lines and isinstance(lines[0], HeaderLine) else None


def line_unix_s(line: Line, unix_offset_s: float) -> float | None:
    """Time of a line on the recording's clock, seconds; None for lines without a time. The offset is the header's."""
    match line:
        case ClockEstimateLine():
            return line.time_monotonic + unix_offset_s
        case HeaderLine() | SightingLine() | SummaryLine():
            return None
    return line.time_unix
