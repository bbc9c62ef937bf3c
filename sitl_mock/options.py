"""Everything that can be chosen, with its default. A scenario states only its difference from this.

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
"""(from_s, to_s, north, east): the estimator moves its position by so many metres between the two instants."""
Positive: TypeAlias = Annotated[float, Meta(gt=0.0)]
MOST_HZ = 10_000.0
"""Faster than any camera; without a bound a flight of a second need not end."""
FrameRate: TypeAlias = Annotated[float, Meta(gt=0.0, le=MOST_HZ)]
TruthRate: TypeAlias = Annotated[float, Meta(ge=0.0, le=MOST_HZ)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0.0)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Size: TypeAlias = Annotated[int, Meta(ge=1, le=8192)]


@dataclass(frozen=True, kw_only=True)
class Priors:
    """One sigma each, by the names of the companion's ``[uncertainty]``: what noise and biases are drawn from."""

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
    velocity_noise_m_s: float = 0.05


@dataclass(frozen=True, kw_only=True)
class Biases:
    """Errors that last a whole flight. ``None``: drawn. A number: exactly that."""

    attitude_roll_deg: float | None = None
    attitude_pitch_deg: float | None = None
    heading_deg: float | None = None
    mount_deg: Triple | None = None
    """Rotation vector in body axes: body_from_camera = Exp(mount_deg) * (the configured one)."""
    time_offset_s: float | None = None
    """Of the camera's stamps, on top of camera.time_offset_s; positive: they come late."""
    height_m: float | None = None
    """Reported height minus true height."""
    position_m: float | None = None
    """Sigma of the wandering horizontal position error; None: the prior."""
    readout_s: float | None = None
    """None: camera.readout_s, and where that is None too, uniform over [0, frame interval]."""


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """The motion, about a flight centre on the ground."""

    pattern: Literal["hover", "orbit", "figure_eight", "racetrack", "hand", "waypoints"] = "orbit"
    """hand: held by hand over the flight centre and shaken. waypoints: through ``waypoints``."""
    waypoints: tuple[Waypoint, ...] = ()
    """Of the pattern waypoints: minimum-jerk courses between them; ``height_m`` and headings do not count then."""
    heading: Literal["", "course", "centre", "fixed"] = ""
    """Empty: the pattern's own (orbit: centre, hover: fixed, else course)."""
    centre: tuple[float, float] = (40.0, -25.0)
    """North, east of the flight centre from the world's origin."""
    half_axes_m: tuple[float, float] = (8.0, 8.0)
    """Along north and east: of the orbit, the figure eight or the racetrack."""
    offset_m: tuple[float, float] = (0.0, 0.0)
    """Where a hover stands, from the flight centre."""
    height_m: float = 12.0
    speed_m_s: float = 5.0
    start_phase_deg: float = 0.0
    fixed_heading_deg: float = 0.0
    turn_deg_s: float = 0.0
    """Of a fixed heading."""
    roll_deg: float = 0.0
    pitch_deg: float = 37.0
    flapping_hz: float = 5.0
    flapping_pitch_deg: float = 5.0
    flapping_roll_deg: float = 0.5
    flapping_modulation: float = 0.5
    """Radians by which the flapping's phase wanders, every ten seconds: wings are no crystal."""
    heave_m: float = 0.02
    wander_m: float = 0.5
    """Slow drift of the position, per axis."""
    wander_deg: float = 2.0
    """Slow drift of roll, pitch and yaw."""
    bank: float = 0.5
    """Share of a coordinated turn's bank (course heading only)."""
    shake_deg: Triple = (12.0, 12.0, 4.0)
    """By hand: how far roll, pitch and yaw swing, to the rhythm of an arm; the flapping comes on top."""
    shake_from_s: float = 0.0
    """By hand: held still until then."""
    quarter_turn_s: float = 10.0
    """By hand: turned by 90 deg each time after so long, to and fro; 0: never."""
    takeoff_at_s: float | None = None
    """On the ground until then, climbing over climb_s. None: in the air from the start."""
    climb_s: float = 4.0


@dataclass(frozen=True, kw_only=True)
class AutopilotOptions:
    """The vehicle as it speaks."""

    firmware: Literal["ardupilot", "px4"] = "ardupilot"
    """Of HEARTBEAT.autopilot and everything that hangs on it."""
    landing_consumer: Literal["", "ardupilot_old", "ardupilot_new", "px4"] = ""
    """Empty: px4 on PX4, else ardupilot_new."""
    system_id: int = 1
    component_id: int = 1
    boot_at_start_s: float = 37.25
    """What its boot clock shows at the start."""
    drift_ppm: float = 15.0
    """Its clock against the host's; positive: it runs fast."""
    loop_rate_hz: Positive = 400.0
    """SCHED_LOOP_RATE."""
    stamp_delay_s: float | None = None
    """An attitude is older than its stamp by uniform [0, this]; None: one scheduler loop."""
    attitude_on_whole_ms: bool = False
    """The attitude is exactly that of its whole-millisecond stamp (for measuring what else is wrong)."""
    pitch_trim_deg: float = 5.0
    """PTCH_TRIM_DEG, taken off the pitch in ATTITUDE and nowhere else."""
    flight_options: int = 0
    """FLIGHT_OPTIONS; bit 8 leaves the trim on."""
    gyro_filter_hz: float = 20.0
    """INS_GYRO_FILTER, two poles, behind which the body rates come; 0: none."""
    gyro_noise_deg_s: NotNegative = 0.0
    """One sigma of a sent body rate, each axis."""
    precland_lag_s: float = 0.02
    """PLND_LAG."""
    precland_enabled: bool = True
    """PLND_ENABLED."""
    precland_yaw_align_cdeg: float = 0.0
    """PLND_YAW_ALIGN, as a parameter alone: the mock's landing does not turn by it. So are the next three."""
    precland_orient: int = 25
    """PLND_ORIENT; 25: down."""
    precland_camera_m: Triple = (0.0, 0.0, 0.0)
    """PLND_CAM_POS_X, _Y, _Z."""
    precland_offset_cm: tuple[float, float] = (0.0, 0.0)
    """PLND_LAND_OFS_X, _Y."""
    reversed_axes: tuple[Literal["roll", "pitch", "yaw"], ...] = ()
    """Those that attitudes and rates tell with the other sign."""
    has_quaternion: bool = True
    """Whether ATTITUDE_QUATERNION can be had."""
    knows_set_message_interval: bool = True
    streams: Literal["", "arducopter", "arduplane", "px4_normal", "px4_onboard"] = ""
    """What is sent before anyone asks, and how it is asked for: see :mod:`sitl_mock.streams`."""
    group_rates_hz: dict[int, float] = field(default_factory=dict)
    """SRn_* by MAV_DATA_STREAM, where ``streams`` is ArduPilot's."""
    rates_hz: dict[str, float] = field(default_factory=dict)
    """Streams that run from the start, beside or instead of the defaults."""
    more_parameters: Annotated[int, Meta(ge=0, le=5000)] = 0
    """Beside those that this mock lives by: a real autopilot has about a thousand."""
    parameter_interval_s: Positive = 0.02
    """Between two values of a list."""
    true_ceiling_hz: float = 0.0
    """What is really sent where more was acknowledged (PX4 does that); 0: what was acknowledged."""
    sends_timesync: bool = True
    answers_timesync: bool = True
    poll_delay_s: float = 0.0
    """Its answers to TIMESYNC start up to this late, uniformly."""
    arms_at_s: float | None = 4.0
    home_moves_m: Triple = (2.0, -1.5, 0.0)
    """Where home was before arming, against the true take-off ground: north, east, down."""
    ekf_origin_m: Triple = (0.0, 0.0, -2.3)
    """The EKF's origin, against the world's origin."""
    home_m: tuple[float, float] = (6.0, -4.0)
    """North, east of home from the world's origin, after arming."""
    gps: bool = True
    gps_fix_at_s: float = 0.0
    position_delay_s: float = 0.0
    """How old a position is against its stamp."""
    position_wander: Literal["gauss_markov", "smooth"] = "gauss_markov"
    """How the position error wanders with ``priors.position_bias_time_s``. smooth: second order, as receivers do."""
    position_shifts: tuple[PositionShift, ...] = ()
    """Smooth moves of the position error, as an estimator makes them that changes its mind."""
    rangefinder: bool = True
    utc_minus_host_wall_s: float = 0.0
    """True time minus the host's wall clock."""
    undulation_m: float = 47.0


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """The paper's camera, and the detector behind it."""

    enabled: bool = True
    image_size: tuple[Size, Size] = (640, 480)
    k_mm: tuple[float, float, float, float, float] = (3.55, 0.03, 0.0, 0.0, 0.0)
    pixels_per_mm: tuple[float, float] = (188.0, 188.0)
    principal_point: tuple[float, float] = (320.0, 240.0)
    max_angle_deg: float = 75.0
    mount_deg: Triple = (0.0, -90.0, 0.0)
    """Roll, pitch, yaw of a forward-looking camera: what the companion is told. The true one is turned by the bias."""
    position_m: Triple = (0.0, 0.0, 0.0)
    fps: FrameRate = 30.0
    first_frame_s: float = 0.1
    exposure_s: float = 0.004
    stamp: Literal["row0_mid", "row0_start", "row0_end"] = "row0_mid"
    stamp_clock: Literal["time_monotonic", "time_unix", "time_boot"] = "time_monotonic"
    time_offset_s: float = 0.0
    """How late stamps come, as the companion is told; the bias comes on top."""
    readout_s: float | None = None
    """Seconds from first to last row, negative from the bottom; None: unknown, so drawn."""
    latency_s: float = 0.03
    """From the last row to the datagram."""
    latency_jitter_s: float = 0.003
    """Mean of an exponential on top."""
    late_every: int = 0
    """Each frame of so many comes later by late_by_s, behind its followers; 0: none."""
    late_by_s: float = 0.3
    stops_at_s: float | None = None
    """The camera dies then."""
    wall_steps: tuple[tuple[float, float], ...] = ()
    """(at, by) seconds: steps of the wall clock, which time_unix stamps follow."""
    missed: Share = 0.05
    """Share of visible targets that are not detected."""
    clutter: NotNegative = 0.02
    """False detections a frame, on average."""
    outliers: Share = 0.0
    """Share of detections that are grossly wrong."""
    max_blur_px: float = 0.0
    """More motion than this within the exposure hides a target; 0: blur hides none."""
    tell_sigma: bool = True
    tell_ids: bool = False
    tag_side_m: float = 1.5
    """Of the black square of every tag that is rendered, or whose corners are told."""
    corner_noise_px: float | None = None
    """One sigma of a told corner, an axis; None: no corners are told."""
    mirrored: Literal["", "left_right", "top_bottom"] = ""
    """How the picture is mirrored before anything is found in it."""


@dataclass(frozen=True, kw_only=True)
class GimbalOptions:
    """What carries the camera in the body's place; camera.mount_deg then counts from the gimbal's own axes."""

    device_id: int = 0
    """0: none. Up to 6: the autopilot speaks for it; else its own MAVLink component."""
    rate_hz: Positive = 5.0
    yaw: Literal["north", "vehicle", "vehicle_and_delta", "old_lock", "old_follow"] = "north"
    """Where the message counts yaw from, and how."""
    pitch_deg: float = -60.0
    yaw_deg: float = 15.0
    """From the vehicle's heading."""
    swing_deg: float = 8.0
    """Of pitch and yaw, slowly."""
    boot_at_start_s: float = 912.5
    """Its clock at the start, where it is a component of its own."""
    drift_ppm: float = -20.0
    silent_from_s: float = 0.0
    """It says nothing from then on; 0: it always does."""


@dataclass(frozen=True, kw_only=True)
class TargetOptions:
    """One thing on the ground, relative to the flight centre."""

    label: str = "target"
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    speed_m_s: float = 0.0
    course_deg: float = 0.0
    leg_m: float = 0.0
    """Walks so far and back again; 0: walks on."""


@dataclass(frozen=True, kw_only=True)
class WireOptions:
    """One direction of the link. Order is kept, as on a serial line."""

    delay_s: float = 0.001
    jitter_s: float = 0.0002
    """Mean of an exponential, on top of the delay."""
    loss: Share = 0.0
    """Share of frames."""
    corruption: Share = 0.0
    """Share of frames in which one byte is changed."""
    byte_by_byte: bool = False
    silences: tuple[tuple[float, float], ...] = ()
    """(from, to) seconds since the start during which nothing passes."""


@dataclass(frozen=True, kw_only=True)
class OthersOptions:
    """Who else is on the network, and what they do."""

    foreign_timesync: bool = False
    """Another onboard computer (1, 195) asks and answers every TIMESYNC with its own clock."""
    second_vehicle: bool = False
    """System 2 with its own heartbeat and attitude."""
    ground_station: bool = False
    """A ground station's heartbeat, through the autopilot."""
    rates_stolen_every_s: float = 0.0
    """A ground station's REQUEST_DATA_STREAM puts every stream back to 4 Hz; 0: never."""
    reboots_at_s: tuple[float, ...] = ()
    reboot_takes_s: float = 2.0


@dataclass(frozen=True, kw_only=True)
class Options:
    """One flight, told completely."""

    scenario: str = "default"
    seed: int = 1
    seconds: Positive = 60.0
    start_host_s: float = 1000.0
    """The host's monotonic clock at the start, in invented time."""
    start_unix_s: float = 1_790_000_000.0
    """The wall clock at the start, in invented time."""
    origin: Triple = (48.1372, 11.5756, 519.0)
    """Latitude, longitude, altitude of the take-off ground: the world's origin."""
    truth_hz: TruthRate = 0.0
    """How often the vehicle's true state is told; 0: never."""
    draw_biases: bool = True
    """False: what biases do not name is zero instead of drawn."""
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

        Raises KeyError, naming the nearest known key, where one is unknown.
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
