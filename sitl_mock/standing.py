"""Messages that describe the vehicle and do not depend on its motion."""

from __future__ import annotations

from typing import Any

from sitl_mock.autopilot_options import AutopilotOptions

QUADROTOR, FLAPPING_WING = 2, 16
AUTOPILOTS = {"ardupilot": 3, "px4": 12, "inav": 0, "betaflight": 0}
"""MAV_AUTOPILOT; 0: GENERIC."""
ARMED, STABILIZED, CUSTOM = 128, 16, 1


def heartbeat(
    options: AutopilotOptions,
    armed: bool,
    status: int | None = None,
    *,
    mode_changed: bool = False,
    copter_mode: int | None = None,
) -> dict[str, Any]:
    """HEARTBEAT fields of a flapping-wing vehicle, or of a copter in a mode. ``status``: None: by the arming."""
    px4 = options.firmware == "px4"
    return {
        "type": FLAPPING_WING if copter_mode is None else QUADROTOR,
        "autopilot": AUTOPILOTS[options.firmware],
        "base_mode": CUSTOM | STABILIZED | (ARMED if armed else 0),
        "custom_mode": ((0x04040000 if px4 else 10) if copter_mode is None else copter_mode) + mode_changed,
        "system_status": status if status is not None else 4 if armed else 3,
        "mavlink_version": 3,
    }


def sys_status() -> dict[str, Any]:
    """SYS_STATUS fields without a fault."""
    sensors = dict.fromkeys(("present", "enabled", "health"), 0x2F)
    counters = dict.fromkeys((f"errors_count{i}" for i in range(1, 5)), 0)
    return {
        **{f"onboard_control_sensors_{key}": value for key, value in sensors.items()},
        "load": 310,
        "voltage_battery": 11800,
        "current_battery": 640,
        "battery_remaining": 82,
        "drop_rate_comm": 0,
        "errors_comm": 0,
        **counters,
    }


def autopilot_version(options: AutopilotOptions) -> dict[str, Any]:
    """AUTOPILOT_VERSION fields of a release that fits the simulated firmware."""
    major, minor, patch = (1, 15, 4) if options.firmware == "px4" else (4, 7, 0)
    if options.landing_consumer == "ardupilot_old":
        major, minor, patch = (4, 1, 7)
    return {
        "capabilities": 0x2000 | 0x40,
        "flight_sw_version": major << 24 | minor << 16 | patch << 8 | 255,
        "middleware_sw_version": 0,
        "os_sw_version": 0,
        "board_version": 0,
        "flight_custom_version": [0] * 8,
        "middleware_custom_version": [0] * 8,
        "os_custom_version": [0] * 8,
        "vendor_id": 0,
        "product_id": 0,
        "uid": 1,
    }
