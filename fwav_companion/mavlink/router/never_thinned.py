"""Decides which messages may be thinned on a link that is too slow: telemetry, whose next sample replaces the last.

A message that names a receiver (``target_system``) is a command, an answer, a parameter, a mission item, a file or a
log transfer, and is never thinned. Nor are the messages below, which name no receiver but are sent once.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from fwav_companion.mavlink.wire.definitions import DEFINITIONS

NEVER_THINNED: Final = frozenset(
    {
        "HEARTBEAT", "STATUSTEXT", "RADIO", "RADIO_STATUS",
        # parameters and missions
        "PARAM_VALUE", "PARAM_EXT_VALUE", "PARAM_EXT_ACK", "MISSION_CURRENT", "MISSION_ITEM_REACHED",
        "SAFETY_ALLOWED_AREA", "OSD_PARAM_CONFIG_REPLY", "OSD_PARAM_SHOW_CONFIG_REPLY",
        # messages that are sent when they change, or on request
        "HOME_POSITION", "GPS_GLOBAL_ORIGIN", "MESSAGE_INTERVAL", "AUTOPILOT_VERSION", "CAMERA_INFORMATION",
        "CAMERA_SETTINGS", "STORAGE_INFORMATION", "VIDEO_STREAM_INFORMATION", "GIMBAL_MANAGER_INFORMATION",
        "GIMBAL_DEVICE_INFORMATION", "FLIGHT_INFORMATION", "UAVCAN_NODE_INFO", "WIFI_CONFIG_AP",
        "CHANGE_OPERATOR_CONTROL_ACK", "SECURE_COMMAND_REPLY", "DEVICE_OP_READ_REPLY", "DEVICE_OP_WRITE_REPLY",
        "GOPRO_GET_RESPONSE", "GOPRO_SET_RESPONSE", "MAG_CAL_REPORT", "BUTTON_CHANGE", "CAMERA_TRIGGER",
        "CAMERA_IMAGE_CAPTURED", "COLLISION",
        # transfers
        "LOG_ENTRY", "LOG_DATA", "SERIAL_CONTROL", "DATA_TRANSMISSION_HANDSHAKE", "ENCAPSULATED_DATA",
        "TERRAIN_REQUEST", "TERRAIN_DATA", "TERRAIN_CHECK",
    }
)  # fmt: skip
INPUTS: Final = frozenset(
    {
        "TIMESYNC", "MANUAL_CONTROL", "MANUAL_SETPOINT", "LANDING_TARGET", "FOLLOW_TARGET", "GPS_INPUT",
        "GPS_RTCM_DATA",
        "VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE", "VISION_POSITION_DELTA", "VICON_POSITION_ESTIMATE",
        "GLOBAL_VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP", "ODOMETRY", "OBSTACLE_DISTANCE", "OBSTACLE_DISTANCE_3D",
        "OPTICAL_FLOW", "OPTICAL_FLOW_RAD", "DISTANCE_SENSOR", "HIL_STATE", "HIL_SENSOR", "HIL_GPS",
        "HIL_STATE_QUATERNION", "HIL_OPTICAL_FLOW", "HIL_RC_INPUTS_RAW", "HIL_ACTUATOR_CONTROLS",
        "TRAJECTORY_REPRESENTATION_WAYPOINTS", "TRAJECTORY_REPRESENTATION_BEZIER",
    }
)  # fmt: skip
"""Inputs of an autopilot's control: telemetry on the way to the ground, never thinned on the way to an autopilot."""
TELEMETRY_THAT_NAMES_A_RECEIVER: Final = frozenset({"GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_STATUS"})
"""Telemetry streams that have a receiver field: it is 0, every system."""


def is_telemetry(msgid: int, *, to_autopilot: bool = False) -> bool:
    """Return whether the message may be thinned on a slow link. False for an unknown id, which may be anything."""
    return msgid in _telemetry_ids(to_autopilot)


@cache
def _telemetry_ids(to_autopilot: bool) -> frozenset[int]:
    kept = NEVER_THINNED | INPUTS if to_autopilot else NEVER_THINNED
    return frozenset(
        msgid
        for msgid, definition in DEFINITIONS.items()
        if definition.name in TELEMETRY_THAT_NAMES_A_RECEIVER
        or ("target_system" not in definition.field_names and definition.name not in kept)
    )
