"""Lists the messages that we want from the autopilot, their rates, and the stream that contains each."""

from __future__ import annotations

from fwav_companion.mavlink.wire import enums

MESSAGE_IDS = {
    "SYSTEM_TIME": 2,
    "GPS_RAW_INT": 24,
    "ATTITUDE": 30,
    "ATTITUDE_QUATERNION": 31,
    "LOCAL_POSITION_NED": 32,
    "GLOBAL_POSITION_INT": 33,
    "GPS_GLOBAL_ORIGIN": 49,
    "VFR_HUD": 74,
    "DISTANCE_SENSOR": 132,
    "TERRAIN_REPORT": 136,
    "ALTITUDE": 141,
    "HOME_POSITION": 242,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": 285,
}
DATA_STREAMS = {
    "ATTITUDE": enums.MAV_DATA_STREAM_EXTRA1,
    "ATTITUDE_QUATERNION": enums.MAV_DATA_STREAM_EXTRA1,
    "LOCAL_POSITION_NED": enums.MAV_DATA_STREAM_POSITION,
    "GLOBAL_POSITION_INT": enums.MAV_DATA_STREAM_POSITION,
    "GPS_RAW_INT": enums.MAV_DATA_STREAM_EXTENDED_STATUS,
}
"""Stream of REQUEST_DATA_STREAM that contains the message; EXTRA3 for the others."""
ONLY_PX4 = frozenset({"ALTITUDE", "LOCAL_POSITION_NED"})
"""ArduPilot never sends ALTITUDE, and reports a request for it as an error; LOCAL_POSITION_NED serves only PX4's
landing profile."""


def default_subscriptions(attitude_hz: float, position_hz: float) -> dict[str, float]:
    """Return message name -> hertz from [rates], the most important first: they are requested in this order."""
    return {
        "ATTITUDE_QUATERNION": attitude_hz,
        "ATTITUDE": attitude_hz,
        "GLOBAL_POSITION_INT": position_hz,
        "LOCAL_POSITION_NED": position_hz,
        "DISTANCE_SENSOR": position_hz,
        "ALTITUDE": position_hz,
        "GPS_RAW_INT": 2.0,
        "SYSTEM_TIME": 1.0,
        "HOME_POSITION": 0.2,
    }
