"""All options with their defaults. A scenario lists only its differences from these.

Degrees, seconds, metres, hertz. ``None`` in :class:`Biases` means: drawn from the :class:`Priors` by the seed.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Literal

from sitl_mock.autopilot_options import AutopilotOptions
from sitl_mock.lander_options import LanderOptions
from sitl_mock.option_types import (
    FrameRate,
    NotNegative,
    Positive,
    Share,
    Size,
    Triple,
    TruthRate,
    Waypoint,
)
from sitl_mock.surface_options import SurfaceOptions
from sitl_mock.target_options import TargetOptions


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
    gimbal_yaw_bias_deg: float = 3.0
    gimbal_delay_sigma_s: float = 0.05
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
    gimbal_yaw_deg: float | None = None
    """Error of the gimbal's yaw encoder, or of its compass."""
    gimbal_delay_s: float | None = None
    """Age of a gimbal's attitude at its stamp, in addition to gimbal.late_s."""
    readout_s: float | None = None
    """True readout time; None: camera.readout_s, and where that is None too, uniform over [0, frame interval], at most
    75 ms."""


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """Motion of the vehicle, about a flight centre on the ground."""

    pattern: Literal["hover", "orbit", "figure_eight", "racetrack", "hand", "waypoints", "landing"] = "orbit"
    """hand: held by hand over the flight centre and shaken. waypoints: through ``waypoints``. landing: a copter that
    flies by LANDING_TARGET, with the options ``lander``."""
    waypoints: tuple[Waypoint, ...] = ()
    """Waypoints of the pattern waypoints: minimum-jerk segments between them; ``height_m`` and the heading options do
    not apply then."""
    heading: Literal["", "course", "centre", "fixed"] = ""
    """Heading mode. Empty: the pattern's own (orbit: centre; hover, hand and landing: fixed; else course)."""
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
    """One sigma of a reported corner, per axis; None: corners are not reported, but those of a pad exactly."""
    mirrored: Literal["", "left_right", "top_bottom"] = ""
    """Mirroring of the picture before detection."""


@dataclass(frozen=True, kw_only=True)
class GimbalOptions:
    """A gimbal that carries the camera; camera.mount_deg then counts from the gimbal's own axes."""

    device_id: int = 0
    """gimbal_device_id. 0: no gimbal. Up to 6: the autopilot sends its messages; else it is its own MAVLink
    component."""
    rate_hz: Positive = 5.0
    kind: Literal["stabilised", "servo"] = "stabilised"
    """``stabilised``: reports roll and pitch from the horizon. ``servo``: a mount that holds the camera level by two
    servos, reports their angles from the body, and claims in its flags that they count from the horizon."""
    message: Literal["GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_ORIENTATION"] = "GIMBAL_DEVICE_ATTITUDE_STATUS"
    yaw: Literal[
        "north", "north_and_delta", "vehicle", "vehicle_and_delta", "both_frames", "old_lock", "old_follow"
    ] = "north"
    """Reference of the yaw in the message, and its flags."""
    yaw_zero_deg: float = 0.0
    """Direction from which the gimbal counts as if it were north: of its power-on, or of its own compass."""
    late_s: float = 0.0
    """Age of an attitude at its stamp."""
    resets_at_s: float = 0.0
    """Time at which the gimbal boots again; 0: never."""
    manager: bool = False
    """Whether the autopilot is a gimbal manager that points it; until the first command it swings."""
    command_delay_s: NotNegative = 0.08
    """Time from the arrival of a command to the motion."""
    rate_deg_s: Positive = 100.0
    """Fastest turn."""
    frozen: bool = False
    """Whether it never moves, whatever is commanded."""
    manager_denies: bool = False
    """Whether the manager answers a request for the control with DENIED."""
    taken_at_s: float = 0.0
    """Time at which another station takes the control; 0: never."""
    stick_at_s: float = 0.0
    """Time at which the pilot's stick turns it aside; 0: never."""
    neutral_at_s: float = 0.0
    """Time at which the pilot sends it to its neutral position; 0: never."""
    second_id: int = 0
    """Component of a second gimbal, which carries nothing and looks elsewhere; 0: none."""
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
    nan_from_s: float = 0.0
    """Time from which its attitude has no number; 0: never."""


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
    surface: SurfaceOptions = field(default_factory=SurfaceOptions)
    lander: LanderOptions = field(default_factory=LanderOptions)
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
