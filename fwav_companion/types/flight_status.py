"""The flight in the service's status: telemetry, and the chain from detections to published tracks."""

from __future__ import annotations

import msgspec
from msgspec import UNSET, UnsetType

APART = 0.4
"""Share of fixes beyond the 95 % bound by [uncertainty] from which fixes disagree: it is at most 0.3 in the mock's
healthy flights, and at least 0.45 with a mount turned by 90 deg."""
APART_M = 0.8
"""Least median distance of fixes that disagree, metres: that of fixes that swing by a metre to each side."""


class AutopilotReport(msgspec.Struct, frozen=True, kw_only=True):
    """The adopted autopilot."""

    system: int
    component: int = 1
    kind: str = ""
    """An :class:`~fwav_companion.types.AutopilotKind`."""
    vehicle_type: int = 0
    """MAV_TYPE of the heartbeat."""
    armed: bool = False
    link: str = ""
    """Name of the link on which the last heartbeat arrived."""
    age_s: float | None = None
    """Seconds since that heartbeat."""


class ClockReport(msgspec.Struct, frozen=True, kw_only=True):
    """The autopilot's clock against the host's, as in :class:`~fwav_companion.types.ClockEstimate`."""

    at_ns: int = 0
    host_from_autopilot_ns: int = 0
    skew: float = 0.0
    sigma_s: float | None = None
    """One sigma of the offset, seconds; null in JSON where it is infinite."""
    bound_s: float | None = None
    """Hard bound of the error, seconds; null in JSON where it is infinite."""
    round_trip_s: float | None = None
    """Best round trip, seconds."""
    status: str = "unknown"
    """A :class:`~fwav_companion.types.ClockStatus`."""
    rate_differs: bool = False
    """Whether the rate differs from 1 beyond three sigmas and 200 ppm."""


class OriginReport(msgspec.Struct, frozen=True, kw_only=True):
    """Origin of the local frame, degrees and metres."""

    lat: float
    lon: float
    alt_amsl: float = 0.0


class AttitudeReport(msgspec.Struct, frozen=True, kw_only=True):
    """Quality of the attitude stream."""

    interpolation: str = ""
    """Method between two samples."""
    interpolation_sigma: float | None = None
    """One sigma of the interpolated attitude, rad; None until it was measured."""
    motion_hz: float = 0.0
    """Frequency of the vehicle's motion, Hz; 0 where it is still."""
    motion_swing: float = 0.0
    """RMS amplitude of the motion, rad."""
    too_slow_for_motion: bool = False
    rates_agree: bool = False
    """Whether the body rates are the derivative of the attitudes, except for a lag and a gain."""
    rates_lag_s: float | None = None
    rates_gain: float | None = None


class GimbalReport(msgspec.Struct, frozen=True, kw_only=True):
    """The gimbal that carries the camera."""

    device_id: int = 0
    age_s: float | None = None
    """Age of the newest attitude, seconds."""
    yaw_from: str | None = None
    """Direction from which yaw counts: ``north`` or ``the vehicle's heading``."""
    levelled: bool | None = None
    """Whether roll and pitch count from the horizon; None while it is not known."""
    refused_as: str | None = None
    """A :class:`~fwav_companion.types.Reason`: why every attitude is refused; None where one was taken."""
    heading_off_deg: float | None = None
    """Gimbal's idea of the vehicle's heading less the autopilot's, where it was reported, degrees."""
    interpolation_sigma: float = 0.0
    """One sigma of the attitude between two samples, rad."""
    refused: int = 0


class TelemetryReport(AttitudeReport, frozen=True, kw_only=True):
    """The autopilot's telemetry."""

    rates_hz: dict[str, float] = {}
    """Rates by message name over the last full window, which began 2 to 4 s ago, Hz."""
    attitude_source: str | None = None
    """The message that attitudes are taken from; None before the first."""
    attitudes_kept: int = 0
    attitude_stamp_delay_s: float = 0.0
    """Delay of the attitude stamps relative to the sampling, seconds."""
    attitude_stamps_in_step: bool = False
    """Whether these stamps are synchronous with the sampling."""
    pitch_trim_undone_deg: float | None = None
    relative_world: bool | None = None
    """Whether targets are relative to the vehicle; None until it is decided."""
    position: str | None = None
    """Position in use: global, local (the autopilot's own frame) or none; None until it is decided."""
    local_trouble: str | None = None
    """Why the autopilot does not vouch for its local position; "" where it does, None before its filter's report."""
    height_source: str | None = None
    """What shows the height above home now; None without a height."""
    barometer_starts_in_air: bool = False
    """Whether the vehicle was first received armed, so that its barometer has no mean on the ground."""
    home_down_m: float | None = None
    """Depth of the home surface below the origin, metres."""
    refused: dict[str, int] = {}
    """Messages that could not be used, by name."""
    reboots: int = 0
    gimbal_unused: int | None = None
    """gimbal_device_id of a gimbal that is received while none is configured."""
    gimbal: GimbalReport | None = None


class GroundReport(msgspec.Struct, frozen=True, kw_only=True):
    """The ground model: its name, and the fields that this model has."""

    model: str = ""
    """home | fixed | rangefinder | terrain."""
    home_down_m: float | UnsetType = UNSET
    """home: depth of the surface below the origin, metres."""
    height_m: float | UnsetType = UNSET
    """fixed: height of the camera above the surface, metres."""
    fallback: str | UnsetType | None = UNSET
    """rangefinder: reason why the home surface is used now; null: it is not used."""
    fallbacks: dict[str, int] | UnsetType = UNSET
    """rangefinder: counts of the reasons for using the home surface."""
    source: str | UnsetType = UNSET
    """terrain: ``files`` or ``TERRAIN_REPORT``."""
    datum: str | UnsetType = UNSET
    """terrain: vertical datum of the files."""
    shift_m: float | UnsetType = UNSET
    """terrain: shift of the model to the take-off height, metres."""
    shift_sigma_m: float | UnsetType | None = UNSET
    """terrain: one sigma of the model's level after this shift, metres; null: not placed yet."""
    shift_source: str | UnsetType | None = UNSET
    """terrain: a :class:`~fwav_companion.types.TakeOffSource`; null: not placed yet."""
    trouble: str | UnsetType | None = UNSET
    """terrain: reason why the model gives no fixes."""


class HeardReport(msgspec.Struct, frozen=True, kw_only=True):
    """Contents of all received frames, used or refused."""

    labels: dict[str, int] = {}
    """Detections by label."""
    best_score: float | None = None
    stamp_ages_s: list[float] = []
    """Least age of a stamp at its arrival, in consecutive windows of 2 s, the oldest first."""
    repeated_stamps: int = 0
    """Number of frames with the stamp of the frame before."""
    jumped_stamps: int = 0
    """Number of jumps of the stamps to an earlier time."""


class AgreementReport(msgspec.Struct, frozen=True, kw_only=True):
    """Agreement of the fixes of one target from frame to frame."""

    compared: int = 0
    apart: float = 0.0
    """Share of fixes that disagree by more than the 95 % bound of [uncertainty]."""
    apart_m: float = 0.0
    """Median distance of the fixes from their middle, metres."""
    turn_deg: float | None = None
    """Turn of the mount about the body's down axis with which the fixes agree, degrees; None: no such turn."""
    label: str = ""

    @property
    def disagrees(self) -> bool:
        """Whether the fixes of a target that does not move contradict the claimed accuracy."""
        return self.apart >= APART and self.apart_m >= APART_M


class ReadoutReport(msgspec.Struct, frozen=True, kw_only=True):
    """Part of an unknown readout in the error of fixes."""

    matters: bool = False
    by_readout_m: float = 0.0
    """One sigma due to the readout alone, metres."""
    sigma_m: float = 0.0
    """One sigma of fixes relative to the vehicle, metres."""


class LandmarkReport(msgspec.Struct, frozen=True, kw_only=True):
    """Sights of one landmark, and the use that was made of them."""

    label: str
    state: str = "unseen"
    """unseen | used | left_out."""
    used: int = 0
    """Number of sights that were used."""
    refused: int = 0
    """Number of sights that disagreed with all other measurements."""
    off_m: float = 0.0
    """Distance between its known place and its place by the refused sights, metres."""
    contradicts: tuple[str, ...] = ()
    """Labels of the landmarks that it contradicts, where the flight does not show which is wrong."""


class SightReport(msgspec.Struct, frozen=True, kw_only=True):
    """The chain from detections to fixes."""

    ground: GroundReport = GroundReport()
    refused: str | None = None
    """Reason why the newest frame was refused."""
    axis_elevation_deg: float | None = None
    """Elevation of the optical axis above the horizon, degrees."""
    heard: HeardReport = HeardReport()
    agreement: AgreementReport = AgreementReport()
    readout: ReadoutReport = ReadoutReport()
    landmarks: list[LandmarkReport] = []
    solves: SolveReport | None = None
    """Solves of the smoother; None where it does not estimate."""


class ParameterReport(msgspec.Struct, frozen=True, kw_only=True):
    """One of the errors that all sightings of a flight share."""

    name: str
    """With its unit, as ``mount_x_deg``."""
    status: str = ""
    """``calibrated``, ``waiting`` or ``contradicts`` (the configuration)."""
    reason: str | None = None
    """What it waits for, or by how many sigmas it contradicts which key; None when calibrated."""
    estimate: float = 0.0
    """Reported minus true; of the mount its correction, true minus configured."""
    sigma: float = 0.0
    prior_sigma: float = 0.0
    """One sigma before the flight."""


class SolveReport(msgspec.Struct, frozen=True, kw_only=True):
    """Solves of the smoother."""

    taken: int = 0
    """Solves that were taken over."""
    late: int = 0
    """Solves that were not ready at their take-over: the board is overloaded."""
    failed: int = 0
    """Solves without a finite estimate: the former one stays."""


class SelfCalibrationReport(msgspec.Struct, frozen=True, kw_only=True):
    """Results of self-calibration."""

    status: str = ""
    reason: str | None = None
    """Name of what is still missing; None when calibrated."""
    time_offset_s: float = 0.0
    """Total time offset, the configured one included, seconds."""
    time_offset_sigma_s: float | None = None
    mount_deg: list[float] = []
    """Correction of the mount, a rotation vector in body axes, degrees."""
    mount_sigma_deg: list[float] = []
    time_offset_rivals_s: list[float] = []
    """Delays between which the flight does not decide, seconds."""
    mistake: str = ""
    """A gross mistake of the mount."""
    replaced: bool = False
    """Whether an earlier flight's calibration was dropped because the camera has moved."""
    configuration_lines: list[str] = []
    """Lines to paste into the configuration."""
    parameters: list[ParameterReport] = []
    """Status of each parameter, where the smoother estimates."""


class LandingReport(msgspec.Struct, frozen=True, kw_only=True):
    """LANDING_TARGET messages."""

    target: int | None = None
    """Track to land on."""
    sent: int = 0
    sigma_m: float | None = None
    """One sigma of the target relative to the vehicle at the newest attempt, larger semi-axis, metres; None before."""
    offset_m: tuple[float, float, float] | None = None
    """Target from the vehicle in the newest message: forward and right along the heading, down; metres. None before the
    first message, and after a landing."""
    offset_age_s: float | None = None
    """Age of that message's instant, seconds."""
    landed_offset_m: tuple[float, float] | None = None
    """Target from the vehicle in the last message before the last landing on it: forward, right; metres. None before
    one."""
    withheld: dict[str, int] = {}
    """Attempts without a message, by reason: one a frame, and five a second while no frame comes."""
    withheld_s: float | None = None
    """Time for which the messages of a known target have been withheld, seconds; None where they flow."""
    last_withheld: str | None = None
    """Reason at the newest attempt; None where its message was sent."""


class TrackReport(msgspec.Struct, frozen=True, kw_only=True):
    """One confirmed or coasting track."""

    track: int
    label: str = ""
    state: str = ""
    """A :class:`~fwav_companion.types.TrackState`."""
    lat: float | None = None
    """Latitude, degrees; null without a global position, as is the longitude."""
    lon: float | None = None
    alt_amsl: float | None = None
    cov: tuple[float, ...] = ()
    """Upper triangle of the position's covariance with every error source, NED, m^2."""
    last_seen_s: float = 0.0
    """Seconds since the last fix."""
    first_seen_s: float = 0.0
    """Seconds since the first fix."""


class PublishingReport(msgspec.Struct, frozen=True, kw_only=True):
    """Publishing: the selected track, and the messages of landing and maps."""

    selected: int | None = None
    """Selected track."""
    selected_by: str = ""
    landing: LandingReport = LandingReport()


class ActingReport(msgspec.Struct, frozen=True, kw_only=True):
    """What is done about the target that an operator selected."""

    point: str = "none"
    follow_target: bool = False
    acts: bool = False
    """Whether an operator's selection permits it now."""
    manager: str | None = None
    """System/component of the gimbal's manager; None before it was found."""
    pitch_limits_deg: tuple[float, float] | None = None
    yaw_limits_deg: tuple[float, float] | None = None
    """Least and largest angle that the manager reports; None where it does not."""
    primary: str | None = None
    """System/component that controls the gimbal by the manager's status."""
    last_end: str | None = None
    """Why it ended last."""
    follow_id_heard: bool = False
    """Whether another system is heard with [act] follow_system_id."""
