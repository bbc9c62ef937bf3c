"""Lists the messages that we want from the autopilot, and their rates."""

from __future__ import annotations

from fwav_companion.types.situation import AutopilotKind

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
    "EKF_STATUS_REPORT": 193,
    "ESTIMATOR_STATUS": 230,
    "HOME_POSITION": 242,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": 285,
}
ONLY_ARDUPILOT = frozenset({"EKF_STATUS_REPORT"})
"""Messages that PX4 does not have."""
ONLY_PX4 = frozenset({"ALTITUDE", "LOCAL_POSITION_NED", "ESTIMATOR_STATUS"})
"""Messages that are requested from PX4 alone. ArduPilot never sends ALTITUDE, and reports a request for it as an error;
LOCAL_POSITION_NED serves only PX4's landing profile; ArduPilot's filter reports by EKF_STATUS_REPORT."""


ONLY_IN_FIRMWARE = {"EKF_STATUS_REPORT": AutopilotKind.ARDUPILOT, "ESTIMATOR_STATUS": AutopilotKind.PX4}
"""The firmware that alone has a message of those that may be requested later."""


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


def missing_messages(kind: AutopilotKind) -> frozenset[str]:
    """The messages of those that may be requested later that this firmware does not have."""
    return frozenset(name for name, owner in ONLY_IN_FIRMWARE.items() if owner is not kind)


def other_firmwares(kind: AutopilotKind) -> frozenset[str]:
    """The messages that an autopilot of this kind does not have."""
    if kind is AutopilotKind.ARDUPILOT:
        return ONLY_PX4
    return ONLY_ARDUPILOT if kind is AutopilotKind.PX4 else frozenset()
