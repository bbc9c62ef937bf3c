"""Scenarios: named by the problem, each given as its differences from the default."""

from __future__ import annotations

from typing import Any

from sitl_mock.copter_scenarios import COPTER_SCENARIOS
from sitl_mock.landing_scenarios import LANDING_SCENARIOS
from sitl_mock.options import Options, WireOptions
from sitl_mock.target_options import TargetOptions

QUIET_WIRE = WireOptions(delay_s=0.001, jitter_s=0.0)
THREE_TARGETS = (
    TargetOptions(label="target", north=-2.0, east=-2.0),
    TargetOptions(label="target", north=2.0, east=-2.0),
    TargetOptions(label="target", north=0.0, east=1.5),
)
NO_NOISE: dict[str, Any] = {
    "priors.pixel_noise_px": 0.0,
    "priors.attitude_noise_deg": 0.0,
    "priors.position_noise_m": 0.0,
    "priors.height_noise_m": 0.0,
    "priors.velocity_noise_m_s": 0.0,
}
NO_TROUBLE: dict[str, Any] = {
    "draw_biases": False,
    "camera.missed": 0.0,
    "camera.clutter": 0.0,
    "camera.readout_s": 0.0,
    "autopilot.pitch_trim_deg": 0.0,
}
FIGURE_EIGHT: dict[str, Any] = {
    "flight.pattern": "figure_eight",
    "flight.half_axes_m": (22.0, 11.0),
    "flight.height_m": 12.0,
    "flight.speed_m_s": 5.0,
}

TAGS = tuple(
    TargetOptions(label=f"tag36h11:{number}", north=north, east=east)
    for number, north, east in ((3, 7.0, 4.0), (7, 1.0, -1.0), (11, -6.0, 5.0), (19, -7.0, -4.5), (23, 6.0, -5.0))
)
"""Tag ids, and metres from the flight centre."""
DEMO: dict[str, Any] = {
    "flight.pattern": "figure_eight",
    "flight.half_axes_m": (10.0, 6.0),
    "flight.height_m": 12.0,
    "flight.speed_m_s": 5.0,
    "camera.fps": 12.0,
    "camera.exposure_s": 0.003,
    "camera.readout_s": 0.025,
    "targets": TAGS,
}
BY_HAND: dict[str, Any] = {
    "flight.pattern": "hand",
    "flight.height_m": 0.9,
    "flight.pitch_deg": 0.0,
    "flight.flapping_pitch_deg": 2.0,
    "flight.heave_m": 0.002,
    "flight.wander_m": 0.03,
    "flight.fixed_heading_deg": 30.0,
    "biases.attitude_roll_deg": 0.0,  # indistinguishable from the mount's errors
    "biases.attitude_pitch_deg": 0.0,
    "autopilot.pitch_trim_deg": 0.0,
    "camera.corner_noise_px": 0.15,
    "camera.tag_side_m": 0.16,
    "camera.clutter": 0.0,
    "targets": (TargetOptions(label="tag36h11:7"),),
}

SCENARIOS: dict[str, tuple[str, dict[str, Any]]] = {
    "default": ("orbit of 8 m radius around one target, biases drawn from the priors", {}),
    "perfect": (
        "no faults, no noise: the remaining error is the companion's own",
        {**NO_NOISE, **NO_TROUBLE, "downlink": QUIET_WIRE, "uplink": QUIET_WIRE, "camera.latency_jitter_s": 0.0},
    ),
    "unbiased": ("noise, but no bias, no misses, no clutter", NO_TROUBLE),
    "figure_eight": ("22 m by 11 m half axes at 12 m, 5 m/s: over the target and away", FIGURE_EIGHT),
    "racetrack": (
        "straight passes at a lateral distance from the target",
        {
            "flight.pattern": "racetrack",
            "flight.half_axes_m": (25.0, 8.0),
            "flight.speed_m_s": 7.0,
            "targets": (TargetOptions(east=5.0),),
        },
    ),
    "hover": (
        "hover with one target ahead",
        {"flight.pattern": "hover", "flight.offset_m": (-8.0, 0.0)},
    ),
    "nadir": (
        "level hover, camera straight down",
        {"flight.pattern": "hover", "flight.pitch_deg": 0.0, "autopilot.pitch_trim_deg": 0.0},
    ),
    "paper_static": (
        "the paper's case: hover, heading north, 37 deg, 10 m, target 4 m ahead and 3 m to the left",
        {
            **NO_TROUBLE,
            "flight.pattern": "hover",
            "flight.height_m": 10.0,
            "flight.flapping_pitch_deg": 0.0,
            "flight.flapping_roll_deg": 0.0,
            "flight.heave_m": 0.0,
            "flight.wander_m": 0.0,
            "flight.wander_deg": 0.0,
            "targets": (TargetOptions(north=4.0, east=-3.0),),
        },
    ),
    "late_camera": ("stamps 35 ms late, not configured", {**FIGURE_EIGHT, "biases.time_offset_s": 0.035}),
    "crooked_mount": ("mount off by 0.5, 1, 2 deg", {**FIGURE_EIGHT, "biases.mount_deg": (0.5, 1.0, 2.0)}),
    "late_and_crooked": (
        "stamps 35 ms late and the mount off by 0.5, 1, 2 deg",
        {**FIGURE_EIGHT, "biases.time_offset_s": 0.035, "biases.mount_deg": (0.5, 1.0, 2.0)},
    ),
    "upside_down": ("image upside down: the mount is turned by 180 deg", {"biases.mount_deg": (0.0, 0.0, 180.0)}),
    "rolling_shutter": ("readout of 30 ms from the first row to the last", {"camera.readout_s": 0.03}),
    "blur": (
        "long exposure: frames are usable only at low rates of the flapping",
        {"camera.exposure_s": 0.008, "camera.max_blur_px": 5.0},
    ),
    "outliers": ("one detection in twenty grossly wrong", {"camera.outliers": 0.05}),
    "late_frames": ("every tenth frame is delivered 300 ms late, after its successors", {"camera.late_every": 10}),
    "camera_dies": ("no frame after 10 s", {"camera.stops_at_s": 10.0}),
    "stepped_wall_clock": (
        "stamps by a wall clock that steps by an hour at 10 s",
        {"camera.stamp_clock": "time_unix", "camera.wall_steps": ((10.0, 3600.0),)},
    ),
    "jitter_10ms": (
        "10 ms exponential jitter each way",
        {"downlink.jitter_s": 0.01, "uplink.jitter_s": 0.01},
    ),
    "asymmetric": ("5 ms one way, 25 ms the other", {"uplink.delay_s": 0.005, "downlink.delay_s": 0.025}),
    "drifting": ("the boot clock gains 200 ppm", {"autopilot.drift_ppm": 200.0}),
    "clock_slips": (
        "a simulator under load: vehicle and boot clock pause for 15 to 170 ms, five times in 20 s",
        {"autopilot.clock_slips": ((6.0, 0.015), (10.2, 0.077), (13.0, 0.17), (16.7, 0.03), (19.1, 0.05))},
    ),
    "slow_clock": (
        "a simulator at 0.985 of real time: vehicle and boot clock run 1.5 % slow",
        {"autopilot.clock_rate": 0.985},
    ),
    "lossy_wire": ("one frame in ten is lost each way", {"downlink.loss": 0.1, "uplink.loss": 0.1}),
    "corrupted_wire": ("one frame in ten is damaged", {"downlink.corruption": 0.1, "uplink.corruption": 0.1}),
    "byte_by_byte": ("every byte arrives separately", {"downlink.byte_by_byte": True}),
    "silence": ("no data from 8 s to 13 s", {"downlink.silences": ((8.0, 13.0),)}),
    "rebooting": ("the autopilot reboots in flight at 12 s", {"others.reboots_at_s": (12.0,)}),
    "foreign_timesync": ("another computer answers every TIMESYNC", {"others.foreign_timesync": True}),
    "two_vehicles": ("a second vehicle on the link", {"others.second_vehicle": True}),
    "gcs_thief": (
        "a ground station resets the stream rates every 10 s",
        {"others.ground_station": True, "others.rates_stolen_every_s": 10.0},
    ),
    "slow_loop": (
        "SCHED_LOOP_RATE 50: ATTITUDE at most 40 Hz, stamps up to 20 ms late",
        {"autopilot.loop_rate_hz": 50.0},
    ),
    "no_quaternion": ("ATTITUDE_QUATERNION is refused", {"autopilot.has_quaternion": False}),
    "no_gps": ("no global position at any time", {"autopilot.gps": False}),
    "flow": (
        "no global position: a local one by optical flow, which drifts by 1 % of the way",
        {"autopilot.gps": False, "autopilot.flow": True},
    ),
    "late_gps": ("the first fix comes after 20 s", {"autopilot.gps_fix_at_s": 20.0}),
    "gnss_wander": ("the position wanders by 0.5 m", {"biases.position_m": 0.5}),
    "home_moves": (
        "takes off after arming, which moves home by 0.8 m in height",
        {"flight.takeoff_at_s": 6.0, "autopilot.home_moves_m": (3.0, -2.0, 0.8)},
    ),
    "first_timesync_off": (
        "the first answer to TIMESYNC is 115 ms off: it left in a burst",
        {"autopilot.first_timesync_off_s": (-0.115,)},
    ),
    "late_timesync": ("one answer to TIMESYNC in ten is 5 to 50 ms late", {"autopilot.timesync_late_share": 0.1}),
    "clock_falls_silent": ("TIMESYNC is not answered from 12 s on", {"autopilot.answers_timesync_until_s": 12.0}),
    "silent_clock": ("TIMESYNC is never answered", {"autopilot.answers_timesync": False}),
    "old_rates": (
        "SET_MESSAGE_INTERVAL is unknown, only REQUEST_DATA_STREAM works",
        {"autopilot.knows_set_message_interval": False},
    ),
    "old_ardupilot": (
        "LANDING_TARGET by the rules of ArduPilot 4.1",
        {"autopilot.landing_consumer": "ardupilot_old"},
    ),
    "arducopter": (
        "only a heartbeat until streams are requested, as ArduCopter with SRn_* at 0",
        {"autopilot.streams": "arducopter", "autopilot.pitch_trim_deg": 0.0},
    ),
    "arduplane": ("every stream group at 1 Hz, as ArduPlane", {"autopilot.streams": "arduplane"}),
    "px4_normal": (
        "PX4 with the streams of MAV_n_MODE Normal, for a radio",
        {"autopilot.firmware": "px4", "autopilot.pitch_trim_deg": 0.0, "autopilot.streams": "px4_normal"},
    ),
    "px4_onboard": (
        "PX4 with the streams of MAV_n_MODE Onboard, for a companion computer",
        {"autopilot.firmware": "px4", "autopilot.pitch_trim_deg": 0.0, "autopilot.streams": "px4_onboard"},
    ),
    "px4": (
        "PX4: ALTITUDE, its own sphere, its own LANDING_TARGET",
        {"autopilot.firmware": "px4", "autopilot.pitch_trim_deg": 0.0},
    ),
    "px4_slow": (
        "PX4 that acknowledges 50 Hz and sends 18.4 Hz",
        {"autopilot.firmware": "px4", "autopilot.pitch_trim_deg": 0.0, "autopilot.true_ceiling_hz": 18.4},
    ),
    "three_targets": (
        "three targets 4 m apart, 10 % missed, one false detection in ten frames",
        {"targets": THREE_TARGETS, "camera.missed": 0.1, "camera.clutter": 0.1},
    ),
    "demo": ("figure eight over five AprilTags with a rolling shutter; for rendered images", DEMO),
    "demo_blur": (
        "the same with 8 ms exposure: tags are readable mostly at low body rates",
        {**DEMO, "camera.exposure_s": 0.008},
    ),
    "gimbal": (
        "camera on a MAVLink gimbal that reports its attitude at 5 Hz with its own clock",
        {"gimbal.device_id": 154, "camera.mount_deg": (0.0, 0.0, 0.0)},
    ),
    "shake": (
        "held by hand over a printed tag of 16 cm, shaken, and turned by 90 deg every 10 s; for check --shake",
        BY_HAND,
    ),
    "shake_late_and_crooked": (
        "the same with stamps 35 ms late and the mount off by 0.5, 1, 2 deg",
        {**BY_HAND, "biases.time_offset_s": 0.035, "biases.mount_deg": (0.5, 1.0, 2.0)},
    ),
    "walker": (
        "a target that walks at 1.5 m/s",
        {"targets": (TargetOptions(label="person", north=-4.0, speed_m_s=1.5, leg_m=8.0),)},
    ),
    **COPTER_SCENARIOS,
    **LANDING_SCENARIOS,
}
"""name: (one-line description, differences from the default)."""


def scenario(name: str, base: Options | None = None) -> Options:
    """Options of a scenario. Raises KeyError for an unknown name."""
    if name not in SCENARIOS:
        raise KeyError(f"no scenario {name!r}: one of {', '.join(SCENARIOS)}")
    return (base or Options()).but({"scenario": name, **SCENARIOS[name][1]})
