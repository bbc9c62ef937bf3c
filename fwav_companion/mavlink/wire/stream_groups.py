"""Lists the messages of each group that a REQUEST_DATA_STREAM names, as defined by ArduPilot.

Contents: ``STREAM_*_msgs`` in ArduPilot 4.7 (libraries/GCS_MAVLink/GCS_MAVLink_Parameters.cpp), and the messages that
4.0 to 4.6 had in the same groups (ArduCopter/GCS_Mavlink.cpp: SENSOR_OFFSETS, AHRS3, HWSTATUS, RANGEFINDER, BATTERY2,
MOUNT_STATUS). Group 0 is all of them except the parameters. PX4 has an empty handler for the message
(mavlink_receiver.cpp: "REQUEST_DATA_STREAM is deprecated"): a request by group changes nothing there.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from fwav_companion.mavlink.wire.definitions import BY_NAME

ALL: Final = 0
"""MAV_DATA_STREAM_ALL."""

GROUPS: Final[dict[int, tuple[str, ...]]] = {
    1: (  # RAW_SENSORS
        "RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3",
        "SENSOR_OFFSETS", "AIRSPEED",
    ),
    2: (  # EXTENDED_STATUS
        "SYS_STATUS", "POWER_STATUS", "MCU_STATUS", "MEMINFO", "MISSION_CURRENT", "GPS_RAW_INT", "GPS_RTK",
        "GPS2_RAW", "GPS2_RTK", "NAV_CONTROLLER_OUTPUT", "FENCE_STATUS", "POSITION_TARGET_GLOBAL_INT",
    ),
    3: ("SERVO_OUTPUT_RAW", "RC_CHANNELS", "RC_CHANNELS_RAW"),  # RC_CHANNELS
    4: ("RC_CHANNELS_SCALED",),  # RAW_CONTROLLER
    6: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),  # POSITION
    10: (  # EXTRA1
        "ATTITUDE", "SIMSTATE", "AHRS2", "AHRS3", "RPM", "AOA_SSA", "PID_TUNING", "DEEPSTALL",
        "ESC_TELEMETRY_1_TO_4", "ESC_TELEMETRY_5_TO_8", "ESC_TELEMETRY_9_TO_12", "WHEEL_DISTANCE",
        "GENERATOR_STATUS", "WINCH_STATUS", "EFI_STATUS", "HYGROMETER_SENSOR",
    ),
    11: ("VFR_HUD",),  # EXTRA2
    12: (  # EXTRA3
        "AHRS", "HWSTATUS", "WIND", "WATER_DEPTH", "RANGEFINDER", "DISTANCE_SENSOR", "SYSTEM_TIME",
        "TERRAIN_REPORT", "TERRAIN_REQUEST", "BATTERY2", "BATTERY_STATUS", "MOUNT_STATUS",
        "GIMBAL_DEVICE_ATTITUDE_STATUS", "OPTICAL_FLOW", "MAG_CAL_REPORT", "MAG_CAL_PROGRESS",
        "EKF_STATUS_REPORT", "VIBRATION",
    ),
}  # fmt: skip
"""Message names by MAV_DATA_STREAM."""
ONLY_IN_ALL: Final = ("ADSB_VEHICLE", "AIS_VESSEL")
"""ArduPilot's own ADSB group, which no value of MAV_DATA_STREAM selects alone."""


@cache
def group_ids(number: int) -> frozenset[int]:
    """Return the message ids of a group; empty for a number that ArduPilot does not know."""
    names = GROUPS.get(number, ())
    if number == ALL:
        names = (*(name for members in GROUPS.values() for name in members), *ONLY_IN_ALL)
    return frozenset(BY_NAME[name].msgid for name in names if name in BY_NAME)


def group_of(msgid: int) -> int | None:
    """Return the number of the group that holds the message; None if no group request reaches it."""
    return next((number for number in GROUPS if msgid in group_ids(number)), None)
