"""Scenarios of a multicopter: descents, turns, photographs, surveys, rough ground, slow telemetry."""

from __future__ import annotations

from typing import Any

from sitl_mock.target_options import PadTagOptions, TargetOptions

COPTER: dict[str, Any] = {
    "flight.pitch_deg": 0.0,
    "flight.flapping_pitch_deg": 0.0,
    "flight.flapping_roll_deg": 0.0,
    "flight.heave_m": 0.0,
    "flight.wander_m": 0.15,
    "autopilot.pitch_trim_deg": 0.0,
    "camera.readout_s": 0.0,
    "priors.pixel_noise_px": 1.5,
    "targets": (TargetOptions(label="pad"),),
}
"""A multicopter with a camera that looks straight down through a global shutter: no wings, 2 deg of slow sway."""
EXACT_POSITION: dict[str, Any] = {
    "biases.position_m": 0.0,
    "biases.position_delay_s": 0.0,
    "biases.lever_arm_m": (0.0, 0.0, 0.0),
    "priors.position_noise_m": 0.01,
}
DESCENT: dict[str, Any] = {
    **COPTER,
    "flight.pattern": "waypoints",
    "flight.waypoints": ((0.0, -2.0, 1.0, 15.0, 30.0), (5.0, -2.0, 1.0, 15.0, 30.0), (50.0, 0.0, 0.0, 1.0, 30.0)),
    "flight.wander_m": 0.05,
    "camera.time_offset_s": 0.04,
    "seconds": 60.0,
}
"""15 m to 1 m in 45 s (0.31 m/s on average, 0.58 at most), then ten seconds at 1 m; stamps 40 ms late, as
configured."""
PAD_OF_THREE = TargetOptions(
    label="pad",
    heading_deg=65.0,
    tags=(
        PadTagOptions(label="tag36h11:0", size_m=0.4, forward_m=-0.33),
        PadTagOptions(label="tag36h11:1", size_m=0.12, forward_m=0.13, right_m=0.04, yaw_deg=90.0),
        PadTagOptions(label="tag36h11:2", size_m=0.04),
    ),
)
BESIDE_TAG = TargetOptions(
    label="pad", heading_deg=65.0, tags=(PadTagOptions(label="tag36h11:0", size_m=0.2, right_m=-2.0),)
)
WIDE_ANGLE: dict[str, Any] = {
    "camera.image_size": (1280, 960),
    "camera.k_mm": (1.7, 0.02, 0.0, 0.0, 0.0),
    "camera.pixels_per_mm": (376.0, 376.0),
    "camera.principal_point": (640.0, 480.0),
}
"""42 deg to the image's upper and lower edge, 54 deg to its sides."""
OVER_PAD: dict[str, Any] = {
    **DESCENT,
    **EXACT_POSITION,
    "flight.waypoints": ((0.0, -1.0, 0.5, 8.0, 30.0), (4.0, -1.0, 0.5, 8.0, 30.0), (34.0, 0.0, 0.0, 0.3, 30.0)),
    "camera.clutter": 0.0,
    "camera.corner_noise_px": 0.3,
    "seconds": 37.0,
}
"""8 m to 0.3 m in 30 s over a pad; corners of a sharp print."""
PHOTOGRAPHS: dict[str, Any] = {
    **COPTER,
    "flight.pattern": "racetrack",
    "flight.half_axes_m": (40.0, 15.0),
    "flight.height_m": 60.0,
    "flight.speed_m_s": 6.0,
    "camera.fps": 0.1,
    "camera.clutter": 0.0,
    "autopilot.rates_hz": {"ATTITUDE": 4.0, "ATTITUDE_QUATERNION": 4.0, "GLOBAL_POSITION_INT": 4.0},
    "autopilot.true_ceiling_hz": 4.0,
    "targets": tuple(TargetOptions(label="cow", north=n, east=e) for n, e in ((-12.0, 6.0), (3.0, -9.0), (15.0, 2.0))),
    "seconds": 300.0,
}
"""A picture every 10 s from 60 m at 6 m/s over three targets 14 to 19 m apart; attitudes and positions at 4 Hz."""
HOVER_TURNS_CLIMB: dict[str, Any] = {
    **COPTER,
    "flight.pattern": "waypoints",
    "flight.waypoints": (
        (0.0, -2.0, 1.0, 10.0, 0.0),
        (10.0, -2.0, 1.0, 10.0, 0.0),
        (30.0, -2.0, 1.0, 10.0, 360.0),
        (35.0, -2.0, 1.0, 10.0, 360.0),
        (45.0, -2.0, 1.0, 15.0, 360.0),
        (65.0, -2.0, 1.0, 15.0, 720.0),
        (70.0, -2.0, 1.0, 15.0, 720.0),
    ),
    "seconds": 75.0,
}
"""10 m above a point 2.2 m from the target: a turn in 20 s (34 deg/s at most), a climb of 5 m, another turn."""
COPTER_CIRCLES: dict[str, Any] = {
    **COPTER,
    "flight.pattern": "orbit",
    "flight.half_axes_m": (3.0, 3.0),
    "flight.heading": "course",
    "flight.height_m": 14.0,
    "flight.speed_m_s": 2.0,
    "seconds": 110.0,
}
"""Nose-first circles of 3 m radius at 14 m and 2 m/s about the target: a turn in 9.4 s."""

THREE = tuple(TargetOptions(label="cow", north=n, east=e) for n, e in ((-12.0, 6.0), (3.0, -9.0), (15.0, 2.0)))
QUIET_POSITION: dict[str, Any] = {
    "autopilot.gyro_filter_hz": 0.0,
    "camera.clutter": 0.0,
    "camera.missed": 0.1,
}
SURVEY_LINES = tuple(
    waypoint
    for line, (east, course) in enumerate(((-24.0, 0.0), (-8.0, 180.0), (8.0, 0.0), (24.0, 180.0)))
    for waypoint in (
        (30.0 * line, -50.0 if course == 0.0 else 50.0, east, 40.0, course),
        (30.0 * line + 22.0, 50.0 if course == 0.0 else -50.0, east, 40.0, course),
    )
)
"""Four lines of 100 m, 16 m apart, there and back at 40 m and 4.5 m/s; 8 s for each turn by 180 deg."""
SURVEY: dict[str, Any] = {
    **COPTER,
    **QUIET_POSITION,
    "flight.pattern": "waypoints",
    "flight.waypoints": SURVEY_LINES,
    "camera.fps": 1.0,
    "targets": (
        *THREE,
        TargetOptions(label="cow", north=-30.0, east=-17.0),
        TargetOptions(label="cow", north=33.0, east=18.0),
    ),
    "seconds": 115.0,
}
SLOW_TELEMETRY: dict[str, Any] = {
    **COPTER,
    **QUIET_POSITION,
    "flight.pattern": "orbit",
    "flight.half_axes_m": (20.0, 20.0),
    "flight.heading": "course",
    "flight.height_m": 30.0,
    "flight.speed_m_s": 4.0,
    "camera.fps": 2.0,
    "autopilot.rates_hz": {"ATTITUDE": 3.5, "ATTITUDE_QUATERNION": 3.5, "GLOBAL_POSITION_INT": 3.0},
    "autopilot.true_ceiling_hz": 3.5,
    "targets": THREE,
    "seconds": 90.0,
}
CONSUMER_GNSS: dict[str, Any] = {
    **PHOTOGRAPHS,
    "flight.pattern": "orbit",
    "flight.half_axes_m": (15.0, 15.0),
    "flight.height_m": 40.0,
    "flight.speed_m_s": 3.0,
    "autopilot.position_wander": "smooth",
    "autopilot.position_wander_times_s": (30.0, 1800.0),
    "seconds": 600.0,
}
AROUND = tuple(
    TargetOptions(label="car", north=n, east=e)
    for n, e in ((0.0, 0.0), (-14.0, 9.0), (8.0, 15.0), (17.0, -8.0), (-6.0, -18.0))
)
VILLAGE: dict[str, Any] = {
    **COPTER,
    **QUIET_POSITION,
    "flight.pattern": "orbit",
    "flight.half_axes_m": (42.0, 42.0),
    "flight.heading": "centre",
    "flight.height_m": 60.0,
    "flight.speed_m_s": 5.0,
    "camera.mount_deg": (0.0, -55.0, 0.0),
    "camera.fps": 2.0,
    "surface.trees": 110,
    "surface.houses": 35,
    "surface.relief_m": 1.5,
    "targets": AROUND,
    "seconds": 60.0,
}
"""Round the targets, which are 35 to 75 deg below the horizon in the picture."""
IN_THE_AIR: dict[str, Any] = {
    **VILLAGE,
    "flight.pattern": "waypoints",
    "flight.waypoints": (
        (0.0, -42.0, 0.0, 60.0, 0.0),
        (4.0, -42.0, 0.0, 60.0, 0.0),
        (24.0, -30.0, 20.0, 60.0, -40.0),
        (46.0, -34.0, 21.0, 0.0, 0.0),
    ),
    "surface.tree_at": ((-42.0, 0.0, 24.0),),
    "autopilot.arms_at_s": 0.0,
    "autopilot.sends_home": False,
    "autopilot.disarms_at_s": 50.0,
    "seconds": 55.0,
}
"""Armed and 60 m up at the start, above a tree of 24 m; 20 s of turning, then a landing at home, and disarmed."""

COPTER_SCENARIOS: dict[str, tuple[str, dict[str, Any]]] = {
    "descent": ("a copter descends from 15 m to 1 m over its target, exact position", {**DESCENT, **EXACT_POSITION}),
    "descent_wander": (
        "the same with a position that wanders smoothly by 1 m",
        {**DESCENT, "autopilot.position_wander": "smooth"},
    ),
    "descent_shift": (
        "the same with a position that shifts by 0.4 m in the last ten seconds",
        {**DESCENT, **EXACT_POSITION, "autopilot.position_shifts": ((50.0, 58.0, 0.32, -0.24),)},
    ),
    "pad": (
        "a copter descends from 8 m to 0.3 m over a pad of three tags of 0.4, 0.12 and 0.04 m",
        {**OVER_PAD, "targets": (PAD_OF_THREE,)},
    ),
    "beside_tag": (
        "a copter descends from 8 m to 0.3 m onto a place 2 m beside a tag of 0.2 m, wide angle",
        {**OVER_PAD, **WIDE_ANGLE, "targets": (BESIDE_TAG,)},
    ),
    "photographs": ("a picture every 10 s from 60 m over three targets, attitudes at 4 Hz", PHOTOGRAPHS),
    "copter_hover_turns_climb": (
        "a copter hovers at 10 m, turns once, climbs 5 m, turns again; no flapping",
        {**HOVER_TURNS_CLIMB, **EXACT_POSITION},
    ),
    "copter_circles": ("a copter flies nose-first circles of 3 m radius at 14 m; no flapping", COPTER_CIRCLES),
    "survey": ("a copter flies four lines of 100 m at 40 m over five targets, a picture each second", SURVEY),
    "slow_telemetry": (
        "a copter circles three targets at 30 m; attitudes at 3.5 Hz, positions at 3 Hz",
        SLOW_TELEMETRY,
    ),
    "consumer_gnss": (
        "a picture every 10 s for 10 minutes; the position wanders by 1 m, time constant drawn from 30 s to 30 min",
        CONSUMER_GNSS,
    ),
    "village": ("a copter at 60 m looks 35 to 75 deg down on targets between trees and houses", VILLAGE),
    "in_the_air": (
        "the same, first heard in flight over a tree of 24 m, without HOME_POSITION; lands at the end",
        IN_THE_AIR,
    ),
}
"""name: (one-line description, differences from the default)."""
