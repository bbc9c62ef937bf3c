"""Options of the autopilot and its MAVLink behaviour. Degrees, seconds, metres, hertz."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from msgspec import Meta

from sitl_mock.option_types import NotNegative, PositionShift, Positive, Triple


@dataclass(frozen=True, kw_only=True)
class AutopilotOptions:
    """The autopilot and its MAVLink behaviour."""

    firmware: Literal["ardupilot", "px4", "inav", "betaflight"] = "ardupilot"
    """Firmware: HEARTBEAT.autopilot and everything that depends on it. betaflight: no body rates in
    ATTITUDE."""
    answers: Literal["all", "ack_only", "groups_only", "nothing"] = "all"
    """What the autopilot does with received messages. ack_only: GET_MESSAGE_INTERVAL is acknowledged, and no
    MESSAGE_INTERVAL follows. groups_only: REQUEST_DATA_STREAM is heeded in silence, all else is ignored. nothing: a
    one-way wire."""
    mavlink_version: Literal[1, 2] = 2
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
    gyro_sample_hz: Positive = 500.0
    """Sample rate of the gyro and its filter. At 250 the rates of a beat of 5 Hz differ by 0.2 % from those at 1000."""
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
    precland_parameters: dict[str, float] = field(default_factory=dict)
    """Further PLND_ parameters that are not ArduPilot's defaults; the mock's landing does not apply them."""
    reversed_axes: tuple[Literal["roll", "pitch", "yaw"], ...] = ()
    """Axes whose attitudes and rates are reported with the opposite sign."""
    has_quaternion: bool = True
    """Whether ATTITUDE_QUATERNION is available."""
    knows_set_message_interval: bool = True
    streams: Literal["", "arducopter", "arduplane", "px4_normal", "px4_onboard", "inav", "betaflight"] = ""
    """Streams sent before any request, and the rules for requests: see :mod:`sitl_mock.streams`."""
    group_rates_hz: dict[int, float] = field(default_factory=dict)
    """SRn_* by MAV_DATA_STREAM, where ``streams`` is one of ArduPilot's."""
    refuses_roi: bool = False
    """Whether a region of interest is answered FAILED."""
    follow_system_id: int = 0
    """FOLL_SYSID; 0: any system but the vehicle's own."""
    mode_changes_at_s: float = 0.0
    """Time at which the pilot changes the flight mode; 0: never."""
    status_changes_at_s: float = 0.0
    """Time at which HEARTBEAT.system_status becomes status_then; 0: never."""
    status_then: int = 5
    """MAV_STATE: 3 on the ground, 5 in a failsafe."""
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
    first_timesync_off_s: tuple[float, ...] = ()
    """Errors of the first answers' stamps, seconds: ArduPilot dates reception back by what it has not read (negative).
    """
    answers_timesync_until_s: float | None = None
    """Time from the start after which TIMESYNC is not answered any more."""
    timesync_late_share: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0
    """Share of the answers that are 5 to 50 ms late."""
    poll_delay_s: float = 0.0
    """Largest delay of an answer to TIMESYNC, uniform from 0."""
    arms_at_s: float | None = 4.0
    """0: armed from the start, as in a recording that begins in the air."""
    disarms_at_s: float | None = None
    sends_home: bool = True
    """Whether HOME_POSITION is ever sent."""
    home_moves_m: Triple = (2.0, -1.5, 0.0)
    """Offset of home before arming from home after arming: north, east, down."""
    ekf_origin_m: Triple = (0.0, 0.0, -2.3)
    """EKF origin in the world's NED."""
    home_m: tuple[float, float] = (6.0, -4.0)
    """Home after arming, from the world's origin: north, east."""
    gps: bool = True
    gps_fix_at_s: float = 0.0
    gps_lost_s: tuple[tuple[float, float], ...] = ()
    """(from, until) seconds without a global position."""
    flow: bool = False
    """Optical flow: without a global position the autopilot has a local one, and its filter reports that."""
    local_message: Literal["LOCAL_POSITION_NED", "ODOMETRY"] = "LOCAL_POSITION_NED"
    """Message that has the local position; the other one is not sent."""
    flow_drift: NotNegative = 0.01
    """One sigma of the local position's drift, each axis, of the way flown."""
    flow_lost_s: tuple[tuple[float, float], ...] = ()
    """(from, until) seconds: the flow sees nothing, and the filter holds a constant position."""
    fix_type: int = 3
    """GPS_FIX_TYPE of the receiver: 3 without corrections, 5 RTK float, 6 RTK fixed."""
    h_acc_m: float = 1.0
    """Accuracy that the receiver claims; 0: it claims none."""
    position_delay_s: float = 0.0
    """Age of a position at its stamp."""
    position_wander: Literal["gauss_markov", "smooth"] = "gauss_markov"
    """Model of the position error's wander, with ``priors.position_bias_time_s``. smooth: second order, as in GNSS
    receivers."""
    position_wander_times_s: tuple[Positive, Positive] | None = None
    """Range from which the seed draws the wander's time constant, uniform in its logarithm; None: the prior's."""
    position_shifts: tuple[PositionShift, ...] = ()
    """Smooth shifts of the position error, as when an estimator corrects itself."""
    rangefinder: bool = True
    utc_minus_host_wall_s: float = 0.0
    """True time minus the host's wall clock."""
    undulation_m: float = 47.0
