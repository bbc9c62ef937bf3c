"""Message rates: defaults, requested intervals, and the groups of REQUEST_DATA_STREAM.

``autopilot.streams`` chooses the messages that the autopilot sends before any request:

- "": a mixture that suits most flights of this mock, not that of a real autopilot;
- ``arducopter``: only its heartbeat, since SRn_* (MAVn_* from 4.7 on) are 0 on a copter;
- ``arduplane``: every group at 1 Hz;
- ``px4_normal``, ``px4_onboard``: PX4's MAV_n_MODE Normal and Onboard;
- ``inav``, ``betaflight``: their telemetry with the attitude's rate (mavlink_extra1_rate) raised from 3 and 2 to 10 Hz,
  and the position's (mavlink_pos_rate) from 2 to 5 Hz.

Sources: ArduPilot 4.7, libraries/GCS_MAVLink/GCS_MAVLink_Parameters.cpp (groups and their default rates) and
GCS_Common.cpp (set_message_interval, handle_request_data_stream); PX4 1.14, src/modules/mavlink/mavlink_main.cpp
(configure_streams_to_default) and mavlink_receiver.cpp; INAV 8 and Betaflight 4, src/main/telemetry/mavlink.c.
"""

from __future__ import annotations

from sitl_mock.autopilot_options import AutopilotOptions

ARDUPILOT_HZ = {
    "HEARTBEAT": 1.0,
    "ATTITUDE": 4.0,
    "GLOBAL_POSITION_INT": 3.0,
    "LOCAL_POSITION_NED": 3.0,
    "VFR_HUD": 4.0,
    "SYS_STATUS": 2.0,
    "GPS_RAW_INT": 2.0,
    "RAW_IMU": 2.0,
    "SERVO_OUTPUT_RAW": 2.0,
    "SYSTEM_TIME": 2.0,
    "DISTANCE_SENSOR": 2.0,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": 5.0,
}
PX4_HZ = {
    "HEARTBEAT": 1.0,
    "ATTITUDE": 10.0,
    "ATTITUDE_QUATERNION": 10.0,
    "GLOBAL_POSITION_INT": 5.0,
    "LOCAL_POSITION_NED": 5.0,
    "VFR_HUD": 4.0,
    "ALTITUDE": 1.0,
    "SYS_STATUS": 1.0,
    "GPS_RAW_INT": 1.0,
    "SYSTEM_TIME": 1.0,
    "HOME_POSITION": 0.5,
    "GPS_GLOBAL_ORIGIN": 0.5,
    "DISTANCE_SENSOR": 5.0,
}
PX4_NORMAL_HZ = {
    "HEARTBEAT": 1.0,
    "ALTITUDE": 1.0,
    "ATTITUDE": 15.0,
    "ATTITUDE_TARGET": 2.0,
    "BATTERY_STATUS": 0.5,
    "DISTANCE_SENSOR": 0.5,
    "ESTIMATOR_STATUS": 0.5,
    "EXTENDED_SYS_STATE": 1.0,
    "GLOBAL_POSITION_INT": 5.0,
    "GPS_GLOBAL_ORIGIN": 0.1,
    "GPS_RAW_INT": 1.0,
    "HOME_POSITION": 0.5,
    "LOCAL_POSITION_NED": 1.0,
    "NAV_CONTROLLER_OUTPUT": 1.0,
    "POSITION_TARGET_GLOBAL_INT": 1.0,
    "RC_CHANNELS": 5.0,
    "SERVO_OUTPUT_RAW": 1.0,
    "SYS_STATUS": 1.0,
    "VFR_HUD": 4.0,
    "VIBRATION": 0.1,
    "WIND_COV": 0.5,
}
PX4_ONBOARD_HZ = {
    "HEARTBEAT": 1.0,
    "HIGHRES_IMU": 50.0,
    "LOCAL_POSITION_NED": 30.0,
    "ATTITUDE": 100.0,
    "ALTITUDE": 10.0,
    "DISTANCE_SENSOR": 10.0,
    "ODOMETRY": 30.0,
    "ATTITUDE_QUATERNION": 50.0,
    "ATTITUDE_TARGET": 10.0,
    "BATTERY_STATUS": 0.5,
    "ESTIMATOR_STATUS": 1.0,
    "EXTENDED_SYS_STATE": 5.0,
    "GLOBAL_POSITION_INT": 50.0,
    "GPS_GLOBAL_ORIGIN": 1.0,
    "GPS_RAW_INT": 5.0,
    "HOME_POSITION": 0.5,
    "NAV_CONTROLLER_OUTPUT": 10.0,
    "POSITION_TARGET_GLOBAL_INT": 10.0,
    "RC_CHANNELS": 20.0,
    "SERVO_OUTPUT_RAW": 10.0,
    "SYS_STATUS": 5.0,
    "SYSTEM_TIME": 1.0,
    "VFR_HUD": 10.0,
    "VIBRATION": 0.5,
    "WIND_COV": 10.0,
}
PX4_UNLIMITED = frozenset({"GPS_RAW_INT"})
"""Unlimited streams of Onboard mode: sent whenever the receiver has new data (here five times a second), with interval
-1."""
GROUPS = {
    1: ("RAW_IMU", "SCALED_IMU2", "SCALED_PRESSURE"),
    2: (
        "SYS_STATUS", "GPS_RAW_INT", "POWER_STATUS", "MEMINFO", "MISSION_CURRENT", "NAV_CONTROLLER_OUTPUT",
        "POSITION_TARGET_GLOBAL_INT",
    ),
    3: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    6: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    10: ("ATTITUDE", "AHRS2"),
    11: ("VFR_HUD",),
    12: ("SYSTEM_TIME", "DISTANCE_SENSOR", "AHRS", "WIND", "BATTERY_STATUS", "EKF_STATUS_REPORT", "VIBRATION",
         "GIMBAL_DEVICE_ATTITUDE_STATUS"),
}  # fmt: skip
"""Messages that ArduPilot sends for each MAV_DATA_STREAM, as far as the mock has them; stream 0 is all of them."""
GROUP_PARAMETERS = {
    1: "SR1_RAW_SENS",
    2: "SR1_EXT_STAT",
    3: "SR1_RC_CHAN",
    4: "SR1_RAW_CTRL",
    6: "SR1_POSITION",
    10: "SR1_EXTRA1",
    11: "SR1_EXTRA2",
    12: "SR1_EXTRA3",
}
INAV_HZ = {
    "HEARTBEAT": 1.0,
    "SYSTEM_TIME": 1.0,
    "SYS_STATUS": 2.0,
    "RC_CHANNELS": 1.0,
    "GPS_RAW_INT": 5.0,
    "GLOBAL_POSITION_INT": 5.0,
    "GPS_GLOBAL_ORIGIN": 5.0,
    "ATTITUDE": 10.0,
    "VFR_HUD": 2.0,
    "BATTERY_STATUS": 1.0,
}
INAV_GROUPS = {
    2: ("SYS_STATUS",),
    3: ("RC_CHANNELS",),
    6: ("GPS_RAW_INT", "GLOBAL_POSITION_INT", "GPS_GLOBAL_ORIGIN"),
    10: ("ATTITUDE",),
    11: ("VFR_HUD",),
    12: ("BATTERY_STATUS",),
}
"""Messages of each MAV_DATA_STREAM in INAV; HEARTBEAT and SYSTEM_TIME are in none."""
BETAFLIGHT_HZ = {
    "HEARTBEAT": 2.0,
    "SYS_STATUS": 2.0,
    "GPS_RAW_INT": 5.0,
    "GLOBAL_POSITION_INT": 5.0,
    "GPS_GLOBAL_ORIGIN": 5.0,
    "ATTITUDE": 10.0,
    "VFR_HUD": 2.0,
}
CEILING = 0.8
"""Fraction of SCHED_LOOP_RATE above which ArduPilot refuses a rate."""


class Streams:
    """Rates and intervals by message; :mod:`sitl_mock.broadcast` schedules them."""

    def __init__(self, options: AutopilotOptions) -> None:
        self._o = options
        self._is_px4 = options.firmware == "px4"
        by_vehicle_hz = 1.0 if options.streams == "arduplane" else 0.0
        self._groups = INAV_GROUPS if options.streams == "inav" else GROUPS
        self._group_hz = self._booted_hz = dict.fromkeys(self._groups, by_vehicle_hz) | options.group_rates_hz
        self.defaults_hz = self._defaults()
        self.rates_hz = dict(self.defaults_hz)
        self.generation: dict[str, int] = {}

    @property
    def ceiling_hz(self) -> float:
        """Highest accepted rate."""
        return CEILING * self._o.loop_rate_hz

    def boot(self) -> None:
        """Resets the groups to the rates of their parameters; a rate requested by a station is not stored."""
        self._group_hz = dict(self._booted_hz)

    def set_rate(self, name: str, rate_hz: float) -> int:
        """Sets a rate (0 stops the stream); returns the generation number of the new schedule."""
        self.rates_hz[name] = rate_hz
        self.generation[name] = self.generation.get(name, 0) + 1
        return self.generation[name]

    def interval_ns(self, name: str) -> int:
        """True interval between two messages; 0: not sent."""
        rate_hz = self.rates_hz.get(name, 0.0)
        if self._o.true_ceiling_hz:
            rate_hz = min(rate_hz, self._o.true_ceiling_hz)
        return round(1e9 / rate_hz) if rate_hz > 0.0 else 0

    def reported_interval_us(self, name: str) -> int:
        """MESSAGE_INTERVAL.interval_us. For a stopped stream ArduPilot reports -1 and PX4 0; -1 is PX4's
        "unlimited".
        """
        if self._is_px4:
            unlimited = self._o.streams == "px4_onboard" and name in PX4_UNLIMITED
            if unlimited and self.rates_hz.get(name) == self.defaults_hz[name]:
                return -1
            return self.interval_ns(name) // 1000
        return self.interval_ns(name) // 1000 or -1

    def default_hz(self, name: str) -> float | None:
        """Rate that an interval of 0 requests. None: the message is in no group, so ArduPilot has no default and
        refuses.
        """
        if self._is_px4 or not self._o.streams:
            return self.defaults_hz.get(name, 0.0)
        if name in self.defaults_hz:
            return self.defaults_hz[name]
        return next((self._group_hz[number] for number, names in GROUPS.items() if name in names), None)

    def request_group(self, number: int, rate_hz: float) -> dict[str, float]:
        """New rate of each message in the group of a REQUEST_DATA_STREAM; empty on PX4, which ignores the request."""
        if self._is_px4 and self._o.streams:
            return {}
        groups = self._groups
        chosen = {number: groups[number]} if number in groups else groups if number == 0 else {}
        for each in chosen:
            self._group_hz[each] = rate_hz
        return {name: rate_hz for names in chosen.values() for name in names}

    def parameters(self) -> dict[str, float]:
        """SRn_* of the link, where the autopilot has them."""
        if self._is_px4 or not self._o.streams:
            return {}
        return {GROUP_PARAMETERS[number]: int(hz) for number, hz in self._group_hz.items()}

    def _defaults(self) -> dict[str, float]:
        if self._o.streams in {"arducopter", "arduplane"}:
            by_group = {name: self._group_hz[number] for number, names in GROUPS.items() for name in names}
            return {"HEARTBEAT": 1.0, **{name: hz for name, hz in by_group.items() if hz}, **self._o.rates_hz}
        usual = {
            "px4_normal": PX4_NORMAL_HZ,
            "px4_onboard": PX4_ONBOARD_HZ,
            "inav": INAV_HZ,
            "betaflight": BETAFLIGHT_HZ,
        }.get(self._o.streams)
        if usual is None:
            usual = PX4_HZ if self._is_px4 else ARDUPILOT_HZ
        return {**usual, **self._o.rates_hz}
