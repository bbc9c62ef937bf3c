"""Enum values that acting uses, under their MAVLink names (common.xml)."""

from __future__ import annotations

MAV_CMD_DO_SET_ROI_LOCATION = 195
MAV_CMD_DO_SET_ROI_NONE = 197
MAV_CMD_REQUEST_MESSAGE = 512
MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE = 1001

GIMBAL_MANAGER_INFORMATION = 280
GIMBAL_MANAGER_STATUS = 281
"""Message ids, as commands carry them."""

GIMBAL_MANAGER_FLAGS_ROLL_LOCK = 4
GIMBAL_MANAGER_FLAGS_PITCH_LOCK = 8
GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME = 32

MAV_FRAME_GLOBAL = 0
"""Altitude above mean sea level."""

MAV_STATE_STANDBY = 3
MAV_STATE_ACTIVE = 4
MAV_STATE_CRITICAL = 5
MAV_LANDED_STATE_ON_GROUND = 1
MAV_MODE_FLAG_SAFETY_ARMED = 128

MAV_RESULT_ACCEPTED = 0
MAV_RESULT_IN_PROGRESS = 5
RESULTS = {
    1: "temporarily rejected",
    2: "denied",
    3: "unsupported",
    4: "failed",
    6: "cancelled",
}
"""Words for the other values of MAV_RESULT."""

FOLLOW_POSITION, FOLLOW_VELOCITY = 1, 2
"""Bits of FOLLOW_TARGET.est_capabilities."""
