"""All options with their defaults. A scenario lists only its differences from these.

Degrees, seconds, metres, hertz. ``None`` in :class:`Biases` means: drawn from the :class:`Priors` by the seed.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Annotated, Any, Literal, TypeAlias

from msgspec import Meta

Triple: TypeAlias = tuple[float, float, float]
Waypoint: TypeAlias = tuple[float, float, float, float, float]
"""(at_s, north, east, up, heading_deg): north and east from the flight centre, up from the ground, metres."""
PositionShift: TypeAlias = tuple[float, float, float, float]
"""(from_s, to_s, north, east): the estimator shifts its position by (north, east) metres between the two instants."""
Positive: TypeAlias = Annotated[float, Meta(gt=0.0)]
MOST_HZ = 10_000.0
"""Highest frame rate, above any camera's; without a bound a flight of one second might never end."""
FrameRate: TypeAlias = Annotated[float, Meta(gt=0.0, le=MOST_HZ)]
TruthRate: TypeAlias = Annotated[float, Meta(ge=0.0, le=MOST_HZ)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0.0)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Size: TypeAlias = Annotated[int, Meta(ge=1, le=8192)]


@dataclass(frozen=True, kw_only=True)
class Priors:
    """One sigma of each noise and bias, by the names of the companion's ``[uncertainty]``; errors are drawn from
    these.
    """

    pixel_noise_px: float = 4.0
    attitude_noise_deg: float = 0.1
    attitude_bias_deg: float = 0.5
    heading_bias_deg: float = 2.0
    position_noise_m: float = 0.1
    position_bias_m: float = 1.0
    position_bias_time_s: float = 60.0
    height_noise_m: float = 0.3
    height_bias_m: float = 0.5
    mount_bias_deg: float = 1.0
    time_offset_sigma_s: float = 0.01
    position_delay_sigma_s: float = 0.05
    lever_arm_sigma_m: float = 0.03
    velocity_noise_m_s: float = 0.05


@dataclass(frozen=True, kw_only=True)
class Biases:
    """Errors that last a whole flight. ``None``: drawn. A number: exactly that value."""

    attitude_roll_deg: float | None = None
    attitude_pitch_deg: float | None = None
    heading_deg: float | None = None
    mount_deg: Triple | None = None
    """Mount error, rotation vector in body axes: body_from_camera = Exp(mount_deg) * (the configured one)."""
    time_offset_s: float | None = None
    """Error of the camera's stamps, in addition to camera.time_offset_s; positive: late."""
    height_m: float | None = None
    """Reported height minus true height."""
    altitude_m: float = 0.0
    """Reported altitude above sea level minus the true one: of positions, of home and of the EKF origin alike. Heights
    above home do not have it. Never drawn."""
    position_m: float | None = None
    """Sigma of the wandering horizontal position error; None: the prior."""
    position_delay_s: float | None = None
    """Age of a position at its stamp, in addition to autopilot.position_delay_s."""
    lever_arm_m: Triple | None = None
    """True camera position in the body minus camera.position_m."""
    readout_s: float | None = None
    """True readout time; None: camera.readout_s, and where that is None too, uniform over [0, frame interval]."""


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """Motion of the vehicle, about a flight centre on the ground."""

    pattern: Literal["hover", "orbit", "figure_eight", "racetrack", "hand", "waypoints"] = "orbit"
    """hand: held by hand over the flight centre and shaken. waypoints: through ``waypoints``."""
    waypoints: tuple[Waypoint, ...] = ()
    """Waypoints of the pattern waypoints: minimum-jerk segments between them; ``height_m`` and the heading options do
    not apply then."""
    heading: Literal["", "course", "centre", "fixed"] = ""
    """Heading mode. Empty: the pattern's own (orbit: centre; hover and hand: fixed; else course)."""
    centre: tuple[float, float] = (40.0, -25.0)
    """Flight centre from the world's origin: north, east."""
    half_axes_m: tuple[float, float] = (8.0, 8.0)
    """Half axes of the orbit, the figure eight or the racetrack: along north and east."""
    offset_m: tuple[float, float] = (0.0, 0.0)
    """Position of a hover or of the hand, from the flight centre: north, east."""
    height_m: float = 12.0
    speed_m_s: float = 5.0
    drift_m_s: tuple[float, float] = (0.0, 0.0)
    """Velocity of the flight centre, north and east: it makes a pass of a hover, and a survey of a racetrack."""
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Velocity of the air, north and east: with a course heading the vehicle crabs."""
    start_phase_deg: float = 0.0
    fixed_heading_deg: float = 0.0
    turn_deg_s: float = 0.0
    """Turn rate of a fixed heading."""
    roll_deg: float = 0.0
    pitch_deg: float = 37.0
    flapping_hz: float = 5.0
    flapping_pitch_deg: float = 5.0
    flapping_roll_deg: float = 0.5
    flapping_modulation: float = 0.5
    """Amplitude of the flapping's phase modulation, radians, period ten seconds: wing beats are not exactly
    periodic."""
    heave_m: float = 0.02
    wander_m: float = 0.5
    """Slow drift of the position, RMS per axis (half of it for the height)."""
    wander_deg: float = 2.0
    """Slow drift of roll, pitch and yaw, RMS."""
    bank: float = 0.5
    """Fraction of a coordinated turn's bank (course heading only)."""
    shake_deg: Triple = (12.0, 12.0, 4.0)
    """Pattern hand: amplitude of the roll, pitch and yaw swings (RMS times sqrt 2) at the frequencies of an arm;
    flapping is added."""
    shake_from_s: float = 0.0
    """Pattern hand: held still until this time."""
    quarter_turn_s: float = 10.0
    """Pattern hand: interval between turns by 90 deg, one way and back; 0: no turns."""
    takeoff_at_s: float | None = None
    """Time of take-off: on the ground until then, climbing over climb_s. None: in the air from the start."""
    climb_s: float = 4.0


@dataclass(frozen=True, kw_only=True)
class AutopilotOptions:
    """The autopilot and its MAVLink behaviour."""

    firmware: Literal["ardupilot", "px4"] = "ardupilot"
    """Firmware: HEARTBEAT.autopilot and everything that depends on it."""
    landing_consumer: Literal["", "ardupilot_old", "ardupilot_new", "px4"] = ""
    """Rules for LANDING_TARGET. Empty: px4 on PX4, else ardupilot_new."""
    system_id: int = 1
    component_id: int = 1
    boot_at_start_s: float = 37.25
    """Boot time at the start."""
    drift_ppm: float = 15.0
    """Drift of the boot clock against the host's; positive: it runs fast."""
    clock_rate: Positive = 1.0
    """Seconds of the boot clock, and of the vehicle's motion with it, per host second: as in a simulator."""
    clock_slips: tuple[tuple[float, float], ...] = ()
    """(at, by) seconds: the boot clock, and the vehicle with it, pause: a simulator under load."""
    loop_rate_hz: Positive = 400.0
    """SCHED_LOOP_RATE."""
    stamp_delay_s: float | None = None
    """Largest delay of an attitude's stamp: an attitude is older than its stamp by uniform [0, this]; None: one
    scheduler loop."""
    attitude_on_whole_ms: bool = False
    """The attitude is exactly that of its whole-millisecond stamp (to measure other errors alone)."""
    pitch_trim_deg: float = 5.0
    """PTCH_TRIM_DEG, subtracted from the pitch in ATTITUDE only."""
    flight_options: int = 0
    """FLIGHT_OPTIONS; bit 8 leaves the trim in the reported pitch."""
    gyro_filter_hz: float = 20.0
    """INS_GYRO_FILTER, two-pole cut-off of the reported body rates; 0: no filter."""
    gyro_sample_hz: Positive = 1000.0
    """Sample rate of the gyro and its filter. At 250 Hz the rates of a beat of 5 Hz differ by 0.2 %."""
    gyro_noise_deg_s: NotNegative = 0.0
    """One sigma of a reported body rate, each axis."""
    precland_lag_s: float = 0.02
    """PLND_LAG."""
    precland_enabled: bool = True
    """PLND_ENABLED."""
    precland_yaw_align_cdeg: float = 0.0
    """PLND_YAW_ALIGN, only as a parameter: the mock's landing does not apply it, nor the next three."""
    precland_orient: int = 25
    """PLND_ORIENT; 25: down."""
    precland_camera_m: Triple = (0.0, 0.0, 0.0)
    """PLND_CAM_POS_X, _Y, _Z."""
    precland_offset_cm: tuple[float, float] = (0.0, 0.0)
    """PLND_LAND_OFS_X, _Y."""
    reversed_axes: tuple[Literal["roll", "pitch", "yaw"], ...] = ()
    """Axes whose attitudes and rates are reported with the opposite sign."""
    has_quaternion: bool = True
    """Whether ATTITUDE_QUATERNION is available."""
    knows_set_message_interval: bool = True
    streams: Literal["", "arducopter", "arduplane", "px4_normal", "px4_onboard"] = ""
    """Streams sent before any request, and the rules for requests: see :mod:`sitl_mock.streams`."""
    group_rates_hz: dict[int, float] = field(default_factory=dict)
    """SRn_* by MAV_DATA_STREAM, where ``streams`` is one of ArduPilot's."""
    rates_hz: dict[str, float] = field(default_factory=dict)
    """Streams that run from the start, in addition to the defaults or replacing their rates."""
    more_parameters: Annotated[int, Meta(ge=0, le=5000)] = 0
    """Number of additional parameters: a real autopilot has about a thousand."""
    parameter_interval_s: Positive = 0.02
    """Interval between two values of a parameter list."""
    true_ceiling_hz: float = 0.0
    """True highest rate where a higher one was acknowledged (as PX4 does); 0: the acknowledged rate."""
    sends_timesync: bool = True
    answers_timesync: bool = True
    poll_delay_s: float = 0.0
    """Largest delay of an answer to TIMESYNC, uniform from 0."""
    arms_at_s: float | None = 4.0
    home_moves_m: Triple = (2.0, -1.5, 0.0)
    """Offset of home before arming from home after arming: north, east, down."""
    ekf_origin_m: Triple = (0.0, 0.0, -2.3)
    """EKF origin in the world's NED."""
    home_m: tuple[float, float] = (6.0, -4.0)
    """Home after arming, from the world's origin: north, east."""
    gps: bool = True
    gps_fix_at_s: float = 0.0
    fix_type: int = 3
    """GPS_FIX_TYPE of the receiver: 3 without corrections, 5 RTK float, 6 RTK fixed."""
    h_acc_m: float = 1.0
    """Accuracy that the receiver claims; 0: it claims none."""
    position_delay_s: float = 0.0
    """Age of a position at its stamp."""
    position_wander: Literal["gauss_markov", "smooth"] = "gauss_markov"
    """Model of the position error's wander, with ``priors.position_bias_time_s``. smooth: second order, as in GNSS
    receivers."""
    position_shifts: tuple[PositionShift, ...] = ()
    """Smooth shifts of the position error, as when an estimator corrects itself."""
    rangefinder: bool = True
    utc_minus_host_wall_s: float = 0.0
    """True time minus the host's wall clock."""
    undulation_m: float = 47.0


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """The paper's camera and its detector."""

    enabled: bool = True
    image_size: tuple[Size, Size] = (640, 480)
    k_mm: tuple[float, float, float, float, float] = (3.55, 0.03, 0.0, 0.0, 0.0)
    pixels_per_mm: tuple[float, float] = (188.0, 188.0)
    principal_point: tuple[float, float] = (320.0, 240.0)
    max_angle_deg: float = 75.0
    mount_deg: Triple = (0.0, -90.0, 0.0)
    """Configured mount: roll, pitch, yaw of a forward-looking camera. The true mount is turned by the bias."""
    position_m: Triple = (0.0, 0.0, 0.0)
    fps: FrameRate = 30.0
    first_frame_s: float = 0.1
    exposure_s: float = 0.004
    stamp: Literal["row0_mid", "row0_start", "row0_end"] = "row0_mid"
    stamp_clock: Literal["time_monotonic", "time_unix", "time_boot"] = "time_monotonic"
    time_offset_s: float = 0.0
    """Configured delay of the stamps; the bias is added to it."""
    readout_s: float | None = None
    """Time from the first to the last row, negative from the bottom; None: unknown, therefore drawn."""
    latency_s: float = 0.03
    """Delay from the last row to the datagram."""
    latency_jitter_s: float = 0.003
    """Mean of an exponentially distributed additional delay."""
    late_every: int = 0
    """Every n-th frame is delivered late_by_s later, after its successors; 0: no late frames."""
    late_by_s: float = 0.3
    stops_at_s: float | None = None
    """Time at which the camera stops."""
    wall_steps: tuple[tuple[float, float], ...] = ()
    """(at, by) seconds: steps of the wall clock, which time_unix stamps follow."""
    missed: Share = 0.05
    """Fraction of visible targets that are not detected."""
    clutter: NotNegative = 0.02
    """Mean number of false detections per frame."""
    outliers: Share = 0.0
    """Fraction of detections that are grossly wrong."""
    max_blur_px: float = 0.0
    """Largest motion during the exposure at which a target is still detected; 0: no limit."""
    tell_sigma: bool = True
    tell_ids: bool = False
    tag_side_m: float = 1.5
    """Side of the black square of every tag that is rendered or whose corners are reported."""
    corner_noise_px: float | None = None
    """One sigma of a reported corner, per axis; None: corners are not reported."""
    mirrored: Literal["", "left_right", "top_bottom"] = ""
    """Mirroring of the picture before detection."""


@dataclass(frozen=True, kw_only=True)
class GimbalOptions:
    """A gimbal that carries the camera; camera.mount_deg then counts from the gimbal's own axes."""

    device_id: int = 0
    """gimbal_device_id. 0: no gimbal. Up to 6: the autopilot sends its messages; else it is its own MAVLink
    component."""
    rate_hz: Positive = 5.0
    yaw: Literal["north", "vehicle", "vehicle_and_delta", "old_lock", "old_follow"] = "north"
    """Reference of the yaw in the message, and its flags."""
    pitch_deg: float = -60.0
    yaw_deg: float = 15.0
    """Yaw from the vehicle's heading."""
    swing_deg: float = 8.0
    """Amplitude of a slow swing of pitch and yaw."""
    boot_at_start_s: float = 912.5
    """Boot time of the gimbal at the start, where it is its own component."""
    drift_ppm: float = -20.0
    silent_from_s: float = 0.0
    """Time from which the gimbal is silent; 0: never silent."""


@dataclass(frozen=True, kw_only=True)
class TargetOptions:
    """A target on the ground, relative to the flight centre."""

    label: str = "target"
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    speed_m_s: float = 0.0
    course_deg: float = 0.0
    leg_m: float = 0.0
    """Length of a walk, then back again; 0: straight on."""
    height_m: float = 0.0
    """Height of a block that stands on the ground; its detections have a box and lie at the box's centre. 0: a
    point."""
    width_m: float = 0.0
    """Side of the block's square base, along north and east."""


@dataclass(frozen=True, kw_only=True)
class WireOptions:
    """Faults of one direction of the link. Order is kept, as on a serial line."""

    delay_s: float = 0.001
    jitter_s: float = 0.0002
    """Mean of an exponentially distributed delay, in addition to the constant one."""
    loss: Share = 0.0
    """Fraction of frames that are lost."""
    corruption: Share = 0.0
    """Fraction of frames in which one byte is changed."""
    byte_by_byte: bool = False
    silences: tuple[tuple[float, float], ...] = ()
    """(from, to) seconds since the start during which no frame passes."""


@dataclass(frozen=True, kw_only=True)
class OthersOptions:
    """Other participants on the network, and their behaviour."""

    foreign_timesync: bool = False
    """Another onboard computer (1, 195) sends TIMESYNC requests and answers every request with its own clock."""
    second_vehicle: bool = False
    """Second vehicle: system 2 with its own heartbeat and attitude."""
    ground_station: bool = False
    """Heartbeat of a ground station, through the autopilot."""
    rates_stolen_every_s: float = 0.0
    """Interval at which a ground station's REQUEST_DATA_STREAM resets every stream to 4 Hz; 0: never."""
    reboots_at_s: tuple[float, ...] = ()
    reboot_takes_s: float = 2.0


@dataclass(frozen=True, kw_only=True)
class Options:
    """Complete description of one flight."""

    scenario: str = "default"
    seed: int = 1
    seconds: Positive = 60.0
    start_host_s: float = 1000.0
    """Host's monotonic clock at the start, in simulated time."""
    start_unix_s: float = 1_790_000_000.0
    """Wall clock at the start, in simulated time."""
    origin: Triple = (48.1372, 11.5756, 519.0)
    """World's origin on the take-off ground: latitude, longitude, altitude."""
    truth_hz: TruthRate = 0.0
    """Rate at which the vehicle's true state is output; 0: never."""
    noise_by_cause: bool = False
    """Whether missed detections, pixels, clutter and latency are drawn from streams of their own, a frame at a time:
    flights that differ in one cause then have all other errors in common."""
    draw_biases: bool = True
    """False: biases that are not set are zero; they are not drawn."""
    priors: Priors = field(default_factory=Priors)
    biases: Biases = field(default_factory=Biases)
    flight: FlightOptions = field(default_factory=FlightOptions)
    autopilot: AutopilotOptions = field(default_factory=AutopilotOptions)
    camera: CameraOptions = field(default_factory=CameraOptions)
    gimbal: GimbalOptions = field(default_factory=GimbalOptions)
    targets: tuple[TargetOptions, ...] = (TargetOptions(),)
    downlink: WireOptions = field(default_factory=WireOptions)
    uplink: WireOptions = field(default_factory=WireOptions)
    others: OthersOptions = field(default_factory=OthersOptions)

    def but(self, differences: dict[str, Any]) -> Options:
        """These options with differences such as {"flight.height_m": 10.0, "seed": 3}.

        Raises KeyError with the nearest known key for an unknown key.
        """
        changed = self
        for key, value in differences.items():
            changed = _changed(changed, key.split("."), value, key)
        return changed


def _changed(part: Any, path: list[str], value: Any, key: str) -> Any:
    names = [f.name for f in dataclasses.fields(part)] if dataclasses.is_dataclass(part) else []
    if path[0] not in names:
        near = get_close_matches(path[0], names, n=1)
        known = f": is it {near[0]!r}?" if near else f": one of {', '.join(names)}" if names else ""
        raise KeyError(f"no option {key!r}{known}")
    if len(path) > 1:
        value = _changed(getattr(part, path[0]), path[1:], value, key)
    return dataclasses.replace(part, **{path[0]: value})
