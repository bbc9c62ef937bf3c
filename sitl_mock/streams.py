"""Which message is sent how often: defaults, asked intervals, and the old groups of REQUEST_DATA_STREAM."""

from __future__ import annotations

from sitl_mock.options import AutopilotOptions

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
GROUPS = {
    1: ("RAW_IMU",),
    2: ("SYS_STATUS", "GPS_RAW_INT"),
    3: ("SERVO_OUTPUT_RAW",),
    6: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    10: ("ATTITUDE",),
    11: ("VFR_HUD",),
    12: ("SYSTEM_TIME", "DISTANCE_SENSOR"),
}
"""MAV_DATA_STREAM and what ArduPilot puts into it; 0 is all of them."""
CEILING = 0.8
"""Of SCHED_LOOP_RATE: beyond it ArduPilot refuses an interval."""


class Streams:
    """Intervals by name, and when each is due; the wiring to time is the vehicle's."""

    def __init__(self, options: AutopilotOptions) -> None:
        self._o = options
        usual = PX4_HZ if options.firmware == "px4" else ARDUPILOT_HZ
        self.defaults_hz = {**usual, **options.rates_hz}
        self.rates_hz = dict(self.defaults_hz)
        self.generation: dict[str, int] = {}

    @property
    def ceiling_hz(self) -> float:
        """The highest rate that is accepted."""
        return CEILING * self._o.loop_rate_hz

    def set_rate(self, name: str, rate_hz: float) -> int:
        """Asks for a rate (0 stops it); the generation that its sendings belong to from now on."""
        self.rates_hz[name] = rate_hz
        self.generation[name] = self.generation.get(name, 0) + 1
        return self.generation[name]

    def interval_ns(self, name: str) -> int:
        """Between two sendings, as really done; 0: not sent."""
        rate_hz = self.rates_hz.get(name, 0.0)
        if self._o.true_ceiling_hz:
            rate_hz = min(rate_hz, self._o.true_ceiling_hz)
        return round(1e9 / rate_hz) if rate_hz > 0.0 else 0
