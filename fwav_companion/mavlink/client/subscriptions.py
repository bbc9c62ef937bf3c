"""Lists the messages that we want from the autopilot, and their rates."""

from __future__ import annotations

from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.types.situation import AutopilotKind

MESSAGE_IDS = {
    name: BY_NAME[name].msgid
    for name in (
        "SYSTEM_TIME", "GPS_RAW_INT", "ATTITUDE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT",
        "GPS_GLOBAL_ORIGIN", "VFR_HUD", "DISTANCE_SENSOR", "TERRAIN_REPORT", "ALTITUDE", "EKF_STATUS_REPORT",
        "ESTIMATOR_STATUS", "HOME_POSITION", "GIMBAL_DEVICE_ATTITUDE_STATUS", "ODOMETRY",
    )
}  # fmt: skip
"""Ids of the messages that may be requested, by name."""
OF_ONE_FIRMWARE = {
    "EKF_STATUS_REPORT": AutopilotKind.ARDUPILOT,
    "ESTIMATOR_STATUS": AutopilotKind.PX4,
    "ODOMETRY": AutopilotKind.PX4,
}
"""Reports of the autopilots' filters, and the firmware that alone sends each."""
NOT_OF_ARDUPILOT = frozenset({"ALTITUDE", "LOCAL_POSITION_NED"})
"""Messages that ArduPilot is not asked for at its adoption: it never sends ALTITUDE, and reports a request for it as an
error; LOCAL_POSITION_NED serves only PX4's landing profile, and a vehicle without a global position."""


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
    """The messages that an autopilot of this kind does not have."""
    return frozenset(name for name, owner in OF_ONE_FIRMWARE.items() if owner is not kind)


def unneeded_messages(kind: AutopilotKind) -> frozenset[str]:
    """The messages that an autopilot of this kind is not asked for at its adoption."""
    return missing_messages(kind) | (NOT_OF_ARDUPILOT if kind is AutopilotKind.ARDUPILOT else frozenset())
