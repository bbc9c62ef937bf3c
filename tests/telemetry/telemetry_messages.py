"""Messages of an autopilot as telemetry receives them, with plain defaults: a test states only its differences."""

from math import degrees, radians
from types import SimpleNamespace
from typing import Any

from fwav_companion.geometry.rotations import euler_from_quaternion
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry import Telemetry, TelemetryOptions
from fwav_companion.types import Message

MS = 1_000_000

HOST_AT_BOOT = 1_000_000_000_000
"""Nanoseconds on the host's clock when the autopilot's began, where a test does not say otherwise."""
WHOLE_MS = 0.001
"""Value of attitude_stamp_delay_s whose mean cancels the correction for cut stamps, so that stamps are used
unchanged."""

DEFAULTS: dict[str, dict[str, Any]] = {
    "ATTITUDE": dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.0),
    "ATTITUDE_QUATERNION": {
        **dict.fromkeys(("q2", "q3", "q4", "rollspeed", "pitchspeed", "yawspeed"), 0.0),
        "q1": 1.0,
        "repr_offset_q": (0.0, 0.0, 0.0, 0.0),
    },
    "GLOBAL_POSITION_INT": {
        "lat": 473_977_420,
        "lon": 85_455_940,
        "alt": 500_000,
        "relative_alt": 10_000,
        "vx": 0,
        "vy": 0,
        "vz": 0,
        "hdg": 0,
    },
    "LOCAL_POSITION_NED": dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), 0.0),
    "ODOMETRY": {
        "frame_id": 1,
        "child_frame_id": 1,
        "q": (1.0, 0.0, 0.0, 0.0),
        "reset_counter": 0,
        "estimator_type": 8,
        "quality": 0,
        **dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), 0.0),
    },
    "DISTANCE_SENSOR": {
        "min_distance": 20,
        "max_distance": 4000,
        "current_distance": 1000,
        "type": 0,
        "id": 0,
        "orientation": 25,
        "covariance": 255,
        "horizontal_fov": 0.0,
        "vertical_fov": 0.0,
        "quaternion": (0.0, 0.0, 0.0, 0.0),
        "signal_quality": 0,
    },
    "SYSTEM_TIME": {"time_unix_usec": 0},
    "ALTITUDE": {"time_usec": 0, "altitude_relative": 0.0, "altitude_monotonic": float("nan")},
    "VFR_HUD": {"alt": 0.0, "climb": 0.0},
    "SCALED_PRESSURE": {"press_abs": 1013.25, "press_diff": 0.0, "temperature": 2000},
    "GPS_RAW_INT": {"time_usec": 0, "fix_type": 3, "alt": 500_000, "alt_ellipsoid": 547_000, "h_acc": 1_000},
    "EKF_STATUS_REPORT": {"flags": 831, "velocity_variance": 0.1, "pos_horiz_variance": 0.1},
    "ESTIMATOR_STATUS": {"flags": 831, "vel_ratio": 0.1, "pos_horiz_ratio": 0.1, "pos_horiz_accuracy": 0.4},
    "EXTENDED_SYS_STATE": {"vtol_state": 0, "landed_state": 2},
    "GPS_GLOBAL_ORIGIN": {"latitude": 473_970_000, "longitude": 85_450_000, "altitude": 480_000},
    "HOME_POSITION": {"latitude": 473_977_420, "longitude": 85_455_940, "altitude": 490_000},
    "TERRAIN_REPORT": {"lat": 0, "lon": 0, "spacing": 30, "terrain_height": 480.0, "current_height": 20.0},
    "HEARTBEAT": {"autopilot": 3, "type": 16, "base_mode": 0},
    "PARAM_VALUE": {"param_id": "", "param_value": 0.0},
    "STATUSTEXT": {"text": ""},
}
STAMPED = {
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "DISTANCE_SENSOR",
    "SYSTEM_TIME",
    "SCALED_PRESSURE",
}


def message(name: str, **fields: Any) -> Message:
    return Message(name, 1, 1, "autopilot", SimpleNamespace(**{**DEFAULTS[name], **fields}))


class Autopilot:
    """Sends messages to a Telemetry at instants of its own clock; they arrive ``delay_ms`` later on the host's."""

    def __init__(self, *, host_at_boot: int = HOST_AT_BOOT, delay_ms: float = 0.0, **options: Any) -> None:
        self.telemetry = Telemetry(TelemetryOptions(**{"attitude_stamp_delay_s": WHOLE_MS, **options}))
        self.host_at_boot = host_at_boot
        self.delay_ns = round(delay_ms * 1e6)
        self.events: list[Any] = []

    def host(self, boot_ms: float) -> HostNs:
        return HostNs(self.host_at_boot + round(boot_ms * 1e6))

    def send(self, name: str, boot_ms: float, **fields: Any) -> tuple[Any, ...]:
        """The events of this message, which are also kept in :attr:`events`."""
        if name in STAMPED:
            fields.setdefault("time_boot_ms", int(boot_ms) % 2**32)
        elif name == "ODOMETRY":
            fields.setdefault("time_usec", round(boot_ms * 1000))
        events = self.telemetry.on_message(message(name, **fields), HostNs(self.host(boot_ms) + self.delay_ns))
        self.events += events
        return events

    def attitudes(self, from_ms: int, until_ms: int, every_ms: int = 10, name: str = "ATTITUDE") -> None:
        """Send level attitudes."""
        for boot_ms in range(from_ms, until_ms, every_ms):
            self.send(name, boot_ms)


def pitch_deg(autopilot: Autopilot, boot_ms: float) -> float:
    return degrees(euler_from_quaternion(autopilot.telemetry.state_at(BootNs(round(boot_ms * MS))).ned_from_body)[1])


def climbing(autopilot: Autopilot, until_ms: int, every_ms: int = 10) -> None:
    """Pitch rises by one degree in a second: too slowly to show whether stamps scatter."""
    for boot_ms in range(0, until_ms, every_ms):
        autopilot.send("ATTITUDE", boot_ms, pitch=radians(boot_ms / 1000.0))
