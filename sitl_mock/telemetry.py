"""Fields of every message that the autopilot streams, computed at the instant of sending."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import atan2, degrees, hypot, nan, pi, radians
from random import Random
from typing import Any

from sitl_mock.belief import Belief
from sitl_mock.clock import BootClock
from sitl_mock.earth import Place
from sitl_mock.gimbal import BEHIND_AUTOPILOT
from sitl_mock.options import Options
from sitl_mock.rotation import Vector, apply_transposed, matrix_from_euler, quaternion_from_euler
from sitl_mock.standing import autopilot_version, heartbeat, sys_status
from sitl_mock.station_messages import STATION_MESSAGES, Maker

Fields = dict[str, Any]
TRIM_STAYS_BIT = 1 << 8
"""Bit of ArduPlane's FLIGHT_OPTIONS: PTCH_TRIM_DEG stays in the attitude reported to ground stations."""
DOWNWARD = 25
"""MAV_SENSOR_ROTATION_PITCH_270."""
FILTER_ATTITUDE_AND_HEIGHT = 1 | 4 | 32
FILTER_LOCAL = 2 | 8 | 256
FILTER_GLOBAL = FILTER_LOCAL | 16 | 512
FILTER_CONSTANT = 128
"""Flags of EKF_STATUS_REPORT and ESTIMATOR_STATUS: velocities, positions relative and absolute, and predicted ones."""
LOCAL_NED, BODY_FRD, ESTIMATOR_AUTOPILOT = 1, 12, 8
"""MAV_FRAME and MAV_ESTIMATOR_TYPE."""
RESETS_BEFORE = 255
"""Count of the filter's resets before the flight: the next one wraps it."""
NO_POSITION = Place(0.0, 0.0, 0.0)


class Telemetry:
    """Message contents: ``fields(name, host_ns)`` at an instant; None where the message has no content yet."""

    def __init__(self, options: Options, belief: Belief, clock: BootClock, start_host_ns: int) -> None:
        self._o, self._a = options, options.autopilot
        self._belief, self._clock, self._start = belief, clock, start_host_ns
        self._rng = Random(f"{options.seed}/stamps")
        self.armed = False
        self.mode_changed = False
        self.mode: int | None = None
        """Flight mode of a copter; None: the vehicle is not one."""
        self.status: int | None = None
        """System status in place of the usual one; None: as the arming says."""
        self.utc_minus_host_s = 0.0
        self._makers: dict[str, Callable[[int], Fields | None]] = {
            "HEARTBEAT": lambda _: heartbeat(
                self._a, self.armed, self.status, mode_changed=self.mode_changed, copter_mode=self.mode
            ),
            "ATTITUDE": self._attitude,
            "ATTITUDE_QUATERNION": self._attitude_quaternion,
            "GLOBAL_POSITION_INT": self._global_position,
            "LOCAL_POSITION_NED": self._local_position,
            "VFR_HUD": self._vfr_hud,
            "GPS_RAW_INT": self._gps_raw,
            "DISTANCE_SENSOR": self._distance_sensor,
            "SYSTEM_TIME": self._system_time,
            "SYS_STATUS": lambda _: sys_status(),
            "GPS_GLOBAL_ORIGIN": self._global_origin,
            "HOME_POSITION": self._home_position,
            "AUTOPILOT_VERSION": lambda _: autopilot_version(self._a),
            "RAW_IMU": self._raw_imu,
            "SERVO_OUTPUT_RAW": self._servo_output,
        }
        if self._a.flow:
            name = "ESTIMATOR_STATUS" if self._a.firmware == "px4" else "EKF_STATUS_REPORT"
            self._makers[name] = self._filter_status
        if self._a.firmware == "px4":
            self._makers["ALTITUDE"] = self._altitude
        if 0 < options.gimbal.device_id <= BEHIND_AUTOPILOT:
            self._makers[options.gimbal.message] = self._gimbal_attitude
        if self._a.streams:
            stations = {name: partial(self._for_stations, maker) for name, maker in STATION_MESSAGES.items()}
            self._makers = stations | self._makers
        if self._a.local_message == "ODOMETRY":
            self._makers["ODOMETRY"] = self._odometry
            del self._makers["LOCAL_POSITION_NED"]
        if not self._a.has_quaternion:
            del self._makers["ATTITUDE_QUATERNION"]

    def knows(self, name: str) -> bool:
        """Whether this autopilot can send this message."""
        return name in self._makers

    def fields(self, name: str, host_ns: int) -> Fields | None:
        """Fields of a message sent at this instant."""
        return self._makers[name](host_ns)

    def flight_s(self, host_ns: int) -> float:
        """Flight time: seconds since the start."""
        return (host_ns - self._start) * 1e-9

    def _boot_ms(self, host_ns: int) -> int:
        return self._clock.boot_ns(host_ns) // 1_000_000 % 2**32

    def _boot_us(self, host_ns: int) -> int:
        return self._clock.boot_ns(host_ns) // 1000

    def _attitude_now(self, host_ns: int) -> tuple[int, Vector, Vector]:
        """(stamp, Euler angles, rates): stamped at sending, of an attitude up to one scheduler loop older."""
        stamp_ms = self._boot_ms(host_ns)
        if self._a.attitude_on_whole_ms:
            boot_ns = self._clock.boot_ns(host_ns)
            of_ns = self._clock.host_ns(boot_ns - boot_ns % 1_000_000)
        else:
            delay_s = 1.0 / self._a.loop_rate_hz if self._a.stamp_delay_s is None else self._a.stamp_delay_s
            of_ns = host_ns - round(self._rng.uniform(0.0, delay_s) * 1e9)
        euler, rates = self._belief.attitude(self.flight_s(of_ns))
        return stamp_ms, euler, (0.0, 0.0, 0.0) if self._a.firmware == "betaflight" else rates

    def _attitude(self, host_ns: int) -> Fields:
        stamp_ms, (roll, pitch, yaw), (p, q, r) = self._attitude_now(host_ns)
        if self._a.firmware == "ardupilot" and not self._a.flight_options & TRIM_STAYS_BIT:
            pitch -= radians(self._a.pitch_trim_deg)
        return {
            "time_boot_ms": stamp_ms,
            "roll": _wrapped(roll),
            "pitch": pitch,
            "yaw": _wrapped(yaw),
            "rollspeed": p,
            "pitchspeed": q,
            "yawspeed": r,
        }

    def _attitude_quaternion(self, host_ns: int) -> Fields:
        stamp_ms, euler, (p, q, r) = self._attitude_now(host_ns)
        w, x, y, z = quaternion_from_euler(*euler)
        return {
            "time_boot_ms": stamp_ms,
            "q1": w,
            "q2": x,
            "q3": y,
            "q4": z,
            "rollspeed": p,
            "pitchspeed": q,
            "yawspeed": r,
        }

    def _global_position(self, host_ns: int) -> Fields:
        t = self.flight_s(host_ns)
        place, velocity = self._belief.position(t)
        height_m = place.alt_amsl - self._belief.home(self.armed).alt_amsl
        if not self._belief.has_position(t):
            place, velocity = NO_POSITION, (0.0, 0.0, 0.0)
        yaw = self._belief.truth(t).euler[2]
        return {
            "time_boot_ms": self._boot_ms(host_ns),
            "lat": round(place.lat * 1e7),
            "lon": round(place.lon * 1e7),
            "alt": round(place.alt_amsl * 1e3),
            "relative_alt": round(height_m * 1e3),
            "vx": round(velocity[0] * 100),
            "vy": round(velocity[1] * 100),
            "vz": round(velocity[2] * 100),
            "hdg": round(degrees(yaw) % 360.0 * 100) % 36000,
        }

    def _local_position(self, host_ns: int) -> Fields | None:
        t = self.flight_s(host_ns)
        if self._belief.has_position(t):
            place, velocity = self._belief.position(t)
            position = self._belief.projection.local(place)
        elif self._belief.has_flow(t):
            position, velocity = self._belief.flow_position(t)
        else:
            return None
        (x, y, z), (vx, vy, vz) = position, velocity
        return {"time_boot_ms": self._boot_ms(host_ns), "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz}

    def _odometry(self, host_ns: int) -> Fields | None:
        """The local position by ODOMETRY: place in LOCAL_NED, velocity in BODY_FRD, as of PX4 before 1.13."""
        local = self._local_position(host_ns)
        if local is None:
            return None
        t = self.flight_s(host_ns)
        euler = self._belief.own_state(t).euler
        vx, vy, vz = apply_transposed(matrix_from_euler(*euler), (local["vx"], local["vy"], local["vz"]))
        return {
            **{name: local[name] for name in ("x", "y", "z")},
            "time_usec": self._boot_us(host_ns),
            "frame_id": LOCAL_NED,
            "child_frame_id": BODY_FRD,
            "q": list(quaternion_from_euler(*euler)),
            "vx": vx,
            "vy": vy,
            "vz": vz,
            **dict.fromkeys(("rollspeed", "pitchspeed", "yawspeed"), 0.0),
            "pose_covariance": [nan] * 21,
            "velocity_covariance": [nan] * 21,
            "reset_counter": (RESETS_BEFORE + self._belief.resets(t)) % 256,
            "estimator_type": ESTIMATOR_AUTOPILOT,
            "quality": 0,
        }

    def _filter_status(self, host_ns: int) -> Fields:
        """EKF_STATUS_REPORT or ESTIMATOR_STATUS: which positions the filter vouches for."""
        t = self.flight_s(host_ns)
        flags = FILTER_ATTITUDE_AND_HEIGHT
        if self._belief.has_position(t):
            flags |= FILTER_GLOBAL
        elif self._belief.has_flow(t):
            flags |= FILTER_LOCAL
        else:
            flags |= FILTER_CONSTANT
        if self._a.firmware == "px4":
            ratios = dict.fromkeys(("vel_ratio", "pos_horiz_ratio", "pos_vert_ratio", "mag_ratio"), 0.1)
            accuracies = {"pos_horiz_accuracy": 0.5, "pos_vert_accuracy": 0.5}
            rest = {"time_usec": self._boot_us(host_ns), "hagl_ratio": 0.0, "tas_ratio": 0.0}
            return {"flags": flags, **ratios, **accuracies, **rest}
        names = ("velocity_variance", "pos_horiz_variance", "pos_vert_variance", "compass_variance")
        return {"flags": flags, **dict.fromkeys(names, 0.1), "terrain_alt_variance": 0.0, "airspeed_variance": 0.0}

    def _altitude(self, host_ns: int) -> Fields:
        place, _ = self._belief.position(self.flight_s(host_ns))
        relative = place.alt_amsl - self._belief.home(self.armed).alt_amsl
        return {
            "time_usec": self._boot_us(host_ns),
            "altitude_monotonic": relative + 3.0,
            "altitude_amsl": place.alt_amsl,
            "altitude_local": place.alt_amsl - self._belief.projection.origin.alt_amsl,
            "altitude_relative": relative,
            "altitude_terrain": nan,
            "bottom_clearance": nan,
        }

    def _vfr_hud(self, host_ns: int) -> Fields:
        place, velocity = self._belief.position(self.flight_s(host_ns))
        speed = hypot(velocity[0], velocity[1])
        yaw = self._belief.truth(self.flight_s(host_ns)).euler[2]
        return {
            "airspeed": speed,
            "groundspeed": speed,
            "heading": int(degrees(yaw) % 360.0) % 360,
            "throttle": 60,
            "alt": place.alt_amsl,
            "climb": -velocity[2],
        }

    def _gps_raw(self, host_ns: int) -> Fields:
        t = self.flight_s(host_ns)
        has = self._belief.has_position(t)
        place, velocity = self._belief.position(t)
        if not has:
            place, velocity = NO_POSITION, (0.0, 0.0, 0.0)
        course = degrees(atan2(velocity[1], velocity[0])) % 360.0
        return {
            "time_usec": self._boot_us(host_ns),
            "fix_type": self._a.fix_type if has else 1,
            "lat": round(place.lat * 1e7),
            "lon": round(place.lon * 1e7),
            "alt": round(place.alt_amsl * 1e3),
            "eph": 80 if has else 9999,
            "epv": 120 if has else 9999,
            "vel": round(hypot(velocity[0], velocity[1]) * 100),
            "cog": round(course * 100) % 36000,
            "satellites_visible": 17 if has else 2,
            "alt_ellipsoid": round((place.alt_amsl + self._a.undulation_m) * 1e3) if has else 0,
            "h_acc": round(self._a.h_acc_m * 1e3),
            "v_acc": 1500,
            "vel_acc": 200,
        }

    def _distance_sensor(self, host_ns: int) -> Fields | None:
        if not self._a.rangefinder:
            return None
        measured_cm = round(self._belief.range_m(self.flight_s(host_ns)) * 100)
        inside = 20 <= measured_cm <= 5000
        return {
            "time_boot_ms": self._boot_ms(host_ns),
            "min_distance": 20,
            "max_distance": 5000,
            "current_distance": min(65535, measured_cm),
            "type": 0,
            "id": 0,
            "orientation": DOWNWARD,
            "covariance": 255,
            "signal_quality": 100 if inside else 1,
        }

    def _system_time(self, host_ns: int) -> Fields:
        known = self._belief.has_position(self.flight_s(host_ns))
        unix_us = host_ns // 1000 + round(self.utc_minus_host_s * 1e6)
        return {"time_unix_usec": unix_us if known else 0, "time_boot_ms": self._boot_ms(host_ns)}

    def _global_origin(self, host_ns: int) -> Fields | None:
        if not self._belief.has_position(self.flight_s(host_ns)):
            return None
        origin = self._belief.projection.origin
        return {
            "latitude": round(origin.lat * 1e7),
            "longitude": round(origin.lon * 1e7),
            "altitude": round(origin.alt_amsl * 1e3),
            "time_usec": self._boot_us(host_ns),
        }

    def _home_position(self, host_ns: int) -> Fields | None:
        if not self._a.sends_home or not self._belief.has_position(self.flight_s(host_ns)):
            return None
        home = self._belief.home(self.armed)
        x, y, z = self._belief.projection.local(home)
        return {
            "latitude": round(home.lat * 1e7),
            "longitude": round(home.lon * 1e7),
            "altitude": round(home.alt_amsl * 1e3),
            "x": x,
            "y": y,
            "z": z,
            "q": [1.0, 0.0, 0.0, 0.0],
            "approach_x": 0.0,
            "approach_y": 0.0,
            "approach_z": 0.0,
            "time_usec": self._boot_us(host_ns),
        }

    def _for_stations(self, maker: Maker, host_ns: int) -> Fields:
        return maker(self._boot_us(host_ns), self.flight_s(host_ns))

    def _gimbal_attitude(self, host_ns: int) -> Fields:
        return self._belief.gimbal.fields(self.flight_s(host_ns), self._boot_ms(host_ns))

    def _raw_imu(self, host_ns: int) -> Fields:
        fields: Fields = dict.fromkeys(("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag"), 0)
        rates = self._belief.attitude(self.flight_s(host_ns))[1]
        for axis, rate in zip("xyz", rates, strict=True):
            fields[f"{axis}gyro"] = max(-32768, min(32767, round(rate * 1000)))
        return {"time_usec": self._boot_us(host_ns), **fields, "zacc": -1000}

    def _servo_output(self, host_ns: int) -> Fields:
        outputs = {f"servo{i}_raw": 1500 for i in range(1, 9)}
        return {"time_usec": self._boot_us(host_ns) % 2**32, "port": 0, **outputs}


def _wrapped(angle: float) -> float:
    return (angle + pi) % (2.0 * pi) - pi
