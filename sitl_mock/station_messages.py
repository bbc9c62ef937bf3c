"""Messages that only ground stations' displays use: plausible, and as long on the wire as the real ones."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sin
from typing import Any

Fields = dict[str, Any]
Maker = Callable[[int, float], Fields]
"""Function from (microseconds since boot, seconds of flight) to fields."""
CELLS_MV = [3950, 3948, 3951] + [65535] * 7
IDENTITY = [1.0, 0.0, 0.0, 0.0]


def _axes(*names: str) -> Callable[[float], Fields]:
    """Small non-zero values, because MAVLink 2 omits trailing zero bytes."""
    return lambda t: {name: 0.01 + 0.1 * sin(t + i) for i, name in enumerate(names)}


_ATTITUDE_TARGET = _axes("body_roll_rate", "body_pitch_rate", "body_yaw_rate", "thrust")
_ODOMETRY = _axes("x", "y", "z", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed")
_HIGHRES = _axes(
    "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag", "abs_pressure", "diff_pressure",
    "pressure_alt", "temperature",
)  # fmt: skip
_VIBRATION = _axes("vibration_x", "vibration_y", "vibration_z")
_AHRS = _axes("omegaIx", "omegaIy", "omegaIz", "accel_weight", "renorm_val", "error_rp", "error_yaw")
_AHRS2 = _axes("roll", "pitch", "yaw", "altitude")
_EKF = _axes("velocity_variance", "pos_horiz_variance", "pos_vert_variance", "compass_variance", "terrain_alt_variance")
_ESTIMATOR = _axes(
    "vel_ratio", "pos_horiz_ratio", "pos_vert_ratio", "mag_ratio", "hagl_ratio", "tas_ratio", "pos_horiz_accuracy",
    "pos_vert_accuracy",
)  # fmt: skip
_WIND_COV = _axes("wind_x", "wind_y", "wind_z", "var_horiz", "var_vert", "wind_alt", "horiz_accuracy", "vert_accuracy")
_TARGET = _axes("vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")
_NAVIGATION = _axes("nav_roll", "nav_pitch", "alt_error", "aspd_error", "xtrack_error")


def _rc_channels(boot_us: int, t: float) -> Fields:
    channels = {f"chan{i}_raw": 1500 + round(100 * sin(t + i)) for i in range(1, 19)}
    return {"time_boot_ms": boot_us // 1000 % 2**32, "chancount": 16, **channels, "rssi": 210}


def _battery(_boot_us: int, t: float) -> Fields:
    return {
        "id": 0, "battery_function": 1, "type": 1, "temperature": 2510, "voltages": CELLS_MV,
        "current_battery": 640 + round(50 * sin(t)), "current_consumed": 120 + round(t), "energy_consumed": 33,
        "battery_remaining": 82, "time_remaining": 900, "charge_state": 1,
    }  # fmt: skip


def _odometry(boot_us: int, t: float) -> Fields:
    frames = {"time_usec": boot_us, "frame_id": 1, "child_frame_id": 12, "q": IDENTITY}
    covariances = {"pose_covariance": [0.01 * (i + 1) for i in range(21)], "velocity_covariance": [0.02] * 21}
    return {**frames, **_ODOMETRY(t), **covariances, "reset_counter": 1, "estimator_type": 2, "quality": 99}


def _scaled_imu2(boot_us: int, t: float) -> Fields:
    axes = ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag")
    values = {name: 100 + round(50 * sin(t + i)) for i, name in enumerate(axes)}
    return {"time_boot_ms": boot_us // 1000 % 2**32, **values, "temperature": 4100}


def _position_target(boot_us: int, t: float) -> Fields:
    place = {"lat_int": 481370000, "lon_int": 115750000, "alt": 530.0}
    header = {"time_boot_ms": boot_us // 1000 % 2**32, "coordinate_frame": 6, "type_mask": 0xFF8}
    return {**header, **place, **_TARGET(t)}


STATION_MESSAGES: dict[str, Maker] = {
    "AHRS": lambda _, t: _AHRS(t),
    "AHRS2": lambda _, t: {**_AHRS2(t), "lat": 481370000, "lng": 115750000},
    "ATTITUDE_TARGET": lambda us, t: {
        "time_boot_ms": us // 1000 % 2**32, "type_mask": 7, "q": IDENTITY, **_ATTITUDE_TARGET(t),
    },
    "BATTERY_STATUS": _battery,
    "EKF_STATUS_REPORT": lambda _, t: {"flags": 831, **_EKF(t), "airspeed_variance": 0.1},
    "ESTIMATOR_STATUS": lambda us, t: {"time_usec": us, "flags": 831, **_ESTIMATOR(t)},
    "EXTENDED_SYS_STATE": lambda _, __: {"vtol_state": 0, "landed_state": 2},
    "HIGHRES_IMU": lambda us, t: {"time_usec": us, **_HIGHRES(t), "fields_updated": 0xFFFF, "id": 0},
    "MEMINFO": lambda _, __: {"brkval": 0, "freemem": 65535, "freemem32": 180_000},
    "MISSION_CURRENT": lambda _, __: {"seq": 1, "total": 5, "mission_state": 3, "mission_mode": 1},
    "NAV_CONTROLLER_OUTPUT": lambda _, t: {
        **_NAVIGATION(t), "nav_bearing": 45, "target_bearing": 50, "wp_dist": round(20 + 10 * sin(2 * pi * t / 60)),
    },
    "ODOMETRY": _odometry,
    "POSITION_TARGET_GLOBAL_INT": _position_target,
    "POWER_STATUS": lambda _, __: {"Vcc": 5020, "Vservo": 4980, "flags": 3},
    "RC_CHANNELS": _rc_channels,
    "SCALED_IMU2": _scaled_imu2,
    "SCALED_PRESSURE": lambda us, _: {
        "time_boot_ms": us // 1000 % 2**32, "press_abs": 955.2, "press_diff": 0.3, "temperature": 3120,
        "temperature_press_diff": 10,
    },
    "VIBRATION": lambda us, t: {"time_usec": us, **_VIBRATION(t), "clipping_0": 1, "clipping_1": 0, "clipping_2": 1},
    "WIND": lambda _, t: {"direction": 210.0 + 5.0 * sin(t), "speed": 3.0, "speed_z": 0.1},
    "WIND_COV": lambda us, t: {"time_usec": us, **_WIND_COV(t)},
}  # fmt: skip
"""Maker by message name."""
